"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from __future__ import annotations

import numpy as np

from ..numba_options import compiled
from .reference.thinning import REMOVABLE, RING
from .reference.tracing import DIAGONAL, STRAIGHT

_REMOVABLE = np.stack(REMOVABLE)
_RING = np.array(RING)
_NEXT = np.array(STRAIGHT + DIAGONAL)


@compiled
def small_mask(pixels, wide):  # type: ignore[no-untyped-def]
    """As `reference.small_mask`."""
    left, top = np.floor(pixels[:, 0].min()) - 1, np.floor(pixels[:, 1].min()) - 1
    columns = int(np.rint(pixels[:, 0].max() - left)) + 2
    rows = int(np.rint(pixels[:, 1].max() - top)) + 2
    mask = np.zeros((rows, columns), dtype=np.bool_)
    at = np.empty((len(pixels), 2), dtype=np.int32)
    for i in range(len(pixels)):
        at[i, 0], at[i, 1] = np.rint(pixels[i, 1] - top), np.rint(pixels[i, 0] - left)
        mask[at[i, 0], at[i, 1]] = True
    edges = 0
    for row in range(1, rows):
        for column in range(1, columns):
            edges += mask[row, column] != mask[row - 1, column]
            edges += mask[row, column] != mask[row, column - 1]
    width = 2 * len(pixels) / max(edges * np.pi / 4, 1.0)
    factor = max(1, int(width / wide))
    if factor == 1:
        return mask, left, top, factor
    filled = np.zeros((-(-rows // factor) + 2, -(-columns // factor) + 2), dtype=np.int32)
    for i in range(len(at)):
        filled[at[i, 0] // factor + 1, at[i, 1] // factor + 1] += 1
    return 2 * filled > factor**2, left - factor, top - factor, factor


@compiled
def without_small(mask, filled, share, limit):  # type: ignore[no-untyped-def]
    """As `reference.without_small`: by runs along the rows, each joined to those above."""
    rows, columns = mask.shape
    run = np.empty((rows * (columns // 2 + 1), 3), dtype=np.int32)  # row, start and stop
    piece = np.empty(len(run), dtype=np.int32)
    count, above = 0, 0
    for row in range(rows):
        begun, column = count, 0
        while column < columns:
            if mask[row, column] != filled:
                column += 1
                continue
            start = column
            while column < columns and mask[row, column] == filled:
                column += 1
            run[count, 0], run[count, 1], run[count, 2] = row, start, column
            piece[count] = count
            while above < begun and run[above, 2] + filled <= start:
                above += 1
            other = above
            while other < begun and run[other, 1] < column + filled:
                one, two = _first(piece, other), _first(piece, count)
                piece[max(one, two)] = min(one, two)
                other += 1
            count += 1
        above = begun
    size = np.zeros(count, dtype=np.int64)
    for k in range(count):
        piece[k] = _first(piece, k)
        size[piece[k]] += run[k, 2] - run[k, 1]
    largest = 0
    for k in range(count):
        largest = max(largest, size[k])
    small = min(share * largest, limit)
    turned = mask.copy()
    for k in range(count):
        if size[piece[k]] < small:
            turned[run[k, 0], run[k, 1] : run[k, 2]] = not filled
    return turned


@compiled
def _first(piece, k):  # type: ignore[no-untyped-def]
    """The first run of the piece that run k belongs to; the way there becomes shorter."""
    while piece[k] != k:
        piece[k] = piece[piece[k]]
        k = piece[k]
    return k


@compiled
def thin(mask):  # type: ignore[no-untyped-def]
    """As `reference.thin`."""
    rows, columns = mask.shape
    flat = np.zeros((rows + 2) * (columns + 2), dtype=np.uint8)
    left = np.empty(rows * columns, dtype=np.int32)
    count = 0
    for row in range(rows):
        for column in range(columns):
            if mask[row, column]:
                left[count] = (row + 1) * (columns + 2) + column + 1
                flat[left[count]] = 1
                count += 1
    offsets = _RING[:, 0] * (columns + 2) + _RING[:, 1]
    gone = np.empty(count, dtype=np.bool_)
    changed = True
    while changed:
        changed = False
        for half in range(2):
            for k in range(count):
                code = 0
                for bit in range(8):
                    code |= flat[left[k] + offsets[bit]] << bit
                gone[k] = _REMOVABLE[half, code]
            kept = 0
            for k in range(count):
                if gone[k]:
                    flat[left[k]] = 0
                else:
                    left[kept] = left[k]
                    kept += 1
            changed |= kept < count
            count = kept
    skeleton = np.zeros((rows, columns), dtype=np.bool_)
    for k in range(count):
        skeleton[left[k] // (columns + 2) - 1, left[k] % (columns + 2) - 1] = True
    return skeleton


@compiled
def trace(skeleton):  # type: ignore[no-untyped-def]
    """As `reference.trace`."""
    pixels, links, degree = _links(skeleton)
    node, order = _nodes(links, degree)
    used = np.zeros(links.shape, dtype=np.bool_)
    most = int(degree.sum())  # each link is gone once, and begins no more than one way
    between, stops = np.empty((most, 2), dtype=np.intp), np.empty(most, dtype=np.intp)
    ways = np.empty(2 * most, dtype=np.intp)
    count, length = 0, 0
    for begin in order:
        for first in range(degree[begin]):
            here = links[begin, first]
            if node[here] == node[begin] or used[begin, first]:
                continue
            before, ways[length], ways[length + 1] = begin, begin, here
            length += 2
            while node[here] < 0:
                onward = links[here, 0] if links[here, 0] != before else links[here, 1]
                before, here = here, onward
                ways[length] = here
                length += 1
            used[begin, first] = True
            for back in range(degree[here]):
                used[here, back] |= links[here, back] == before
            between[count, 0], between[count, 1] = node[begin], node[here]
            stops[count] = length
            count += 1
    return between[:count], stops[:count], pixels[ways[:length]]


@compiled
def _links(skeleton):  # type: ignore[no-untyped-def]
    """Pixels (n, 2), their neighbors (n, 8), and how many of them there are (n,)."""
    rows, columns = skeleton.shape
    place = np.full((rows + 2, columns + 2), -1, dtype=np.int32)
    count = 0
    for row in range(rows):
        for column in range(columns):
            if skeleton[row, column]:
                place[row + 1, column + 1] = count
                count += 1
    pixels = np.empty((count, 2), dtype=np.intp)
    links, degree = np.empty((count, 8), dtype=np.intp), np.zeros(count, dtype=np.intp)
    for row in range(1, rows + 1):
        for column in range(1, columns + 1):
            here = place[row, column]
            if here < 0:
                continue
            pixels[here, 0], pixels[here, 1] = row - 1, column - 1
            for k in range(8):
                down, right = _NEXT[k]
                link = place[row + down, column + right]
                straight = down == 0 or right == 0
                if link >= 0 and (
                    straight or max(place[row + down, column], place[row, column + right]) < 0
                ):
                    links[here, degree[here]] = link
                    degree[here] += 1
    return pixels, links, degree


@compiled
def _nodes(links, degree):  # type: ignore[no-untyped-def]
    """Node of each pixel (n,), -1 between them; and those that have one, in their order."""
    node = np.full(len(degree), -1, dtype=np.intp)
    order, waiting = np.empty((2, len(degree)), dtype=np.intp)
    found, count = 0, 0
    for pixel in range(len(degree)):
        if degree[pixel] == 2 or node[pixel] >= 0:
            continue
        node[pixel], order[found] = count, pixel
        found += 1
        waiting[0], left = pixel, int(degree[pixel] > 2)
        while left:
            left -= 1
            here = waiting[left]
            for k in range(degree[here]):
                link = links[here, k]
                if degree[link] > 2 and node[link] < 0:
                    node[link], order[found], waiting[left] = count, link, link
                    found += 1
                    left += 1
        count += 1
    if not found and len(degree):
        node[0], order[0], found = 0, 0, 1
    return node, order[:found]


@compiled
def straight_on(pixels, place, heading, beside, reach):  # type: ignore[no-untyped-def]
    """As `reference.straight_on`."""
    farthest = -np.inf
    for i in range(len(pixels)):
        x, y = pixels[i, 0] - place[0], pixels[i, 1] - place[1]
        beyond = x * heading[0] + y * heading[1]
        if reach[0] < beyond < reach[1] and abs(y * heading[0] - x * heading[1]) <= beside:
            farthest = max(farthest, beyond)
    return farthest if farthest > -np.inf else np.nan
