"""As `reference.pairing`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled


@compiled
def pair_in_order(height_a, height_b, one_sided, left_out_a, left_out_b):  # type: ignore[no-untyped-def]
    """As `reference.pair_in_order`."""
    n, m = len(height_a), len(height_b)
    start_a, stop_a = left_out_a
    start_b, stop_b = left_out_b
    total = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            if i == 0:
                arrive = j * start_b
            elif j == 0:
                arrive = min(total[i - 1, 0] + one_sided, i * start_a)
            else:
                arrive = min(total[i - 1, j] + one_sided, total[i - 1, j - 1])
            if j:
                arrive = min(arrive, total[i, j - 1] + one_sided)
            total[i, j] = arrive + (height_a[i] - height_b[j]) ** 2
    cost, i, j = np.inf, n - 1, m - 1
    for k in range(m):
        if total[n - 1, k] + (m - 1 - k) * stop_b < cost:
            cost, j = total[n - 1, k] + (m - 1 - k) * stop_b, k
    for k in range(n):
        if total[k, m - 1] + (n - 1 - k) * stop_a < cost:
            cost, i, j = total[k, m - 1] + (n - 1 - k) * stop_a, k, m - 1
    in_a, in_b = np.empty((2, n + m), dtype=np.intp)
    count = 0
    while True:
        in_a[count], in_b[count] = i, j
        count += 1
        here = total[i, j] - (height_a[i] - height_b[j]) ** 2
        best, to_i, to_j = np.inf, 0, 0
        if i and j:
            best, to_i, to_j = total[i - 1, j - 1], i - 1, j - 1
        if i and total[i - 1, j] + one_sided < best:
            best, to_i, to_j = total[i - 1, j] + one_sided, i - 1, j
        if j and total[i, j - 1] + one_sided < best:
            best, to_i, to_j = total[i, j - 1] + one_sided, i, j - 1
        begun = min(i * start_a if j == 0 else np.inf, j * start_b if i == 0 else np.inf)
        if begun <= best or here < best - 1e-6 * (1 + abs(here)):
            break
        i, j = to_i, to_j
    return in_a[:count][::-1].copy(), in_b[:count][::-1].copy(), cost
