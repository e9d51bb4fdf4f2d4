"""Thinning: a mask down to lines one pixel wide."""

from __future__ import annotations

import numpy as np

from ...arrays import Booleans

# The eight neighbors of a pixel, clockwise from the one above: (row, column).
RING = ((-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1))


def _removable() -> tuple[Booleans, Booleans]:
    """For both half-steps, whether a pixel with these neighbors (one bit each) may go."""
    bits = (np.arange(256)[:, None] >> np.arange(8)) & 1
    neighbors = bits.sum(axis=1)
    entries = np.sum((bits == 0) & (np.roll(bits, -1, axis=1) == 1), axis=1)
    up, right, down, left = bits[:, 0], bits[:, 2], bits[:, 4], bits[:, 6]
    simple = (neighbors >= 2) & (neighbors <= 6) & (entries == 1)
    first = simple & (up * right * down == 0) & (right * down * left == 0)
    second = simple & (up * right * left == 0) & (up * down * left == 0)
    return first, second


REMOVABLE = _removable()


def thin(mask: Booleans) -> Booleans:
    """Skeleton of a mask, (rows, columns): connected as the mask is, one pixel wide.

    T. Y. Zhang, C. Y. Suen, "A fast parallel algorithm for thinning digital patterns",
    Communications of the ACM 27(3), 1984; by a table, over the pixels that are left.

    Examples
    --------
    A bar three pixels thick leaves its middle row:

    >>> bar = np.zeros((5, 9), dtype=bool)
    >>> bar[1:4, 1:8] = True
    >>> np.unique(np.argwhere(thin(bar))[:, 0])
    array([2])
    """
    padded = np.pad(mask, 1).astype(np.uint8)
    flat = padded.ravel()
    offsets = [row * padded.shape[1] + column for row, column in RING]
    left = np.flatnonzero(flat)
    changed = True
    while changed:
        changed = False
        for removable in REMOVABLE:
            code = np.zeros(len(left), dtype=np.uint8)
            for bit, offset in enumerate(offsets):
                code |= flat[left + offset] << bit
            gone = removable[code]
            if gone.any():
                flat[left[gone]] = 0
                left = left[~gone]
                changed = True
    return padded[1:-1, 1:-1].astype(bool)
