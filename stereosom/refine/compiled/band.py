"""Symmetric matrices that are a band, and one more row and column: solved, and inverted.

A band is kept as (n, WIDTH): [i, d] is the element in row i and column i − d. Four control points
in a row are coupled, three coordinates each, so it is twelve wide.
"""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled

WIDTH = 12


@compiled
def factor(band):  # type: ignore[no-untyped-def]
    """Turn a band into its factors L D Lᵀ: D in the first column, L (of unit diagonal) beside.

    G. H. Golub, C. F. Van Loan, "Matrix Computations", section 4.3.
    """
    for i in range(len(band)):
        least = 1e-15 * band[i, 0]
        start = max(i - WIDTH + 1, 0)
        for j in range(start, i):
            scaled = band[i, i - j]
            for k in range(max(start, j - WIDTH + 1), j):
                scaled -= band[i, i - k] * band[j, j - k]
            band[i, i - j] = scaled
        for j in range(start, i):
            scaled = band[i, i - j]
            band[i, i - j] = scaled / band[j, 0]
            band[i, 0] -= scaled * band[i, i - j]
        band[i, 0] = max(band[i, 0], least, 1e-300)


@compiled
def solve(factors, column, corner, side):  # type: ignore[no-untyped-def]
    """Put the solution of the bordered system in the place of its right side; give its last."""
    n = len(factors)
    reach = column.copy()
    _substitute(factors, reach)
    _substitute(factors, side)
    last, rest = side[n], corner
    for i in range(n):
        last -= column[i] * side[i]
        rest -= column[i] * reach[i]
    last /= rest
    for i in range(n):
        side[i] -= reach[i] * last
    side[n] = last
    return last


@compiled
def inverse(factors, column, corner):  # type: ignore[no-untyped-def]
    """The band (n, WIDTH) of the bordered matrix' inverse, without its last row and column.

    Within the band, an inverse follows from the factors alone: K. Takahashi, J. Fagan,
    M.-S. Chin, "Formation of a sparse bus impedance matrix", 8th PICA Conference, 1973.
    """
    n = len(factors)
    found = np.zeros((n, WIDTH))
    for j in range(n - 1, -1, -1):
        stop = min(j + WIDTH, n)
        for i in range(stop - 1, j - 1, -1):
            total = 1.0 / factors[j, 0] if i == j else 0.0
            for k in range(j + 1, i + 1):
                total -= found[i, i - k] * factors[k, k - j]
            for k in range(i + 1, stop):
                total -= found[k, k - i] * factors[k, k - j]
            found[i, i - j] = total
    reach = column.copy()
    _substitute(factors, reach)
    rest = corner
    for i in range(n):
        rest -= column[i] * reach[i]
    for i in range(n):
        for d in range(min(WIDTH, i + 1)):
            found[i, d] += reach[i] * reach[i - d] / rest
    return found


@compiled
def _substitute(factors, side):  # type: ignore[no-untyped-def]
    """Solve L D Lᵀ x = side in its place."""
    n = len(factors)
    for i in range(n):
        for d in range(1, min(WIDTH, i + 1)):
            side[i] -= factors[i, d] * side[i - d]
    for i in range(n):
        side[i] /= factors[i, 0]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, min(i + WIDTH, n)):
            side[i] -= factors[k, k - i] * side[k]
