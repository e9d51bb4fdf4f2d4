"""As `reference.ends`, in loops that numba compiles."""

from __future__ import annotations

from math import exp, floor, sqrt

import numpy as np

from stereosom.numba_options import compiled

from .lines import _mirrored
from .profiles import _solve


@compiled
def even(points, way, spacing):  # type: ignore[no-untyped-def]
    """As `reference.even`."""
    last = len(way) - 1
    count = max(16, int(np.ceil(way[last] / spacing)))
    step = way[last] / count
    found = np.empty((count, 2))
    piece = 0
    for i in range(count):
        at = (i + 0.5) * step
        while piece < last - 1 and way[piece + 1] <= at:
            piece += 1
        share = (at - way[piece]) / max(way[piece + 1] - way[piece], 1e-300)
        for axis in range(2):
            found[i, axis] = points[piece, axis] * (1 - share) + points[piece + 1, axis] * share
    return found, step


@compiled
def shadow(pixels, line, radius, pace, ends, face):  # type: ignore[no-untyped-def]
    """As `reference.shadow`."""
    n, last = len(pixels), len(line) - 2
    x_all, y_all = pixels[:, 0].copy(), pixels[:, 1].copy()
    before, least = np.full(n, np.inf), np.full(n, np.inf)
    for j in range(last + 1):
        before, least = least, before
        x_step, y_step = line[j + 1, 0] - line[j, 0], line[j + 1, 1] - line[j, 1]
        per_square = 1 / max(x_step**2 + y_step**2, 1e-12)
        x_first, y_first = line[j]
        # Pixels are the inner loop, so that several are done at once.
        for i in range(n):
            x, y = x_all[i] - x_first, y_all[i] - y_first
            along = min(max((x * x_step + y * y_step) * per_square, 0.0), 1.0)
            x, y = x - along * x_step, y - along * y_step
            least[i] = min(before[i], x * x + y * y)
    shown = max(sqrt(x_step**2 + y_step**2), 1e-6)
    x_ahead, y_ahead = x_step / shown, y_step / shown
    thick = max(1 - (shown / pace) ** 2, 0.02)
    share = np.empty(n)
    for i in range(n):
        share[i] = sqrt(max(1 - least[i] / radius**2, 0.0))
        if not ends:
            continue
        x, y = x_all[i] - line[last + 1, 0], y_all[i] - line[last + 1, 1]
        beyond = x * x_ahead + y * y_ahead
        if beyond > -0.5 and least[i] < before[i]:  # the last step is nearest
            share[i] *= min(max(0.5 - beyond, 0.0), 1.0)
        if face:
            away = beyond**2 / thick + (y * x_ahead - x * y_ahead) ** 2
            share[i] = max(share[i], sqrt(max(1 - away / radius**2, 0.0)))
    return share


@compiled
def tail(bend, depth, unit, center, rays, projection):  # type: ignore[no-untyped-def]
    """As `reference.tail`."""
    n = len(rays)
    points, way = np.empty((n, 2)), np.zeros(n)
    x_before, y_before, z_before = 0.0, 0.0, 0.0
    for i in range(n):
        share = i / (n - 1)
        far = depth[i] + unit * share * (bend[0] + share * (bend[1] + share * bend[2]))
        x, y, z = (
            center[0] + far * rays[i, 0],
            center[1] + far * rays[i, 1],
            center[2] + far * rays[i, 2],
        )
        if i > 0:
            length = sqrt((x - x_before) ** 2 + (y - y_before) ** 2 + (z - z_before) ** 2)
            way[i] = way[i - 1] + length / unit
        x_before, y_before, z_before = x, y, z
        scale = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z
        scale += projection[2, 3]
        for axis in range(2):
            seen = projection[axis, 0] * x + projection[axis, 1] * y + projection[axis, 2] * z
            points[i, axis] = (seen + projection[axis, 3]) / scale
    return points, way


