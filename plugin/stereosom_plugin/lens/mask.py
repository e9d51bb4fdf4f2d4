"""From a mask of the seen picture to the device's pixels in the ideal camera's picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats

from .cells import cells_of
from .loops.reference import CELL_PX, Mask
from .model import Lens

_MOST_STRETCH = 8
_MOST_PIXELS = 64e6


def undistorted_mask_pixels(mask: Any, lens: Lens) -> Floats:
    """Whole pixels (x, y) that the device covers in the ideal camera's picture, (n, 2).

    Only what lies near the device is asked for: where its pixels are undistorted is told first,
    and every whole pixel about there is distorted, to look up whether the mask covers it. So the
    result has neither the holes nor the doubles that moving each pixel by itself would leave
    where the lens stretches or shrinks.

    Parameters
    ----------
    mask : (rows, columns) array of bool
    lens : Lens

    Raises
    ------
    ValueError
        Where the mask reaches beyond what the lens model can undistort.

    Examples
    --------
    >>> from stereosom_plugin.lens import RadialTangentialLens
    >>> lens = RadialTangentialLens([[100, 0, 0], [0, 100, 0], [0, 0, 1]], [0.25, 0, 0, 0])
    >>> mask = np.zeros((4, 200), dtype=bool)
    >>> mask[0, 120:130] = True  # x = 100 is shown at 125
    >>> undistorted_mask_pixels(mask, lens)[:, 0]
    array([ 97.,  98.,  99., 100., 101., 102.])
    """
    mask = np.asarray(mask, dtype=bool)
    if not mask.any():
        return np.empty((0, 2))
    quickly = cells_of(lens, mask.shape).undistorted(mask)
    return _by_pixels(mask, lens) if quickly is None else quickly


def _by_pixels(mask: Mask, lens: Lens) -> Floats:
    """The device's pixels are undistorted one by one, and those about them distorted back."""
    row, column = np.nonzero(mask)
    seen = np.column_stack([column, row]).astype(np.float64)
    ideal = _smoothly(lens.undistort_where_defined, seen)
    unknown = ~np.isfinite(ideal).all(axis=1)
    if unknown.any():  # at the rim of the model, a node beyond it may have spoilt a cell
        ideal[unknown] = lens.undistort(seen[unknown])
    # How far apart two neighbors may land: so far around each we look.
    some = slice(None, None, max(1, len(seen) // 1000))
    nudged = lens.undistort_where_defined(seen[some] + np.where(seen[some] > 0.5, -0.5, 0.5))
    shift = np.nanmax(np.abs(nudged - lens.undistort(seen[some])), initial=0.5)
    reach = int(np.ceil(min(2 * shift, _MOST_STRETCH)))
    low = np.floor(ideal.min(axis=0)).astype(int) - reach - 1
    size = np.ceil(ideal.max(axis=0)).astype(int) + reach + 2 - low
    if np.prod(size, dtype=float) > _MOST_PIXELS:
        raise ValueError(
            f"lens: undistorted, the device covers {size[0]}×{size[1]} px; "
            "give a calibration that covers the picture"
        )
    near = np.zeros(size[::-1], dtype=bool)
    x, y = (np.rint(ideal).astype(int) - low).T
    near[y, x] = True
    near = ndimage.binary_dilation(near, np.ones((3, 3), dtype=bool), iterations=reach)
    candidates = (np.argwhere(near)[:, ::-1] + low).astype(np.float64)
    looked_up = np.nan_to_num(_smoothly(lens.distort_where_defined, candidates), nan=-1e6)
    cover = ndimage.map_coordinates(mask.astype(np.float32), looked_up[:, ::-1].T, order=1)
    return np.asarray(candidates[cover >= 0.5])


def _smoothly(function: Callable[[Floats], Floats], pixels: Floats) -> Floats:
    """A smooth map of pixels (n, 2), by its values at the corners of cells of 8 × 8 pixels.

    Lenses bend little within a cell: bilinear interpolation is right to some hundredths of a
    pixel, where a mask knows its edge to half of one, and takes a tenth of the time.
    """
    low = np.floor(pixels.min(axis=0) / CELL_PX).astype(int)
    place = pixels / CELL_PX - low
    cell = np.floor(place).astype(int)
    x, y = cell.T
    held = np.zeros(cell.max(axis=0)[::-1] + 2, dtype=bool)
    held[y, x] = True
    # A cell's corners are its own and those to the right and below.
    held[1:] |= held[:-1].copy()
    held[:, 1:] |= held[:, :-1].copy()
    nodes = np.argwhere(held)
    values = np.full((*held.shape, 2), np.nan)
    values[held] = function(((nodes[:, ::-1] + low) * CELL_PX).astype(np.float64))
    u, v = (place - cell).T[..., None]
    above = (1 - u) * values[y, x] + u * values[y, x + 1]
    below = (1 - u) * values[y + 1, x] + u * values[y + 1, x + 1]
    return np.asarray((1 - v) * above + v * below)
