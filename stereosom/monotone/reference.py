"""Dynamic programming in plain numpy: `compiled` must give the same, faster."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Integers

# Of a step along one sequence only, in squares of the values.
ONE_SIDED = 0.5


def cheapest_way(
    one: Floats, two: Floats, start: tuple[float, float], stop: tuple[float, float]
) -> tuple[Integers, float]:
    """Pairs of places (k, 2) in two sequences, both not decreasing, that cost least in all.

    Parameters
    ----------
    one : (n,) array
    two : (m,) array
    start, stop : pair of float
        Price of each place of the first and of the second sequence that is left out before the
        first pair, and after the last.

    Returns
    -------
    (k, 2) array of int; float
        The price includes the squared differences of each pair.
    """
    n, m = len(one), len(two)
    difference = (one[:, None] - two) ** 2
    total = np.empty((n, m))
    for i in range(n):
        if i == 0:
            arrive = np.arange(m) * start[1]
        else:
            arrive = total[i - 1] + ONE_SIDED
            arrive[1:] = np.minimum(arrive[1:], total[i - 1, :-1])
            arrive[0] = min(arrive[0], i * start[0])
        # Going on along the second adds up: the best place to have come in, by a running minimum.
        along = np.cumsum(difference[i] + ONE_SIDED)
        total[i] = np.minimum.accumulate(arrive + difference[i] - along) + along
    last_one = total[:, -1] + np.arange(n)[::-1] * stop[0]
    last_two = total[-1] + np.arange(m)[::-1] * stop[1]
    i, j = n - 1, m - 1
    if last_one.min() < last_two.min():
        i = int(np.argmin(last_one))
    else:
        j = int(np.argmin(last_two))
    price = min(float(last_one.min()), float(last_two.min()))
    pairs = [(i, j)]
    while True:
        here = total[i, j] - difference[i, j]
        ways = []
        if i and j:
            ways.append((total[i - 1, j - 1], i - 1, j - 1))
        if i:
            ways.append((total[i - 1, j] + ONE_SIDED, i - 1, j))
        if j:
            ways.append((total[i, j - 1] + ONE_SIDED, i, j - 1))
        begun = min(i * start[0] if j == 0 else np.inf, j * start[1] if i == 0 else np.inf)
        best = min(ways, default=(np.inf, 0, 0))
        if begun <= best[0] or here < best[0] - 1e-6 * (1 + abs(here)):
            break
        _, i, j = best
        pairs.append((i, j))
    return np.array(pairs[::-1], dtype=np.intp), price
