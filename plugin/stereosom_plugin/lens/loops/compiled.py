"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from __future__ import annotations

from math import ceil

import numpy as np

from stereosom.numba_options import compiled

from .reference import CELL_PX

_ALL = 2**CELL_PX - 1


@compiled
def covered(mask, some, full, cells, quads, boxes, within):  # type: ignore[no-untyped-def]
    """As `reference.covered`."""
    left, top, right, bottom = _bounds(some)
    held, count = np.empty(len(cells), np.intp), 0
    drawn = np.empty((len(cells), CELL_PX), np.uint8)  # of each cell's rows, a bit to a pixel
    total = 0
    for i in range(len(cells)):
        begin, first, end, last = boxes[i]
        if first >= bottom or last <= top or begin >= right or end <= left:
            continue
        touched, filled = False, within[i]
        for y in range(first, last):
            for x in range(begin, end):
                touched |= some[y, x]
                filled &= full[y, x]
        if touched and not filled:  # by its pixels, most of these are all device, or none of it
            touched, filled = _some_and_all(mask, quads[i], within[i])
        if touched:
            held[count] = i
            if filled:
                drawn[count] = _ALL
                total += CELL_PX**2
            else:
                total += _look_up(mask, quads[i], drawn[count])
            count += 1
    pixels, at = np.empty((total, 2)), 0
    start = 0
    while start < count:
        line, stop = cells[held[start], 1], start
        while stop < count and cells[held[stop], 1] == line:
            stop += 1
        for row in range(CELL_PX):
            y = CELL_PX * line + row
            for k in range(start, stop):
                bits, x = drawn[k, row], CELL_PX * cells[held[k], 0]
                if bits == _ALL:
                    for column in range(CELL_PX):
                        pixels[at + column, 0], pixels[at + column, 1] = x + column, y
                    at += CELL_PX
                elif bits:
                    for column in range(CELL_PX):
                        if bits >> column & 1:
                            pixels[at, 0], pixels[at, 1] = x + column, y
                            at += 1
        start = stop
    return pixels


@compiled
def _bounds(some):  # type: ignore[no-untyped-def]
    """First column and row of True, and those after the last."""
    rows, columns = some.shape
    left, top, right, bottom = columns, rows, 0, 0
    for y in range(rows):
        for x in range(columns):
            if some[y, x]:
                left, right = min(left, x), max(right, x + 1)
                top, bottom = min(top, y), y + 1
    return left, top, right, bottom


@compiled
def _some_and_all(mask, quad, within):  # type: ignore[no-untyped-def]
    """Whether a mask holds any pixel of the box about a cell's corners, and all of them."""
    rows, columns = mask.shape
    low_x, low_y = quad[0]
    up_x, up_y = quad[0]
    for k in range(1, 4):
        low_x, up_x = min(low_x, quad[k, 0]), max(up_x, quad[k, 0])
        low_y, up_y = min(low_y, quad[k, 1]), max(up_y, quad[k, 1])
    left, right = np.uint64(max(low_x, 0.0)), np.uint64(min(ceil(up_x), columns - 1.0) + 1)
    top, bottom = np.uint64(max(low_y, 0.0)), np.uint64(min(ceil(up_y), rows - 1.0) + 1)
    some, every = False, within
    for y in range(top, bottom):
        for x in range(left, right):
            some |= mask[y, x]
            every &= mask[y, x]
    return some, every


@compiled
def _look_up(mask, quad, drawn):  # type: ignore[no-untyped-def]
    """Which pixels of a cell a mask covers for a half, and how many."""
    rows, wide = mask.shape
    count = 0
    for i in range(CELL_PX):
        v = i / CELL_PX
        x_left, x_right = (
            (1 - v) * quad[0, 0] + v * quad[2, 0],
            (1 - v) * quad[1, 0] + v * quad[3, 0],
        )
        y_left, y_right = (
            (1 - v) * quad[0, 1] + v * quad[2, 1],
            (1 - v) * quad[1, 1] + v * quad[3, 1],
        )
        bits = 0
        for j in range(CELL_PX):
            u = j / CELL_PX
            x, y = (1 - u) * x_left + u * x_right, (1 - u) * y_left + u * y_right
            if not (0 <= x <= wide - 1 and 0 <= y <= rows - 1):
                continue
            # Without a sign, a place need not be looked at for a negative one.
            column, row = np.uint64(min(int(x), wide - 2)), np.uint64(min(int(y), rows - 2))
            right, below = column + np.uint64(1), row + np.uint64(1)
            a, b = mask[row, column], mask[row, right]
            c, d = mask[below, column], mask[below, right]
            if a == b == c == d:  # most are
                covers = a
            else:
                x, y = x - float(column), y - float(row)
                cover = (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y
                covers = np.float32(cover) >= 0.5
            if covers:
                bits |= 1 << j
                count += 1
        drawn[i] = bits
    return count
