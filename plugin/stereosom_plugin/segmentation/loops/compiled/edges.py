"""As `reference.edges`, in loops that numba compiles."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np

from .lines import _mirrored
from .numba_options import compiled


@compiled
def weighted(values, weights, bell, more):  # type: ignore[no-untyped-def]
    """As `reference.weighted`."""
    n, m = values.shape
    reach = len(bell) // 2
    margin, wide = min(reach + 1, n - 1), weights.shape[1]
    mean, total = np.empty((n, m)), np.empty(2 * m)
    for i in range(n):
        total[:] = 0
        for k in range(-reach, reach + 1):
            at = _mirrored(i + k + margin, n + 2 * margin) - margin
            for j in range(m):
                if at < 0:
                    value = 2 * values[0, j] - values[-at, j]
                    weight = weights[-at, min(j, wide - 1)]
                elif at >= n:
                    value = 2 * values[n - 1, j] - values[2 * n - 2 - at, j]
                    weight = weights[2 * n - 2 - at, min(j, wide - 1)]
                else:
                    value, weight = values[at, j], weights[at, min(j, wide - 1)]
                total[j] += bell[k + reach] * value * weight
                total[m + j] += bell[k + reach] * weight
        for j in range(m):
            mean[i, j] = total[j] / (total[m + j] + more)
    return mean


@compiled
def half_way(profile, step):  # type: ignore[no-untyped-def]
    """As `reference.half_way`."""
    n, wide, channels = profile.shape
    shift, far = np.empty(n), np.empty(n)
    mean, way, inner = np.empty((wide, channels)), np.empty(channels), np.empty(channels)
    for i in range(n):
        mean[:] = 0
        for k in range(-2, 3):
            at = _mirrored(i + k, n)
            for j in range(wide):
                for c in range(channels):
                    mean[j, c] += profile[at, j, c]
        square = 0.0
        for c in range(channels):
            within, outer = 0.0, 0.0
            for j in range(6):
                within += mean[1 + j, c]
                outer += mean[14 + j, c]
            inner[c], way[c] = within / 6, (outer - within) / 6
            square += way[c] ** 2
        taken, least = 0.0, max(square, 25e-6)
        for j in range(wide):
            share = 0.0
            for c in range(channels):
                share += (mean[j, c] - inner[c]) * way[c]
            taken += min(max(share / least, 0.0), 1.0)
        shift[i], far[i] = (10.5 - taken) * step, sqrt(square) / 5
    return shift, far


@compiled
def fill(drawn, outline):  # type: ignore[no-untyped-def]
    """As `reference.fill`."""
    rows, columns = drawn.shape
    n = len(outline)
    begin = np.zeros(rows + 1, np.intp)
    for i in range(n):
        first, last = _rows_crossed(outline[i, 1], outline[(i + 1) % n, 1], rows)
        for row in range(first, last):
            begin[row + 1] += 1
    for row in range(rows):
        begin[row + 1] += begin[row]
    place, turn = np.empty(begin[rows]), np.empty(begin[rows], np.int8)
    filled = begin[:-1].copy()
    for i in range(n):
        (x, y), (to_x, to_y) = outline[i], outline[(i + 1) % n]
        first, last = _rows_crossed(y, to_y, rows)
        for row in range(first, last):
            here, at = x + (row - y) * (to_x - x) / (to_y - y), filled[row]
            while at > begin[row] and place[at - 1] > here:
                place[at], turn[at] = place[at - 1], turn[at - 1]
                at -= 1
            place[at], turn[at] = here, 1 if to_y > y else -1
            filled[row] += 1
    for row in range(rows):
        turns = 0
        for k in range(begin[row], begin[row + 1] - 1):
            turns += turn[k]
            if turns:
                start, stop = max(ceil(place[k]), 0), min(ceil(place[k + 1]), columns)
                for column in range(start, stop):
                    drawn[row, column] = True


@compiled
def _rows_crossed(y, to_y, rows):  # type: ignore[no-untyped-def]
    """The first line of pixels that a side crosses, and that after the last."""
    first = min(max(ceil(min(y, to_y)), 0), rows)
    return first, min(max(ceil(max(y, to_y)), first), rows)
