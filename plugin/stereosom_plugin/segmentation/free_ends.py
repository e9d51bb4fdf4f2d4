"""The free ends of a device, pixel by pixel: rounded, or folded back over the device."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats

from .loops import loops
from .picture import Gray, Mask, darkest, gaussian, grown, log_across, log_light, middle
from .tube import Tube, edge_share

# Of the light that the axis takes: what takes less is something else that touches the end.
LEAST_SHARE = 0.6
# A fold is looked for so far from the end, and the shape of the end itself, in radii.
FOLD, END = 9.0, 2.5
# Further blur before pixels are judged one by one, px.
SMOOTHED = 0.6
# The noise must lie so many times below the level of an edge.
CLEAR = 3.5
# How far a circle falls back at three quarters of its radius, in radii, and the share of that
# which a flat end may show by noise.
ROUND, NOT_FLAT = 1 - np.sqrt(1 - 0.75**2), 0.3
_SQUARE = np.ones((3, 3), dtype=bool)


def sharpen_end(mask: Mask, picture: Gray, tube: Tube, end: int) -> None:
    """Give a drawn tube the free end (0 or -1) that the picture shows, in place.

    A device that points at the source, or away from it, ends round in the picture or bends
    back over itself, where no middle line follows it.

    Parameters
    ----------
    mask : (rows, columns) array of bool
        As drawn.
    picture : (rows, columns) array
        In proportion to the light.
    tube : Tube
    end : int
        0 or -1; nothing is done where it is none, at the border of the field.
    """
    if tube.enters[end]:
        return
    radius = float(tube.radius[end])
    place = tube.line[end]
    reach = FOLD * radius + 4
    low = np.maximum(np.floor(place - reach).astype(int), 0)
    high = np.minimum(np.ceil(place + reach).astype(int) + 1, mask.shape[::-1])
    window = slice(low[1], high[1]), slice(low[0], high[0])
    if min(mask[window].shape, default=0) < 4:
        return
    taken = _light_taken(log_light(picture[window], darkest(picture)), radius)
    drawn = mask[window]
    usual = 1 - np.exp(-tube.absorption)
    level = usual * edge_share(tube, SMOOTHED)
    noise = 1.4826 * middle(taken[~drawn]) if not drawn.all() else 0.0
    if level < CLEAR * noise:
        return
    dark = taken > level
    row, column = (
        np.arange(start, stop) for start, stop in zip(low[::-1], high[::-1], strict=True)
    )
    away = np.hypot(column - place[0], row[:, None] - place[1])
    beside = grown(drawn)
    at_end = away < END * radius + 1
    folded = _folded(dark, drawn, taken, away, radius, LEAST_SHARE * usual)
    mask[window] = (drawn & (dark | ~at_end)) | (dark & beside & at_end) | folded


def roundness(picture: Gray, tube: Tube, end: int) -> float:
    """How round an end (0 or -1) is in the picture: 0 flat, as that of a cut tube, to 1.

    Where the device bends towards the source its outermost place is a bend, not its end.
    """
    radius = float(tube.radius[end])
    line = tube.line if end == -1 else tube.line[::-1]
    back = min(len(line) - 1, 6)
    along = (line[-1] - line[-1 - back]) / np.linalg.norm(line[-1] - line[-1 - back])
    across = np.array([-along[1], along[0]])
    steps = np.arange(-2 * radius - 2, radius + 3, 0.5)
    places = 0.75 * radius * np.array([-1.0, 0.0, 1.0])
    middle = line[-1] + steps[:, None] * along
    log = log_across(picture, middle, np.tile(across, (len(middle), 1)), places)
    light = ndimage.gaussian_filter1d(log, 1.5, axis=0).astype(float)
    reached = [_reached(steps, light[:, column]) for column in range(3)]
    # How far a circle falls back at three quarters of its radius; the lesser of both sides, since
    # something dark may lie beside one. Noise alone makes some of it.
    share = (reached[1] - max(reached[0], reached[2])) / (ROUND * radius)
    return float(np.clip((share - NOT_FLAT) / (1 - 2 * NOT_FLAT), 0.0, 1.0))


def _reached(steps: Floats, light: Floats) -> float:
    """Where light rises half of its way."""
    level = (light[: len(light) // 4].mean() + light[-4:].mean()) / 2
    over = np.flatnonzero(light > level)
    if len(over) == 0 or over[0] == 0:
        return float(steps[-1 if len(over) == 0 else 0])
    first = over[0]
    return float(np.interp(level, light[first - 1 : first + 1], steps[first - 1 : first + 1]))


def _light_taken(log: Gray, radius: float) -> Gray:
    """Share of light that thin things take, the noise of bright surroundings at zero."""
    smooth = loops().smooth(log, gaussian(SMOOTHED))
    size = 2 * round(3 * radius) + 5
    closed = ndimage.grey_closing(smooth, (size, size), mode="nearest")
    lit = loops().smooth(closed, gaussian(2.0))
    return np.asarray(1 - np.exp(smooth - lit), dtype=np.float32)


def _folded(
    dark: Mask, drawn: Mask, taken: Gray, away: Floats, radius: float, least: float
) -> Mask:
    """Pieces beside the drawn tube that are as dark as it, and begin near its end."""
    beyond = ndimage.binary_opening(dark & ~drawn, np.ones((2, 2), dtype=bool))
    near = away < 3 * radius + 2
    if not (beyond & near).any():
        return np.zeros_like(dark)
    labels, count = ndimage.label(beyond, _SQUARE)
    numbers = np.arange(1, count + 1)
    begins = np.bincount(labels[near], minlength=count + 1)[1:] > 0
    touches = np.bincount(labels[grown(drawn)], minlength=count + 1)[1:] > 0
    large = np.bincount(labels.ravel(), minlength=count + 1)[1:] > radius**2 / 2
    kept = [
        number
        for number in numbers[begins & touches & large]
        if np.percentile(taken[labels == number], 60) > least
    ]
    return dark & grown(np.isin(labels, kept))
