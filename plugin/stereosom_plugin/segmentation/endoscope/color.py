"""The color of a device, learned from a stroke or a box that a user draws."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom_plugin.errors import InputError

from ..loops import loops
from .frame import Light

Box = tuple[float, float, float, float]
Stroke = Sequence[tuple[float, float]]

# Shades of each color that are told apart, and how far each sample spreads over them.
SHADES, SPREAD = 24, 0.8
# Weight of the evenly spread color that stands for all that was never seen.
NEVER_SEEN = 0.02


class DeviceColor:
    """How much likelier each color is on the device than elsewhere.

    The colors of the sample, counted, against those of the whole picture: a box may hold some
    background too, for what is common elsewhere as well counts for nothing.

    Parameters
    ----------
    picture : (rows, columns, channels) array
        Light, 0 to 1.
    sample : (rows, columns) array of bool
        Where the user says that the device is.

    Notes
    -----
    M. J. Jones, J. M. Rehg, "Statistical color models with application to skin detection",
    International Journal of Computer Vision 46(1), 2002.
    """

    def __init__(self, picture: Light, sample: npt.NDArray[np.bool_]) -> None:
        counts = loops().counted(picture, sample, SHADES)
        device, elsewhere = (_frequencies(each, picture.shape[2]) for each in counts)
        self.log_quotient = np.log((device + 1e-9) / (elsewhere + 1e-9)).astype(np.float32)

    def __call__(self, picture: Light) -> Light:
        """Logarithm of the likelihood quotient of each pixel, (rows, columns)."""
        return np.asarray(self.log_quotient.take(loops().shades(picture, SHADES)))


def in_box(shape: tuple[int, ...], box: Box) -> npt.NDArray[np.bool_]:
    """The pixels of a box (x, y, width, height), (rows, columns).

    Raises
    ------
    InputError
        Where the box is empty or lies outside the picture.

    Examples
    --------
    >>> in_box((4, 6), (1, 2, 3, 1)).nonzero()[1].tolist()
    [1, 2, 3]
    """
    if len(box) != 4 or not np.isfinite(box).all():
        raise InputError("color box", "is not x,y,width,height", "give four numbers of pixels")
    x, y, width, height = (round(float(value)) for value in box)
    inside = np.zeros(shape[:2], dtype=bool)
    inside[max(y, 0) : max(y + height, 0), max(x, 0) : max(x + width, 0)] = True
    if width < 1 or height < 1 or not inside.any() or inside.all():
        raise InputError(
            f"color box {x},{y},{width},{height}",
            f"holds no part of the {shape[1]}×{shape[0]} picture, or all of it",
            "draw it about a piece of the device",
        )
    return inside


def on_stroke(shape: tuple[int, ...], stroke: Stroke) -> npt.NDArray[np.bool_]:
    """The pixels of a line through points (x, y), (rows, columns).

    Raises
    ------
    InputError
        Where no point lies in the picture.

    Examples
    --------
    >>> on_stroke((4, 6), [(1, 2), (3, 2)]).nonzero()[1].tolist()
    [1, 2, 3]
    """
    points = np.asarray(stroke, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InputError("stroke", "is no line of points x,y", "give pixels along the device")
    inside = np.zeros(shape[:2], dtype=bool)
    for start, stop in pairwise(points):
        steps = int(min(np.abs(stop - start).max(), 1e5)) + 1
        column, row = np.rint(np.linspace(start, stop, steps + 1)).astype(int).T
        kept = (row >= 0) & (column >= 0) & (row < shape[0]) & (column < shape[1])
        inside[row[kept], column[kept]] = True
    if not inside.any():
        raise InputError("stroke", "does not touch the picture", "draw it along the device")
    return inside


def _frequencies(counts: npt.NDArray[np.intp], channels: int) -> npt.NDArray[np.float64]:
    shape = (SHADES,) * channels
    smooth = ndimage.gaussian_filter(counts.reshape(shape).astype(float), SPREAD, mode="nearest")
    smooth /= max(float(smooth.sum()), 1e-12)
    return np.asarray((1 - NEVER_SEEN) * smooth + NEVER_SEEN / smooth.size)
