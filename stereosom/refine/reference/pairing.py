"""Places of two lines that belong together, in order: dynamic programming."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Integers


def pair_in_order(
    height_a: Floats,
    height_b: Floats,
    one_sided: float,
    left_out_a: tuple[float, float],
    left_out_b: tuple[float, float],
) -> tuple[Integers, Integers, float]:
    """Pair two sequences in order, so that values differ least; see `matching.match_monotone`.

    Parameters
    ----------
    height_a : (n,) array
    height_b : (m,) array
    one_sided : float
        Price of a step along one sequence only.
    left_out_a, left_out_b : (float, float)
        Price of each value that has no partner, at the start and at the end of a sequence.

    Returns
    -------
    in_a, in_b : (k,) arrays
        Places that belong together, neither ever decreasing.
    cost : float
        In all.
    """
    n, m = len(height_a), len(height_b)
    difference = (height_a[:, None] - height_b) ** 2
    total = np.empty((n, m))
    (start_a, stop_a), (start_b, stop_b) = left_out_a, left_out_b
    for i in range(n):
        if i == 0:
            arrive = np.arange(m) * start_b
        else:
            arrive = total[i - 1] + one_sided
            arrive[1:] = np.minimum(arrive[1:], total[i - 1, :-1])
            arrive[0] = min(arrive[0], i * start_a)
        # Going on along b adds up: the best place to have come in, by a running minimum.
        along = np.cumsum(difference[i] + one_sided)
        total[i] = np.minimum.accumulate(arrive + difference[i] - along) + along
    last_a = total[:, -1] + np.arange(n)[::-1] * stop_a
    last_b = total[-1] + np.arange(m)[::-1] * stop_b
    i, j = n - 1, m - 1
    if last_a.min() < last_b.min():
        i = int(np.argmin(last_a))
    else:
        j = int(np.argmin(last_b))
    cost = min(float(last_a.min()), float(last_b.min()))
    pairs = [(i, j)]
    while True:
        here = total[i, j] - difference[i, j]
        ways = []
        if i and j:
            ways.append((total[i - 1, j - 1], i - 1, j - 1))
        if i:
            ways.append((total[i - 1, j] + one_sided, i - 1, j))
        if j:
            ways.append((total[i, j - 1] + one_sided, i, j - 1))
        begun = min(i * start_a if j == 0 else np.inf, j * start_b if i == 0 else np.inf)
        best = min(ways, default=(np.inf, 0, 0))
        if begun <= best[0] or here < best[0] - 1e-6 * (1 + abs(here)):
            break
        _, i, j = best
        pairs.append((i, j))
    in_a, in_b = np.array(pairs[::-1], dtype=np.intp).T
    return in_a, in_b, cost
