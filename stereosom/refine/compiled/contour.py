"""As `reference.contour`, with eight pixels in a row looked up at once."""

from __future__ import annotations

import numpy as np

from ...arrays import Integers
from ...numba_options import compiled
from ..reference.contour import AROUND, MARGIN

# From a pixel to those that an edge may lie towards, and half-way there.
_STEPS = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
_ACROSS = 0.5 * _STEPS
# The pixels around one and around the next lie in a square of this size, which begins here.
_SIDE = 8
_BEGIN = AROUND.min(axis=0) + np.minimum(_STEPS, 0)


def _toward() -> Integers:
    """For each step, row of the square and pattern of its pixels: where these lie, in sum."""
    weights = np.zeros((len(_STEPS), _SIDE, _SIDE, 2), dtype=np.int64)
    for number, (step, begin) in enumerate(zip(_STEPS, _BEGIN, strict=True)):
        for offset in AROUND:
            for column, row in (offset - begin, offset + step - begin):
                weights[number, row, column] += offset
    patterns = np.arange(1 << _SIDE)[:, None] >> np.arange(_SIDE) & 1
    return np.asarray(np.einsum("pc,nrcx->nrpx", patterns, weights))


_TOWARD = _toward()
# Pixels are kept by 32 in a word.
_WORD, _BITS = 32, 5


@compiled
def contour(pixels):  # type: ignore[no-untyped-def]
    """As `reference.contour`."""
    left, top = np.floor(pixels[:, 0].min()) - MARGIN, np.floor(pixels[:, 1].min()) - MARGIN
    width = int(np.rint(pixels[:, 0].max() - left)) + MARGIN + 1
    height = int(np.rint(pixels[:, 1].max() - top)) + MARGIN + 1
    inside = np.zeros(width * height, dtype=np.uint8)
    words = np.zeros((height, width // _WORD + 2), dtype=np.int64)
    at = np.empty(len(pixels), dtype=np.int64)
    for i in range(len(pixels)):
        column, row = int(np.rint(pixels[i, 0] - left)), int(np.rint(pixels[i, 1] - top))
        at[i] = row * width + column
        inside[at[i]] = 1
        words[row, column >> _BITS] |= 1 << (column & (_WORD - 1))
    kept, count = 0, 0
    for i in range(len(at)):
        missing = 0
        for step in (1, -1, width, -width):
            missing += inside[at[i] + step] == 0
        if missing and inside[at[i]] == 1:
            inside[at[i]] = 2  # counted
            at[kept] = at[i]
            kept += 1
            count += missing
    at = at[:kept]
    for i in range(kept - 1):
        if at[i] > at[i + 1]:  # most masks come row by row
            at = np.sort(at)
            break
    rows = at // width
    columns = at - rows * width
    points, directions = np.empty((count, 2)), np.empty((count, 2))
    k = 0
    for number in range(len(_STEPS)):
        step = _STEPS[number, 1] * width + _STEPS[number, 0]
        across_x, across_y = _ACROSS[number, 0], _ACROSS[number, 1]
        for i in range(kept):
            if inside[at[i] + step]:
                continue
            column, row = columns[i], rows[i]
            points[k, 0] = column + across_x + left
            points[k, 1] = row + across_y + top
            to_x, to_y = 0, 0
            begin = column + _BEGIN[number, 0]
            word, bit = begin >> _BITS, begin & (_WORD - 1)
            for j in range(_SIDE):
                line = row + _BEGIN[number, 1] + j
                if line >= height:
                    break
                both = words[line, word] | words[line, word + 1] << _WORD
                pattern = both >> bit & ((1 << _SIDE) - 1)
                to_x += _TOWARD[number, j, pattern, 0]
                to_y += _TOWARD[number, j, pattern, 1]
            x, y = 0.5 * across_x - to_x, 0.5 * across_y - to_y
            length = max(np.sqrt(x**2 + y**2), 1e-9)
            directions[k, 0], directions[k, 1] = x / length, y / length
            k += 1
    return points, directions
