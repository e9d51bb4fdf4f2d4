"""As `reference.noise`."""

from __future__ import annotations

import numpy as np

from ..reference.noise import HARMONICS, IN_A_ROW
from ..reference.outline import CAP_POINTS
from .numba_options import compiled


@compiled
def rounding(picture, normals, weight, samples, together):  # type: ignore[no-untyped-def]
    """As `reference.rounding`; of the harmonics, each follows from the first."""
    shared = np.zeros(len(weight))
    sigma = together / 2.5
    wide = int(4.0 * sigma + 0.5)
    bell = np.exp(-0.5 * (np.arange(-wide, wide + 1) / sigma) ** 2)
    bell /= bell.sum()
    start = 0
    for number in range(4):
        n = samples if number < 2 else CAP_POINTS
        # Beyond both ends the last value stands, as far as the bell is wide.
        real, imaginary = np.empty((2, HARMONICS, n + 2 * wide))
        for axis in range(2):
            of_axis = np.zeros(n)
            for k in range(n):
                before, after = max(k - 1, 0), min(k + 1, n - 1)
                step = picture[start + after, axis] - picture[start + before, axis]
                step = np.pi * step / (after - before)
                angle = 2 * np.pi * picture[start + k, axis]
                _harmonics(np.cos(angle), np.sin(angle), step, real, imaginary, wide + k)
            for h in range(HARMONICS):
                share = 1 / (2 * np.pi**2 * (h + 1) ** 2)
                if number < 2:
                    for padded in (real[h], imaginary[h]):
                        padded[:wide], padded[n + wide :] = padded[wide], padded[n + wide - 1]
                    for k in range(n):
                        x, y = bell[wide] * real[h, wide + k], bell[wide] * imaginary[h, wide + k]
                        for j in range(wide):  # a bell is alike on both sides
                            other = k + 2 * wide - j
                            x += bell[j] * (real[h, k + j] + real[h, other])
                            y += bell[j] * (imaginary[h, k + j] + imaginary[h, other])
                        of_axis[k] += (x**2 + y**2) * share
                else:
                    cos, sin, crossed = 0.0, 0.0, 0.0
                    for k in range(n):
                        w = weight[start + k] * abs(normals[start + k, axis])
                        cos, sin = cos + w * real[h, wide + k], sin + w * imaginary[h, wide + k]
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
