"""As `reference.noise`."""

from __future__ import annotations

import numpy as np

from ..reference.noise import HARMONICS
from ..reference.outline import CAP_POINTS
from .numba_options import compiled


@compiled
def rounding(picture, normals, weight, samples, together):  # type: ignore[no-untyped-def]
    """As `reference.rounding`."""
    shared = np.zeros(len(weight))
    sigma = together / 2.5
    wide = int(4.0 * sigma + 0.5)
    bell = np.exp(-0.5 * (np.arange(-wide, wide + 1) / sigma) ** 2)
    bell /= bell.sum()
    start = 0
    for number in range(4):
        n = samples if number < 2 else CAP_POINTS
        real, imaginary = np.empty(n), np.empty(n)
        for axis in range(2):
            of_axis = np.zeros(n)
            for h in range(1, HARMONICS + 1):
                for k in range(n):
                    before, after = max(k - 1, 0), min(k + 1, n - 1)
                    step = picture[start + after, axis] - picture[start + before, axis]
                    step = h * np.pi * step / (after - before)
                    angle = 2 * np.pi * h * picture[start + k, axis]
                    damped = np.sin(step) / step if step != 0 else 1.0
                    real[k], imaginary[k] = np.cos(angle) * damped, np.sin(angle) * damped
                if number < 2:
                    for k in range(n):
                        x, y = 0.0, 0.0
                        for j in range(-wide, wide + 1):
                            near = min(max(k + j, 0), n - 1)
                            x += bell[j + wide] * real[near]
                            y += bell[j + wide] * imaginary[near]
                        of_axis[k] += (x**2 + y**2) / (2 * np.pi**2 * h**2)
                else:
                    x, y, crossed = 0.0, 0.0, 0.0
                    for k in range(n):
                        w = weight[start + k] * abs(normals[start + k, axis])
                        x, y, crossed = x + w * real[k], y + w * imaginary[k], crossed + w
                    crossed = max(crossed, 1e-9)
                    of_axis += (x**2 + y**2) / crossed**2 / (2 * np.pi**2 * h**2)
            for k in range(n):
                shared[start + k] = max(shared[start + k], of_axis[k])
        for k in range(n):
            # As `uniform_filter1d` does: of an even number, one more before than after.
            first, last = k - together // 2, k + (together - 1) // 2
            if number >= 2:
                first, last = 0, n - 1
            count = 0.0
            for j in range(first, last + 1):
                count += weight[start + min(max(j, 0), n - 1)]
            shared[start + k] *= count
        start += n
    return shared
