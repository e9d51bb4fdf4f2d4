"""From a mask of the seen picture to the device's pixels in the ideal camera's picture."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom.arrays import Floats

from .model import Lens

Mask = npt.NDArray[np.bool_]

_CELL_PX = 8
# Rows and columns of a cell's corners, and what these weigh at its pixels, (64, 4).
_AROUND = ((0, 0), (0, 1), (1, 0), (1, 1))
_SHARES = np.arange(_CELL_PX) / _CELL_PX
_WEIGHTS = np.stack(
    [
        np.outer(_SHARES if i else 1 - _SHARES, _SHARES if j else 1 - _SHARES).ravel()
        for i, j in _AROUND
    ],
    axis=1,
)
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
    quickly = _by_cells(mask, lens)
    return _by_pixels(mask, lens) if quickly is None else quickly


def _by_cells(mask: Mask, lens: Lens) -> Floats | None:
    """The same as `_by_pixels`, for cells of 8 × 8 pixels; None at the rim of the lens model.

    Only cells through which the mask's outline may run are looked up pixel by pixel.
    """
    corners = _undistorted_corners(lens, mask.shape)
    some, full = _any_and_all(mask)
    row, column = np.nonzero(some)
    quads = np.stack([corners[row + i, column + j] for i, j in _AROUND])  # (4, k, 2)
    low, high = quads.min(axis=0), quads.max(axis=0)
    size = float((high - low).max())
    if not size < _MOST_STRETCH * _CELL_PX:  # nor where there is a corner that is not a number
        return None
    first = np.floor((low - 1) / _CELL_PX).astype(int)
    last = np.floor((high + 1) / _CELL_PX).astype(int)
    start = first.min(axis=0)
    held = np.zeros((last.max(axis=0) - start + 1)[::-1], dtype=bool)
    if held.size * _CELL_PX**2 > _MOST_PIXELS:
        return None
    for i, j in np.ndindex(*((last - first).max(axis=0)[::-1] + 1)):
        y, x = (np.minimum(first + np.array([j, i]), last) - start).T[::-1]
        held[y, x] = True
    cells = np.argwhere(held)
    nodes = np.pad(held, ((0, 1), (0, 1)))
    nodes[1:] |= nodes[:-1].copy()
    nodes[:, 1:] |= nodes[:, :-1].copy()
    values = np.full((*nodes.shape, 2), np.nan)
    values[nodes] = lens.distort_where_defined(
        ((np.argwhere(nodes)[:, ::-1] + start) * _CELL_PX).astype(np.float64)
    )
    y, x = cells.T
    shown = np.stack([values[y + i, x + j] for i, j in _AROUND], axis=1)  # (m, 4, 2)
    covered = _inside(full, shown)
    partly = np.flatnonzero(~covered)
    places = np.nan_to_num(_WEIGHTS @ shown[partly], nan=-1e6)  # (., 64, 2)
    cover = ndimage.map_coordinates(
        mask.view(np.uint8), places.reshape(-1, 2)[:, ::-1].T, output=np.float32, order=1
    )
    drawn = np.zeros((held.shape[0], _CELL_PX, held.shape[1], _CELL_PX), dtype=bool)
    drawn[y[covered], :, x[covered]] = True
    found = cover.reshape(-1, _CELL_PX, _CELL_PX) >= 0.5
    drawn[y[partly], :, x[partly]] = found
    row, column = np.divmod(np.flatnonzero(drawn), held.shape[1] * _CELL_PX)
    return np.asarray(np.column_stack([column, row]) + start * _CELL_PX, dtype=np.float64)


def _any_and_all(mask: Mask) -> tuple[Mask, Mask]:
    """Which cells of 8 × 8 pixels hold some of a mask, and which are full, (rows, columns)."""
    rows, columns = (-(-length // _CELL_PX) for length in mask.shape)
    whole = np.zeros((rows * _CELL_PX, columns * _CELL_PX), dtype=np.uint8)
    whole[: mask.shape[0], : mask.shape[1]] = mask
    # Eight pixels of a row, a byte each, are one number.
    eight = whole.view(np.uint64).reshape(rows, _CELL_PX, columns)
    some, full = np.bitwise_or.reduce(eight, axis=1), np.bitwise_and.reduce(eight, axis=1)
    return some != 0, full == np.uint64(0x0101010101010101)


def _inside(full: Mask, shown: Floats) -> Mask:
    """Which cells, by where their corners are seen, (m, 4, 2), surely lie all in the mask, (m,)."""
    full = ndimage.binary_erosion(full, np.ones((3, 3), dtype=bool))
    middle = shown.mean(axis=1)
    # They lie in the 3 × 3 blocks about the one of their middle.
    near = np.nan_to_num(np.abs(shown - middle[:, None]).max(axis=(1, 2)), nan=np.inf) < _CELL_PX
    at = np.floor(np.nan_to_num(middle, nan=-1) / _CELL_PX)
    known = near & np.all((at >= 0) & (at < full.shape[::-1]), axis=1)
    column, row = at[known].astype(int).T
    inside = np.zeros(len(shown), dtype=bool)
    inside[known] = full[row, column]
    return inside


@lru_cache(maxsize=4)
def _undistorted_corners(lens: Lens, shape: tuple[int, int]) -> Floats:
    """Where the corners of the cells of a seen picture are in the ideal one, (r + 1, c + 1, 2)."""
    counts = [-(-length // _CELL_PX) + 1 for length in shape]
    corners = _CELL_PX * np.indices(counts)[::-1].reshape(2, -1).T.astype(np.float64)
    # A block of whole pixels reaches half of one farther than its first.
    return lens.undistort_where_defined(corners - 0.5).reshape(*counts, 2)


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
    low = np.floor(pixels.min(axis=0) / _CELL_PX).astype(int)
    place = pixels / _CELL_PX - low
    cell = np.floor(place).astype(int)
    x, y = cell.T
    held = np.zeros(cell.max(axis=0)[::-1] + 2, dtype=bool)
    held[y, x] = True
    # A cell's corners are its own and those to the right and below.
    held[1:] |= held[:-1].copy()
    held[:, 1:] |= held[:, :-1].copy()
    nodes = np.argwhere(held)
    values = np.full((*held.shape, 2), np.nan)
    values[held] = function(((nodes[:, ::-1] + low) * _CELL_PX).astype(np.float64))
    u, v = (place - cell).T[..., None]
    above = (1 - u) * values[y, x] + u * values[y, x + 1]
    below = (1 - u) * values[y + 1, x] + u * values[y + 1, x + 1]
    return np.asarray((1 - v) * above + v * below)
