"""As `reference.covariance`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.equations import HELD
from . import band
from .equations import gather
from .noise import rounding


@compiled
def covariance(  # type: ignore[no-untyped-def]
    values, slopes, first, speed, outline_a, outline_b, view_a, view_b,
    together, noise, length, radius_known,
):  # fmt: skip
    """As `reference.covariance`."""
    n, m = values.shape
    matrix, column, side = np.zeros((3 * m, band.WIDTH)), np.zeros(3 * m), np.zeros(3 * m + 1)
    corner = noise / length**2 + (HELD if radius_known else 0.0)
    matrix[:, 0] += noise / length**2
    for outline, view in ((outline_a, view_a), (outline_b, view_b)):
        picture, normals = outline
        pull, turn, grow, weight, total = view
        shared = rounding(picture, normals, weight, n, together)
        telling = np.empty(len(weight))
        for k in range(len(weight)):
            crossings = abs(normals[k, 0]) + abs(normals[k, 1])
            telling[k] = weight[k] / crossings * noise / (noise + shared[k])
        told = (pull, turn, grow, telling, total)
        corner += gather(values, slopes, first, speed, told, True, matrix, column, side)
    band.factor(matrix)
    inverse = band.inverse(matrix, column, corner)
    found = np.zeros((n, 3, 3))
    for i in range(n):
        at = found[i]
        for j in range(4):
            a = 3 * (first[i] + j)
            for k in range(j):
                weighted = noise * values[i, first[i] + j] * values[i, first[i] + k]
                for x in range(3):
                    for y in range(3):
                        met = weighted * inverse[a + x, 3 * (j - k) + x - y]
                        at[x, y] += met
                        at[y, x] += met
            weighted = noise * values[i, first[i] + j] ** 2
            for x in range(3):
                for y in range(x):
                    at[x, y] += weighted * inverse[a + x, x - y]
                    at[y, x] += weighted * inverse[a + x, x - y]
                at[x, x] += weighted * inverse[a + x, 0]
    return found


@compiled
def by_length(curve, tangents, covariance, factors, along, start, stop, count):  # type: ignore[no-untyped-def]
    """As `reference.by_length`."""
    n = len(curve)
    reach = np.zeros(n)
    for i in range(1, n):
        squared = 0.0
        for axis in range(3):
            squared += (curve[i, axis] - curve[i - 1, axis]) ** 2
        reach[i] = reach[i - 1] + np.sqrt(squared)
    reach /= reach[-1]
    ends = np.empty(2)
    for end in range(2):
        t, sure = tangents[end * (n - 1)], covariance[end * (n - 1)]
        slid = 0.0
        for x in range(3):
            for y in range(3):
                slid += t[x] * sure[x, y] * t[y]
        ends[end] = along[end] if np.isfinite(along[end]) else factors[end] * slid
    found = np.empty((n, 3, 3))
    sliding = np.empty(3)
    for i in range(n):
        t, sure = tangents[i], covariance[i]
        slid = 0.0
        for x in range(3):
            sliding[x] = 0.0
            for y in range(3):
                sliding[x] += sure[x, y] * t[y]
            slid += sliding[x] * t[x]
        held = (1 - reach[i]) * ends[0] + reach[i] * ends[1]
        for x in range(3):
            sliding[x] -= 0.5 * (slid + held) * t[x]
        for x in range(3):
            for y in range(3):
                found[i, x, y] = sure[x, y] - sliding[x] * t[y] - t[x] * sliding[y]
    for end in range(2):
        if not np.isfinite(along[end]):
            found[end * (n - 1)] = factors[end] * covariance[end * (n - 1)]
    told = np.empty((count, 3, 3))
    place = 0
    for k in range(count):
        at = start + (stop - start) * k / (count - 1)
        while place < n - 2 and reach[place + 1] < at:
            place += 1
        share = min(max((at - reach[place]) / (reach[place + 1] - reach[place]), 0.0), 1.0)
        told[k] = (1 - share) * found[place] + share * found[place + 1]
    return told
