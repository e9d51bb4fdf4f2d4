"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from .reference import ONE_SIDED


@njit(cache=True, nogil=True)
def cheapest_way(one, two, start, stop):  # type: ignore[no-untyped-def]
    """As `reference.cheapest_way`."""
    n, m = len(one), len(two)
    total = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            best = np.inf
            if i > 0 and j > 0:
                best = total[i - 1, j - 1]
            if i > 0:
                best = min(best, total[i - 1, j] + ONE_SIDED)
            if j > 0:
                best = min(best, total[i, j - 1] + ONE_SIDED)
            if j == 0:
                best = min(best, i * start[0])
            if i == 0:
                best = min(best, j * start[1])
            total[i, j] = best + (one[i] - two[j]) ** 2
    price, i, j = np.inf, n - 1, m - 1
    for place in range(m):
        if total[n - 1, place] + (m - 1 - place) * stop[1] < price:
            price, j = total[n - 1, place] + (m - 1 - place) * stop[1], place
    for place in range(n):
        if total[place, m - 1] + (n - 1 - place) * stop[0] < price:
            price, i, j = total[place, m - 1] + (n - 1 - place) * stop[0], place, m - 1
    pairs = np.empty((n + m, 2), np.intp)
    count = 0
    while True:
        count += 1
        pairs[-count] = i, j
        here = total[i, j] - (one[i] - two[j]) ** 2
        best, before, beside = np.inf, 0, 0
        # Of ways that cost the same, the one that comes from farthest back.
        if i > 0 and j > 0:
            best, before, beside = total[i - 1, j - 1], 1, 1
        if i > 0 and total[i - 1, j] + ONE_SIDED < best:
            best, before, beside = total[i - 1, j] + ONE_SIDED, 1, 0
        if j > 0 and total[i, j - 1] + ONE_SIDED < best:
            best, before, beside = total[i, j - 1] + ONE_SIDED, 0, 1
        begun = np.inf
        if j == 0:
            begun = i * start[0]
        if i == 0:
            begun = min(begun, j * start[1])
        if begun <= best or here < best - 1e-6 * (1 + abs(here)):
            break
        i -= before
        j -= beside
    return pairs[len(pairs) - count :], price
