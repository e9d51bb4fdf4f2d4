"""A mask freed of its lens distortion by cells of 8 × 8 pixels: `Cells`."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats

from .model import Lens

Mask = npt.NDArray[np.bool_]
Numbers = npt.NDArray[np.intp]

CELL_PX = 8
# More of the ideal picture than this, px, is not worth being known by cells.
_MOST_PIXELS = 16e6

# Rows and columns of a cell's corners, and what these weigh at its pixels, (64, 4).
_AROUND = ((0, 0), (0, 1), (1, 0), (1, 1))
_SHARES = np.arange(CELL_PX) / CELL_PX
_WEIGHTS = np.stack(
    [
        np.outer(_SHARES if i else 1 - _SHARES, _SHARES if j else 1 - _SHARES).ravel()
        for i, j in _AROUND
    ],
    axis=1,
)
# Eight pixels of a row, a byte each, that all are device, as one number.
_ALL_EIGHT = np.uint64(0x0101010101010101)


class Cells:
    """Where a lens shows the cells of the ideal picture: the same for every frame of a film.

    Parameters
    ----------
    lens : Lens
    shape : (int, int)
        Rows and columns of the seen pictures.
    """

    def __init__(self, lens: Lens, shape: tuple[int, int]) -> None:
        counts = [-(-length // CELL_PX) for length in shape]
        seen = _corners(counts[0] + 1, counts[1] + 1)
        # A block of whole pixels reaches half of one farther than its first.
        ideal = lens.undistort_where_defined(seen.reshape(-1, 2) - 0.5).reshape(seen.shape)
        self._known: Mask = np.asarray(np.isfinite(_around(ideal)).all(axis=(0, 3)))
        if not self._known.any():
            return
        reached = ideal[np.isfinite(ideal).all(axis=2)]
        start = np.floor((reached.min(axis=0) - 1) / CELL_PX).astype(int)
        wide, high = np.floor((reached.max(axis=0) + 1) / CELL_PX).astype(int) - start + 1
        if float(wide) * float(high) * CELL_PX**2 > _MOST_PIXELS:
            self._known[:] = False
            return
        nodes = _corners(high + 1, wide + 1) + CELL_PX * start
        shown = lens.distort_where_defined(nodes.reshape(-1, 2)).reshape(nodes.shape)
        quads = _around(shown)
        held = np.isfinite(quads).all(axis=(0, 3))
        low, up = quads.min(axis=0), quads.max(axis=0)
        most = np.array(shape[::-1]) - 1
        with np.errstate(invalid="ignore"):
            held &= ((up >= 0) & (low <= most)).all(axis=2)
        self._start = start
        self._y, self._x = np.nonzero(held)
        self._quads = np.ascontiguousarray(np.moveaxis(quads[:, held], 2, 0))  # (2, 4, n)
        low, up = low[held], up[held]
        self._within = ((low >= 0) & (up <= most)).all(axis=1)
        # The cells of the seen picture that each touches; between pixels both neighbors count.
        first = np.maximum(np.floor(low).astype(int) // CELL_PX, 0)
        stop = np.minimum(np.ceil(up).astype(int) // CELL_PX + 1, counts[::-1])
        self._size = (stop - first).prod(axis=1)
        (left, top), (right, bottom) = first.T, stop.T
        self._box = [y * (counts[1] + 1) + x for y in (top, bottom) for x in (left, right)]

    def undistorted(self, mask: Mask) -> Floats | None:
        """Whole pixels (x, y) that a mask covers in the ideal picture, (n, 2), row by row.

        Only cells through which the mask's outline may run are looked up pixel by pixel.

        Returns
        -------
        (n, 2) array or None
            None at the rim of the lens model, where cells tell nothing.
        """
        some, full = _any_and_all(mask)
        if np.any(some & ~self._known):
            return None
        held = np.flatnonzero(self._count(some, slice(None)))
        if len(held) == 0:
            return np.empty((0, 2))
        inside = self._within[held] & (self._count(full, held) == self._size[held])
        y, x = self._y[held], self._x[held]
        top, left = y[0], x.min()
        y, x, wide = y - top, x - left, x.max() + 1 - left
        drawn = np.zeros((y[-1] + 1, CELL_PX, wide, CELL_PX), dtype=bool)
        drawn[y[inside], :, x[inside]] = True
        partly = ~inside
        drawn[y[partly], :, x[partly]] = _covered(mask, self._quads[..., held[partly]])
        row, column = np.divmod(np.flatnonzero(drawn), wide * CELL_PX)
        origin = CELL_PX * (np.array([left, top]) + self._start)
        return np.column_stack([column + origin[0], row + origin[1]]).astype(np.float64)

    def _count(self, cells: Mask, which: Any) -> Numbers:
        """How many of the seen picture's cells that some of the ideal one's touch are True."""
        upto = np.zeros((cells.shape[0] + 1, cells.shape[1] + 1), dtype=np.int32)
        np.cumsum(np.cumsum(cells, axis=0, dtype=np.int32), axis=1, out=upto[1:, 1:])
        a, b, c, d = (upto.ravel().take(corner[which]) for corner in self._box)
        return np.asarray(d - c - b + a)


@lru_cache(maxsize=4)
def cells_of(lens: Lens, shape: tuple[int, int]) -> Cells:
    """The cells of a lens, one and the same each time."""
    return Cells(lens, shape)


def _corners(rows: int, columns: int) -> Floats:
    """Corners (x, y) of cells, (rows, columns, 2)."""
    return CELL_PX * np.moveaxis(np.indices((rows, columns))[::-1], 0, 2).astype(np.float64)


def _around(corners: Floats) -> Floats:
    """The four corners of each cell, (4, rows, columns, 2)."""
    rows, columns = corners.shape[0] - 1, corners.shape[1] - 1
    return np.stack([corners[i : i + rows, j : j + columns] for i, j in _AROUND])


def _any_and_all(mask: Mask) -> tuple[Mask, Mask]:
    """Which cells of 8 × 8 pixels hold some of a mask, and which are full, (rows, columns)."""
    rows, columns = (-(-length // CELL_PX) for length in mask.shape)
    whole = np.ascontiguousarray(mask)
    if mask.shape != (rows * CELL_PX, columns * CELL_PX):
        whole = np.zeros((rows * CELL_PX, columns * CELL_PX), dtype=bool)
        whole[: mask.shape[0], : mask.shape[1]] = mask
    eight = whole.view(np.uint64).reshape(rows, CELL_PX, columns)
    some, full = np.bitwise_or.reduce(eight, axis=1), np.bitwise_and.reduce(eight, axis=1)
    return some != 0, full == _ALL_EIGHT


def _covered(mask: Mask, quads: Floats) -> Mask:
    """Which pixels of cells, (n, 8, 8), a mask, interpolated, covers for a half; none outside."""
    x, y = (np.ascontiguousarray(corners.T) @ _WEIGHTS.T for corners in quads)  # (n, 64)
    rows, wide = mask.shape
    outside = ~((x >= 0) & (x <= wide - 1) & (y >= 0) & (y <= rows - 1))
    x[outside] = y[outside] = 0
    column = np.minimum(x.astype(np.intp), wide - 2)
    row = np.minimum(y.astype(np.intp), rows - 2)
    flat, at = mask.view(np.uint8).ravel(), row * wide + column
    around = [flat.take(at + step) for step in (0, 1, wide, wide + 1)]
    total = around[0] + around[1] + around[2] + around[3]
    covered = total == len(around)
    mixed = (total > 0) & ~covered
    a, b, c, d = (value[mixed] for value in around)
    across, down = (x - column)[mixed], (y - row)[mixed]
    cover = (a * (1 - across) + b * across) * (1 - down) + (c * (1 - across) + d * across) * down
    covered[mixed] = cover.astype(np.float32) >= 0.5
    return np.asarray(covered & ~outside).reshape(-1, CELL_PX, CELL_PX)
