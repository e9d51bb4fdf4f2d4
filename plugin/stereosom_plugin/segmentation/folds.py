"""The ends of a device that turn back on themselves in the picture."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from .picture import Gray, Mask
from .tube import Tube, edge_share

# Of the absorption on the axis: what is fainter is something else.
LEAST_SHARE = 0.7
# How far from the end a fold is looked for, in radii of the device.
FAR = 9.0
_SQUARE = np.ones((3, 3), dtype=bool)


def add_folds(mask: Mask, log: Gray, tube: Tube) -> None:
    """Add to a drawn tube what is as dark beside its free ends, in place.

    A device that points at the source, or away from it, bends back over itself in the picture,
    where no middle line follows it.

    Parameters
    ----------
    mask : (rows, columns) array of bool
        As drawn.
    log : (rows, columns) array
        Logarithm of the light.
    tube : Tube
    """
    for end in (0, -1):
        if tube.enters[end]:
            continue
        radius = float(tube.radius[end])
        reach = FAR * radius + 6
        low = np.maximum(np.floor(tube.line[end] - reach).astype(int), 0)
        high = np.minimum(np.ceil(tube.line[end] + reach).astype(int) + 1, mask.shape[::-1])
        window = slice(low[1], high[1]), slice(low[0], high[0])
        if min(mask[window].shape, default=0) < 4:
            continue
        smooth = ndimage.gaussian_filter(log[window], 0.6)
        size = 2 * round(2.6 * radius) + 3
        absorbed = ndimage.grey_closing(smooth, (size, size), mode="nearest") - smooth
        taken = 1 - np.exp(-absorbed)
        usual = 1 - np.exp(-tube.absorption)
        dark = taken > usual * edge_share(tube, 0.6)
        beyond = ndimage.binary_opening(dark & ~mask[window], _SQUARE)
        labels, count = ndimage.label(beyond, _SQUARE)
        if count == 0:
            continue
        numbers = np.arange(1, count + 1)
        core = np.array([np.percentile(taken[labels == number], 60) for number in numbers])
        row, column = np.nonzero(labels)
        away = np.hypot(column + low[0] - tube.line[end, 0], row + low[1] - tube.line[end, 1])
        nearest = ndimage.minimum(away, labels[row, column], numbers)
        touches = np.bincount(
            labels[ndimage.binary_dilation(mask[window], _SQUARE, iterations=2)],
            minlength=count + 1,
        )[1:]
        area = np.bincount(labels.ravel(), minlength=count + 1)[1:]
        kept = numbers[
            (core > LEAST_SHARE * usual)
            & (nearest < 3 * radius + 2)
            & (touches > 0)
            & (area > radius**2)
        ]
        if len(kept):
            added = np.isin(labels, kept)
            added = dark & ndimage.binary_dilation(added, _SQUARE)
            mask[window] |= added
