"""As `reference.profiles`, in loops that numba compiles."""

from __future__ import annotations

from math import erfc, exp, pi, sqrt

import numpy as np

from stereosom.numba_options import compiled


@compiled
def tube_profile(place, chords, parameters):  # type: ignore[no-untyped-def]
    """As `reference.tube_profile`."""
    n, m = len(place), len(chords)
    radius, absorption, blur, center = parameters
    profile, slopes = np.zeros(n), np.zeros((n, 4))
    taken, turned = 0.0, 0.0
    for box in range(m - 1, -1, -1):
        through = sqrt(1 - chords[box] ** 2)
        passes = exp(-absorption * through)
        weight, taken = 1 - passes - taken, 1 - passes
        grows, turned = through * passes - turned, through * passes
        wide = chords[box] + 0.5 / m
        for i in range(n):
            right = (place[i] - center + radius * wide) / blur
            left = (place[i] - center - radius * wide) / blur
            inside = 0.5 * (erfc(-right / sqrt(2.0)) - erfc(-left / sqrt(2.0)))
            high = exp(-(right**2) / 2) / sqrt(2 * pi)
            low = exp(-(left**2) / 2) / sqrt(2 * pi)
            profile[i] += weight * inside
            slopes[i, 0] += weight * wide * (high + low) / blur
            slopes[i, 1] += grows * inside
            slopes[i, 2] += weight * (left * low - right * high) / blur
            slopes[i, 3] += weight * (low - high) / blur
    return profile, slopes


@compiled
def fitted_profile(place, chords, taken, start, low, high, sure):  # type: ignore[no-untyped-def]
    """As `reference.fitted_profile`."""
    found = start.copy()
    matrix, side = np.empty((4, 4)), np.empty(4)
    for _ in range(12):
        model, slopes = tube_profile(place, chords, found)
        for a in range(4):
            side[a] = sure[a] * (start[a] - found[a])
            for i in range(len(place)):
                side[a] += slopes[i, a] * (taken[i] - model[i])
            for b in range(a + 1):
                total = sure[a] + 1e-6 if a == b else 0.0
                for i in range(len(place)):
                    total += slopes[i, a] * slopes[i, b]
                matrix[a, b] = matrix[b, a] = total
        _solve(matrix, side)
        farthest = 0.0
        for a in range(4):
            most = 0.4 * abs(found[a]) + 0.2
            step = min(max(side[a], -most), most)
            farthest = max(farthest, abs(step))
            found[a] = min(max(found[a] + step, low[a]), high[a])
        if farthest < 2e-3:
            break
    return found


@compiled
def _solve(matrix, side):  # type: ignore[no-untyped-def]
    """Solve a positive definite system in place: the solution is left in `side` (Gauss)."""
    n = len(side)
    for a in range(n):
        for b in range(a + 1, n):
            share = matrix[b, a] / matrix[a, a]
            for c in range(a, n):
                matrix[b, c] -= share * matrix[a, c]
            side[b] -= share * side[a]
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            side[a] -= matrix[a, b] * side[b]
        side[a] /= matrix[a, a]
