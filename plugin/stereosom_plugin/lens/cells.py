"""A mask freed of its lens distortion by cells of 8 × 8 pixels: `Cells`."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from stereosom.arrays import Floats

from .loops import loops
from .loops.reference import CELL_PX, Mask
from .model import Lens

# More of the ideal picture than this, px, is not worth being known by cells.
_MOST_PIXELS = 16e6
# Rows and columns of a cell's corners.
_AROUND = ((0, 0), (0, 1), (1, 0), (1, 1))
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
        if min(shape) < 2:
            self._known[:] = False
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
        y, x = np.nonzero(held)
        self._cells = np.column_stack([x, y]) + start
        self._quads = np.ascontiguousarray(np.moveaxis(quads[:, held], 0, 1))
        low, up = low[held], up[held]
        self._within = ((low >= 0) & (up <= most)).all(axis=1)
        # The cells of the seen picture that each touches; between pixels both neighbors count.
        first = np.maximum(np.floor(low).astype(int) // CELL_PX, 0)
        stop = np.minimum(np.ceil(up).astype(int) // CELL_PX + 1, counts[::-1])
        self._boxes = np.hstack([first, stop]).astype(np.int16)

    def undistorted(self, mask: Mask) -> Floats | None:
        """Whole pixels (x, y) that a mask covers in the ideal picture, (n, 2), row by row.

        Returns
        -------
        (n, 2) array or None
            None at the rim of the lens model, where cells tell nothing.
        """
        some, full = _any_and_all(mask)
        if np.any(some & ~self._known):
            return None
        pixels: Floats = loops().covered(
            np.ascontiguousarray(mask), some, full,
            self._cells, self._quads, self._boxes, self._within,
        )  # fmt: skip
        return pixels


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