@compiled
def smooth(picture, weights):  # type: ignore[no-untyped-def]
    """As `reference.smooth`."""
    rows, columns = picture.shape
    reach = len(weights) // 2
    blurred, wide = np.empty((rows, columns)), np.empty(columns + 2 * reach)
    for row in range(rows):
        into = wide[reach : reach + columns]
        into[:] = 0
        # Rows are taken as arrays of their own, so that several pixels are done at once.
        for k in range(-reach, reach + 1):
            light, weight = picture[_mirrored(row + k, rows)], weights[k + reach]
            for column in range(columns):
                into[column] += weight * light[column]
        for k in range(1, reach + 1):
            wide[reach - k] = into[_mirrored(-k, columns)]
            wide[reach + columns - 1 + k] = into[_mirrored(columns - 1 + k, columns)]
        into = blurred[row]
        into[:] = 0
        for k in range(2 * reach + 1):
            light, weight = wide[k : k + columns], weights[k]
            for column in range(columns):
                into[column] += weight * light[column]
    return blurred


@compiled
def discs(centers, step, across, along, shape):  # type: ignore[no-untyped-def]
    """As `reference.discs`."""
    rows, columns = shape
    heap = np.zeros((rows, columns))
    last = len(centers) - 1
    for i in range(last + 1):
        first, beyond = max(i - 1, 0), min(i + 1, last)
        x_ahead = (centers[beyond, 0] - centers[first, 0]) / (step * (beyond - first))
        y_ahead = (centers[beyond, 1] - centers[first, 1]) / (step * (beyond - first))
        sine = sqrt(x_ahead**2 + y_ahead**2)
        thin = sqrt(1 - min(sine, 1.0) ** 2)
        x_ahead, y_ahead = x_ahead / max(sine, 1e-6), y_ahead / max(sine, 1e-6)
        for j in range(len(across)):
            x = centers[i, 0] - across[j] * y_ahead + thin * along[j] * x_ahead
            y = centers[i, 1] + across[j] * x_ahead + thin * along[j] * y_ahead
            # floor may be -1: what lies partly beyond the border counts partly.
            column, row = floor(x), floor(y)
            right, below = x - column, y - row
            for down in range(2):
                for over in range(2):
                    y_at, x_at = row + down, column + over
                    if 0 <= y_at < rows and 0 <= x_at < columns:
                        part = (right if over else 1 - right) * (below if down else 1 - below)
                        heap[y_at, x_at] += part
    return heap


@compiled
def covered(  # type: ignore[no-untyped-def]
    pixels, body, line, radius, pace, face, absorption, weights, shape
):
    """As `reference.covered`."""
    share = shadow(pixels, line, radius, pace, True, face)
    light, root = np.ones(shape), np.empty(len(pixels))
    for i in range(len(pixels)):
        light[int(pixels[i, 1]), int(pixels[i, 0])] = exp(-absorption * max(body[i], share[i]))
    light = smooth(light, weights)
    for i in range(len(pixels)):
        root[i] = sqrt(light[int(pixels[i, 1]), int(pixels[i, 0])])
    return root


@compiled
def deviations(light, seen, noise, most, more):  # type: ignore[no-untyped-def]
    """As `reference.deviations`."""
    n = len(light)
    off = np.empty(n + len(more))
    for i in range(n):
        off[i] = min(max((light[i] - seen[i]) / noise, -most), most)
    off[n:] = more
    return off


@compiled
def damped_step(slopes, misfit, damping):  # type: ignore[no-untyped-def]
    """As `reference.damped_step`."""
    n = slopes.shape[1]
    normal, side = np.zeros((n, n)), np.zeros(n)
    for i in range(len(slopes)):
        for a in range(n):
            side[a] -= slopes[i, a] * misfit[i]
            for b in range(a + 1):
                normal[a, b] += slopes[i, a] * slopes[i, b]
    for a in range(n):
        normal[a, a] += damping * (normal[a, a] + 1e-6)
        for b in range(a):
            normal[b, a] = normal[a, b]
    _solve(normal, side)
    return side


@compiled
def learn_slopes(slopes, change, step):  # type: ignore[no-untyped-def]
    """As `reference.learn_slopes`."""
    square = 0.0
    for a in range(len(step)):
        square += step[a] ** 2
    for i in range(len(slopes)):
        missing = change[i]
        for a in range(len(step)):
            missing -= slopes[i, a] * step[a]
        for a in range(len(step)):
            slopes[i, a] += missing * step[a] / square
