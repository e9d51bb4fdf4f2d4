"""What takes the time of undistorting masks, in plain numpy: `compiled` gives the same, faster."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats

CELL_PX = 8

Mask = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.intp]

# What a cell's corners, (0, 0), (0, 1), (1, 0), (1, 1) by row and column, weigh at its pixels.
_SHARES = np.arange(CELL_PX) / CELL_PX
_WEIGHTS = np.stack(
    [
        np.outer(_SHARES if i else 1 - _SHARES, _SHARES if j else 1 - _SHARES).ravel()
        for i in (0, 1)
        for j in (0, 1)
    ],
    axis=1,
)


def covered(
    mask: Mask,
    some: Mask,
    full: Mask,
    cells: Numbers,
    quads: Floats,
    boxes: Numbers,
    within: Mask,
) -> Floats:
    """Whole pixels (x, y) of the ideal picture that a mask covers for a half, row by row.

    Only cells through which the mask's outline may run are looked up pixel by pixel.

    Parameters
    ----------
    mask : (rows, columns) array of bool
        The seen picture's, of two rows and columns at least.
    some, full : array of bool
        Which of the seen picture's cells hold some of the mask, and which nothing else.
    cells : (n, 2) array
        Columns and rows of cells of the ideal picture, row by row.
    quads : (n, 4, 2) array
        Where the seen picture shows their corners, px.
    boxes : (n, 4) array
        First column and row of the seen picture's cells that each touches, and those after the
        last.
    within : (n,) array of bool
        Which of them lie in the seen picture with all of their pixels.
    """
    held = np.flatnonzero(_count(some, boxes))
    if len(held) == 0:
        return np.empty((0, 2))
    (left, top, right, bottom), (x, y) = boxes[held].T, cells[held].T
    inside = within[held] & (_count(full, boxes[held]) == (right - left) * (bottom - top))
    first, begin = y[0], x.min()
    y, x, wide = y - first, x - begin, x.max() + 1 - begin
    drawn = np.zeros((y[-1] + 1, CELL_PX, wide, CELL_PX), dtype=bool)
    drawn[y[inside], :, x[inside]] = True
    partly = ~inside
    drawn[y[partly], :, x[partly]] = _looked_up(mask, quads[held[partly]])
    row, column = np.divmod(np.flatnonzero(drawn), wide * CELL_PX)
    return np.column_stack([column + CELL_PX * begin, row + CELL_PX * first]).astype(np.float64)


def _count(cells: Mask, boxes: Numbers) -> Numbers:
    """How many cells in each box are True."""
    upto = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1), dtype=np.intp)
    np.cumsum(np.cumsum(cells, axis=0), axis=1, out=upto[1:, 1:])
    left, top, right, bottom = boxes.T
    count = upto[bottom, right] - upto[bottom, left] - upto[top, right] + upto[top, left]
    return np.asarray(count)


def _looked_up(mask: Mask, quads: Floats) -> Mask:
    """Which pixels of cells, (n, 8, 8), a mask, interpolated, covers for a half; none outside."""
    x, y = (_WEIGHTS @ corners for corners in np.moveaxis(quads, 0, -1).swapaxes(0, 1))
    rows, wide = mask.shape
    outside = ~((x >= 0) & (x <= wide - 1) & (y >= 0) & (y <= rows - 1))
    x[outside] = y[outside] = 0
    column = np.minimum(x.astype(np.intp), wide - 2)
    row = np.minimum(y.astype(np.intp), rows - 2)
    x, y = x - column, y - row
    gray: npt.NDArray[Any] = mask.astype(np.float64)
    upper = gray[row, column] * (1 - x) + gray[row, column + 1] * x
    lower = gray[row + 1, column] * (1 - x) + gray[row + 1, column + 1] * x
    cover = upper * (1 - y) + lower * y
    found = (cover.astype(np.float32) >= 0.5) & ~outside
    return np.asarray(found.T).reshape(-1, CELL_PX, CELL_PX)
