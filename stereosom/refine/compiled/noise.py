"""As `reference.noise`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.noise import HARMONICS, IN_A_ROW
from ..reference.outline import CAP_POINTS


@compiled
def rounding(picture, normals, weight, samples, together):  # type: ignore[no-untyped-def]
    """As `reference.rounding`; of the harmonics, each follows from the first."""
    shared = np.zeros(len(weight))
    half = together // 2
    start = 0
    for number in range(4):
        n = samples if number < 2 else CAP_POINTS
        real, imaginary = np.empty((2, HARMONICS, n))
        once, x, y = np.empty((3, n))
        for axis in range(2):
            of_axis = np.zeros(n)
            for k in range(n):
                before, after = max(k - 1, 0), min(k + 1, n - 1)
                step = picture[start + after, axis] - picture[start + before, axis]
                step = np.pi * step / (after - before)
                angle = 2 * np.pi * picture[start + k, axis]
                _harmonics(np.cos(angle), np.sin(angle), step, real, imaginary, k)
            for h in range(HARMONICS):
                share = 1 / (2 * np.pi**2 * (h + 1) ** 2)
                if number < 2:
                    _mean(real[h], half, once)
                    _mean(once, half, x)
                    _mean(imaginary[h], half, once)
                    _mean(once, half, y)
                    for k in range(n):
                        of_axis[k] += (x[k] ** 2 + y[k] ** 2) * share
                else:
                    cos, sin, crossed = 0.0, 0.0, 0.0
                    for k in range(n):
                        w = weight[start + k] * abs(normals[start + k, axis])
                        cos, sin = cos + w * real[h, k], sin + w * imaginary[h, k]
                        crossed += w
                    of_axis += (cos**2 + sin**2) / max(crossed, 1e-9) ** 2 * share
            for k in range(n):
                shared[start + k] = max(shared[start + k], of_axis[k])
        if number < 2:
            # As `uniform_filter1d` does: of an even number, one more before than after.
            for k in range(n):
                count = 0.0
                for j in range(k - together // 2, k + (together - 1) // 2 + 1):
                    count += weight[start + min(max(j, 0), n - 1)]
                shared[start + k] *= count
        else:
            shared[start : start + n] *= weight[start : start + n].sum()
        start += n
    return shared


@compiled
def _mean(values, half, found):  # type: ignore[no-untyped-def]
    """Fill in the mean over as many values before as after; beyond both ends the last stand."""
    last, share = len(values) - 1, 1 / (2 * half + 1)
    running = 0.0
    for k in range(-half, half + 1):
        running += values[min(max(k, 0), last)]
    for k in range(last + 1):
        found[k] = running * share
        running += values[min(k + half + 1, last)] - values[max(k - half, 0)]


@compiled
def _harmonics(cosine, sine, step, real, imaginary, at):  # type: ignore[no-untyped-def]
    """Fill in the harmonics of a phase, each damped by how far the phase runs on."""
    turned, turning = np.sin(step), np.cos(step)
    c, s = cosine, sine  # of h times the phase
    damp, rest = turned, turning  # sine and cosine of h times the step
    for h in range(HARMONICS):
        share = damp / ((h + 1) * step) if step != 0 else 1.0
        real[h, at], imaginary[h, at] = c * share, s * share
        c, s = c * cosine - s * sine, s * cosine + c * sine
        damp, rest = damp * turning + rest * turned, rest * turning - damp * turned


@compiled
def likeness(weight, total, alone, samples):  # type: ignore[no-untyped-def]
    """As `reference.likeness`."""
    sums, single = 0.0, 0
    for rim in range(2):
        for row in range(samples // IN_A_ROW):
            weights, totals = 0.0, 0.0
            for k in range(row * IN_A_ROW, (row + 1) * IN_A_ROW):
                weights += weight[rim * samples + k]
                totals += total[rim * samples + k]
            if weights > 0:
                sums += totals**2 / weights
                single += 1
    if single < 4:
        return 1.0
    return max(1.0, sums / single / max(alone, 1e-12))
