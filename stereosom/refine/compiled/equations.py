"""As `reference.equations`."""

from __future__ import annotations

import numpy as np

from ..reference.outline import CAP_POINTS
from .numba_options import compiled


@compiled
def assemble(values, slopes, first, speed, pull, turn, grow, weight, total):  # type: ignore[no-untyped-def]
    """As `reference.assemble`, touching only the four control points that each point moves."""
    n, m = values.shape
    matrix, side = np.zeros((3 * m + 1, 3 * m + 1)), np.zeros(3 * m + 1)
    row = np.empty(13)
    for k in range(len(pull)):
        if weight[k] == 0.0:
            continue
        cap = k >= 2 * n
        i = k % n
        if cap:
            i = 0 if k < 2 * n + CAP_POINTS else n - 1
        for j in range(4):
            value = values[i, first[i] + j]
            slope = slopes[i, first[i] + j] / speed[i] if cap else 0.0
            for axis in range(3):
                row[3 * j + axis] = value * pull[k, axis] + slope * turn[k, axis]
        row[12] = grow[k]
        at = 3 * first[i]
        for a in range(12):
            weighted = weight[k] * row[a]
            for b in range(12):
                matrix[at + a, at + b] += weighted * row[b]
            matrix[at + a, 3 * m] += weighted * row[12]
            matrix[3 * m, at + a] += weighted * row[12]
            side[at + a] += total[k] * row[a]
        matrix[3 * m, 3 * m] += weight[k] * row[12] ** 2
        side[3 * m] += total[k] * row[12]
    return matrix, side


@compiled
def sliding(values, first, tangents):  # type: ignore[no-untyped-def]
    """As `reference.sliding`."""
    n, m = values.shape
    matrix = np.zeros((3 * m, 3 * m))
    row = np.empty(12)
    for i in range(n):
        for j in range(4):
            for axis in range(3):
                row[3 * j + axis] = values[i, first[i] + j] * tangents[i, axis]
        at = 3 * first[i]
        for a in range(12):
            for b in range(12):
                matrix[at + a, at + b] += row[a] * row[b]
    return matrix


@compiled
def along(values, first, covariance):  # type: ignore[no-untyped-def]
    """As `reference.along`."""
    n = len(values)
    found = np.zeros((n, 3, 3))
    for i in range(n):
        for j in range(4):
            for k in range(4):
                weight = values[i, first[i] + j] * values[i, first[i] + k]
                a, b = 3 * (first[i] + j), 3 * (first[i] + k)
                for x in range(3):
                    for y in range(3):
                        mean = (covariance[a + x, b + y] + covariance[b + y, a + x]) / 2
                        found[i, x, y] += weight * mean
    return found
