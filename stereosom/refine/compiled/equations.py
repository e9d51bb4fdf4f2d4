"""As `reference.equations`: a spline's normal matrix is a band, and one column for the radius."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.equations import FLOOR, HELD, SLIDING
from ..reference.outline import CAP_POINTS
from ..spline import ORDER
from . import band


@compiled
def sweep(values, slopes, first, control):  # type: ignore[no-untyped-def]
    """As `reference.sweep`."""
    n = len(values)
    curve, tangents, speed = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    for i in range(n):
        squared = 0.0
        for axis in range(3):
            at, pace = 0.0, 0.0
            for j in range(4):
                at += values[i, first[i] + j] * control[first[i] + j, axis]
                pace += slopes[i, first[i] + j] * control[first[i] + j, axis]
            curve[i, axis], tangents[i, axis] = at, pace
            squared += pace**2
        speed[i] = max(np.sqrt(squared), 1e-9)
        for axis in range(3):
            tangents[i, axis] /= speed[i]
    return curve, speed, tangents


@compiled
def step(  # type: ignore[no-untyped-def]
    values, slopes, first, roughness, control, speed, tangents,
    view_a, view_b, turning, stiffness, noise, radius_known,
):  # fmt: skip
    """As `reference.step`."""
    n, m = values.shape
    matrix, column, side = np.zeros((3 * m, band.WIDTH)), np.zeros(3 * m), np.zeros(3 * m + 1)
    corner = gather(values, slopes, first, speed, view_a, turning, matrix, column, side)
    corner += gather(values, slopes, first, speed, view_b, turning, matrix, column, side)
    across = matrix[:, 0].sum()
    if noise > 0:
        rough, undetermined = 0.0, 0.0
        held = matrix.copy()
        _stiffen(held, roughness, stiffness)
        band.factor(held)
        inverse = band.inverse(held, column, corner + FLOOR)
        for j in range(m):
            for k in range(max(j - 3, 0), j + 1):
                twice = 2.0 if k < j else 1.0
                for axis in range(3):
                    rough += twice * control[j, axis] * roughness[j, k] * control[k, axis]
                    undetermined += twice * roughness[j, k] * inverse[3 * j + axis, 3 * (j - k)]
        directions = max(3.0 * (m - ORDER) - stiffness * undetermined, 1.0)
        stiffness = min(max(noise * directions / max(rough, 1e-12), 1e-9), 1e6)
    _stiffen(matrix, roughness, stiffness)
    for j in range(m):
        for k in range(max(j - 3, 0), min(j + 4, m)):
            for axis in range(3):
                side[3 * j + axis] -= stiffness * roughness[j, k] * control[k, axis]
    slid = 0.0
    for i in range(n):
        for j in range(4):
            slid += values[i, first[i] + j] ** 2
    share = SLIDING * across / slid
    for i in range(n):
        for j in range(4):
            for k in range(j + 1):
                both = share * values[i, first[i] + j] * values[i, first[i] + k]
                _add(matrix, 3 * (first[i] + j), j - k, both, tangents[i], tangents[i])
    band.factor(matrix)
    grown = band.solve(matrix, column, corner + FLOOR + (HELD if radius_known else 0.0), side)
    moved = side[:-1].copy().reshape((m, 3))
    farthest = 0.0
    shift = np.empty(3)
    for i in range(n):
        along, squared = 0.0, 0.0
        for axis in range(3):
            shift[axis] = 0.0
            for j in range(4):
                shift[axis] += values[i, first[i] + j] * moved[first[i] + j, axis]
            along += shift[axis] * tangents[i, axis]
        if i in (0, n - 1):
            along *= 0.8
        for axis in range(3):
            squared += (shift[axis] - along * tangents[i, axis]) ** 2
        farthest = max(farthest, squared)
    return moved, grown, np.sqrt(farthest), stiffness


@compiled
def crossed(values, slopes, first, speed, view, moved, grown):  # type: ignore[no-untyped-def]
    """As `reference.crossed`."""
    pull, turn, grow, weight, _ = view
    n = len(values)
    farthest = 0.0
    for k in range(len(pull)):
        if weight[k] == 0.0:
            continue
        i = k % n if k < 2 * n else (0 if k < 2 * n + CAP_POINTS else n - 1)
        across = grow[k] * grown
        for axis in range(3):
            shift, turned = 0.0, 0.0
            for j in range(4):
                shift += values[i, first[i] + j] * moved[first[i] + j, axis]
                turned += slopes[i, first[i] + j] * moved[first[i] + j, axis]
            across += pull[k, axis] * shift + turn[k, axis] * turned / speed[i]
        farthest = max(farthest, abs(across))
    return farthest


@compiled
def roughness_like(control, around, straightest):  # type: ignore[no-untyped-def]
    """As `reference.roughness_like`."""
    m = len(control)
    squares, mean = np.zeros(m - 2), 0.0
    for i in range(m - 2):
        for axis in range(3):
            squares[i] += (control[i, axis] - 2 * control[i + 1, axis] + control[i + 2, axis]) ** 2
        mean += squares[i] / (m - 2)
    rough = np.zeros((m, m))
    for i in range(m - 2):
        allowed = 1.0
        if mean > 0:
            nearby = 0.0
            for j in range(m - 2):
                nearby += around[i, j] * squares[j]
            allowed = max(nearby / mean, straightest)
        for j, one in enumerate((1.0, -2.0, 1.0)):
            for k, other in enumerate((1.0, -2.0, 1.0)):
                rough[i + j, i + k] += one * other / allowed
    return rough


@compiled
def gather(values, slopes, first, speed, view, turning, matrix, column, side):  # type: ignore[no-untyped-def]
    """Add a view's equations to the band, the radius' column and the right side.

    The rims' points move with their sample alone: their sums, 3 × 3, are gathered first.
    """
    pull, turn, grow, weight, total = view
    n = len(values)
    corner = 0.0
    square, beside, pulled = np.empty((3, 3)), np.empty(3), np.empty(3)
    for i in range(n):
        square[:], beside[:], pulled[:] = 0.0, 0.0, 0.0
        for k in (i, n + i):
            if weight[k] == 0.0:
                continue
            for x in range(3):
                for y in range(3):
                    square[x, y] += weight[k] * pull[k, x] * pull[k, y]
                beside[x] += weight[k] * grow[k] * pull[k, x]
                pulled[x] += total[k] * pull[k, x]
            corner += weight[k] * grow[k] ** 2
            side[-1] += total[k] * grow[k]
        for j in range(4):
            value, at = values[i, first[i] + j], 3 * (first[i] + j)
            for x in range(3):
                column[at + x] += value * beside[x]
                side[at + x] += value * pulled[x]
            for k in range(j + 1):
                both = value * values[i, first[i] + k]
                for x in range(3):
                    for y in range(3 if k < j else x + 1):
                        matrix[at + x, 3 * (j - k) + x - y] += both * square[x, y]
    row = np.empty(12)
    for k in range(2 * n, len(pull)):
        if weight[k] == 0.0:
            continue
        i = 0 if k < 2 * n + CAP_POINTS else n - 1
        for j in range(4):
            value, slope = values[i, first[i] + j], slopes[i, first[i] + j] / speed[i]
            slope = slope if turning else 0.0
            for axis in range(3):
                row[3 * j + axis] = value * pull[k, axis] + slope * turn[k, axis]
        at = 3 * first[i]
        for a in range(12):
            if row[a] == 0.0:  # a clamped spline's end is its last control points alone
                continue
            for b in range(a + 1):
                matrix[at + a, a - b] += weight[k] * row[a] * row[b]
            column[at + a] += weight[k] * grow[k] * row[a]
            side[at + a] += total[k] * row[a]
        corner += weight[k] * grow[k] ** 2
        side[-1] += total[k] * grow[k]
    return corner


@compiled
def _add(matrix, at, apart, weight, one, other):  # type: ignore[no-untyped-def]
    """Add weight times one otherᵀ where control points so far apart meet."""
    for x in range(3):
        for y in range(3 if apart else x + 1):
            matrix[at + x, 3 * apart + x - y] += weight * one[x] * other[y]


@compiled
def _stiffen(matrix, roughness, stiffness):  # type: ignore[no-untyped-def]
    """Add the spline's stiffness, and what holds the rest."""
    for j in range(len(roughness)):
        for axis in range(3):
            matrix[3 * j + axis, 0] += FLOOR
            for k in range(max(j - 3, 0), j + 1):
                matrix[3 * j + axis, 3 * (j - k)] += stiffness * roughness[j, k]
