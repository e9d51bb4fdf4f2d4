"""What every segmentation begins with: a checked picture, its field, and its logarithm."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom.arrays import Floats
from stereosom_plugin.errors import InputError, require

from .loops import loops

Mask = npt.NDArray[np.bool_]
Gray = npt.NDArray[np.float32]

# Of the brightest light in the picture; where less arrives, nothing can be seen.
LEAST_LIGHT = 0.01


def checked(image: Any) -> Gray:
    """Return the image as floats, (rows, columns), or say what is wrong with it.

    Raises
    ------
    InputError
        Where the image has no two dimensions or holds values that are not finite numbers.
    """
    array = np.asarray(image)
    if array.ndim != 2 or array.size == 0:
        shape = "×".join(map(str, array.shape)) or "a single number"
        raise InputError("image", f"is {shape}, not rows × columns", "give one gray picture")
    try:
        picture: Gray = array.astype(np.float32)
    except (TypeError, ValueError):
        raise InputError("image", "does not hold numbers", "give one gray picture") from None
    if array.dtype.kind == "f" and not np.isfinite(picture).all():
        raise InputError("image", "holds values that are not finite", "give every pixel a value")
    return picture


def in_polygon(pixels: npt.NDArray[Any], corners: Floats) -> Mask:
    """Whether pixels (n, 2) lie within a polygon of corners (x, y), (n,).

    Examples
    --------
    >>> square = np.array([[0.0, 0], [9, 0], [9, 9], [0, 9]])
    >>> in_polygon(np.array([[4, 4], [4, 12]]), square)
    array([ True, False])
    """
    points_in_poly = require("skimage.measure", "fluoroscopy").points_in_poly
    return np.asarray(points_in_poly(pixels.astype(float), corners))


def grown(mask: Mask) -> Mask:
    """A mask and all pixels next to it: a dilation by 3 × 3, in a tenth of the time.

    Examples
    --------
    >>> grown(np.array([[True, False, False]]))
    array([[ True,  True, False]])
    """
    rows = mask.copy()
    rows[1:] |= mask[:-1]
    rows[:-1] |= mask[1:]
    larger = rows.copy()
    larger[:, 1:] |= rows[:, :-1]
    larger[:, :-1] |= rows[:, 1:]
    return larger


def spread(mask: Mask, steps: int) -> Mask:
    """A mask and all pixels so many steps up, down, left or right of it, in a tenth of the time.

    Examples
    --------
    >>> spread(np.array([[True, False, False], [False] * 3]), 2)
    array([[ True,  True,  True],
           [ True,  True, False]])
    """
    wider = mask
    for _ in range(steps):
        before, wider = wider, wider.copy()
        wider[1:] |= before[:-1]
        wider[:-1] |= before[1:]
        wider[:, 1:] |= before[:, :-1]
        wider[:, :-1] |= before[:, 1:]
    return wider


def binned(picture: Gray, factor: int) -> Gray:
    """Mean of blocks of `factor` × `factor` pixels; what is left over at the far edges is dropped.

    Examples
    --------
    >>> binned(np.arange(16, dtype=np.float32).reshape(4, 4), 2).tolist()
    [[2.5, 4.5], [10.5, 12.5]]
    """
    if factor == 1:
        return picture
    rows, columns = (length // factor for length in picture.shape)
    whole = picture[: rows * factor, : columns * factor]
    total = sum(
        whole[i::factor, j::factor] for i in range(factor) for j in range(factor)
    )  # far quicker than a mean over two axes
    return np.asarray(total / np.float32(factor**2), dtype=np.float32)


def log_light(picture: Gray, least: float | None = None) -> Gray:
    """Natural logarithm of the light, which is held at `least`; default: `darkest`."""
    least = darkest(picture) if least is None else least
    return np.asarray(np.log(np.maximum(picture, np.float32(least))))


def log_across(picture: Gray, line: Floats, normals: Floats, across: Floats) -> Gray:
    """Natural logarithm of the light, (n, m), at m places, px, across n points of a line.

    Parameters
    ----------
    picture : (rows, columns) array
    line, normals : (n, 2) array
        Points, px, and directions across.
    across : (m,) array
    """
    light = loops().light_across(picture, line, normals, across, darkest(picture))
    return np.asarray(np.log(light))  # numpy's does several at once


def median(values: npt.NDArray[Any], axis: int) -> npt.NDArray[Any]:
    """Median along an axis of (n, m) finite numbers.

    Examples
    --------
    >>> median(np.array([[3, 1, 2, 9], [1, 1, 1, 5.0]]), axis=1).tolist()
    [2.5, 1.0]
    """
    return np.asarray(loops().medians(values if axis == 1 else values.T))


def middle(values: npt.NDArray[Any]) -> float:
    """Median of those of (n,) numbers that are finite."""
    finite = values[np.isfinite(values)]
    return float(median(finite[None], axis=1)[0]) if len(finite) else float("nan")


def blurred(values: Floats, deviation: float) -> Floats:
    """Gaussian blur along the first axis of (n,) or (n, m) values."""
    columns = values.reshape(len(values), -1)
    return np.asarray(loops().blurred(columns, gaussian(deviation)).reshape(values.shape))


@cache
def gaussian(deviation: float, reach: float = 4.0) -> Floats:
    """Weights (2 k + 1,) of a Gaussian blur that reaches so many deviations."""
    far = int(reach * deviation + 0.5)
    weights = np.exp(-0.5 * (np.arange(-far, far + 1) / deviation) ** 2)
    return np.asarray(weights / weights.sum())


def darkest(picture: Gray) -> float:
    """Least light that is told from none, in the picture's values."""
    some = picture[:: max(1, len(picture) // 32)]  # whole rows: those are looked through quickly
    return max(LEAST_LIGHT * float(some.max(initial=0)), 1e-6)


def noise_of(log: Gray, block: int = 16) -> Gray:
    """Standard deviation of the noise of a picture, block by block, one value per pixel.

    The median over a block of what a blur takes away: a thin device hardly counts.
    """
    rough = np.abs(log - ndimage.uniform_filter(log, 3))
    rows, columns = (max(1, length // block) for length in log.shape)
    part = rough[: rows * block, : columns * block]
    blocks = part.reshape(rows, part.shape[0] // rows, columns, part.shape[1] // columns)
    # A 3 × 3 mean takes 1/9 of the variance of white noise away with it.
    level = 1.4826 * np.median(blocks, axis=(1, 3)) / np.sqrt(8 / 9)
    row = np.minimum(np.arange(log.shape[0]) * rows // part.shape[0], rows - 1)
    column = np.minimum(np.arange(log.shape[1]) * columns // part.shape[1], columns - 1)
    return np.asarray(level[row][:, column], dtype=np.float32)
