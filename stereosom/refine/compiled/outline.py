"""As `reference.outline`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.outline import CAP_POINTS, NOWHERE, OPEN, ROUND, SHARPEST


@compiled
def outline(projection, center, curve, tangents, radius, capped):  # type: ignore[no-untyped-def]
    """As `reference.outline`."""
    n = len(curve)
    count = 2 * n + 2 * CAP_POINTS
    picture, normals = np.empty((count, 2)), np.empty((count, 2))
    pull, turn = np.empty((count, 3)), np.zeros((count, 3))
    grow, bend = np.empty(count), np.zeros(count)
    toward, beside, normal, along, ahead = np.zeros((5, 3))
    for i in range(n):
        cosine, sine = _frame(center, curve[i], tangents[i], radius, toward, beside)
        for side in range(2):
            sign = 1.0 - 2.0 * side
            for axis in range(3):
                normal[axis] = cosine * toward[axis] + sign * sine * beside[axis]
                along[axis] = curve[i, axis] + radius * normal[axis] - center[axis]
            _cross(normal, along, along)
            _point(projection, curve[i], radius, normal, along, ahead,
                   side * n + i, picture, normals, pull, grow)  # fmt: skip
    for cap in range(2):
        end = 0 if cap == 0 else n - 1
        outward = -1.0 if cap == 0 else 1.0
        tangent = tangents[end]
        cosine, sine = _frame(center, curve[end], tangent, radius, toward, beside)
        x, y, depth = _project(projection, curve[end, 0], curve[end, 1], curve[end, 2])
        leading = 0.0
        for pixel, row in ((x, projection[0]), (y, projection[1])):
            one, other = 0.0, 0.0
            for axis in range(3):
                slope = (row[axis] - pixel * projection[2, axis]) / depth
                one += slope * tangent[axis]
                other += slope * toward[axis]
            leading += one * other
        begin = np.arctan2(sine, cosine)
        stop = -begin if outward * leading > 0 else 2 * np.pi - begin
        for axis in range(3):
            ahead[axis] = outward * tangent[axis]
        if capped[cap] == ROUND:
            _limb(projection, center, curve[end], radius, ahead, beside,
                  2 * n + cap * CAP_POINTS, picture, normals, pull, grow)  # fmt: skip
            continue
        for j in range(CAP_POINTS):
            angle = begin + (j + 1) / (CAP_POINTS + 1) * (stop - begin)
            for axis in range(3):
                normal[axis] = np.cos(angle) * toward[axis] + np.sin(angle) * beside[axis]
                along[axis] = np.cos(angle) * beside[axis] - np.sin(angle) * toward[axis]
            k = 2 * n + cap * CAP_POINTS + j
            _point(projection, curve[end], radius, normal, along, ahead,
                   k, picture, normals, pull, grow)  # fmt: skip
            lever = 0.0
            for axis in range(3):
                lever -= radius * pull[k, axis] * tangent[axis]
            for axis in range(3):
                turn[k, axis] = lever * normal[axis]
    start = 0
    for length in (n, n, CAP_POINTS, CAP_POINTS):
        for k in range(start, start + length):
            before, after = max(k - 1, start), min(k + 1, start + length - 1)
            squared, bent = 1e-300, 0.0
            for axis in range(2):
                step = picture[after, axis] - picture[before, axis]
                squared += step**2
                bent += step * (normals[after, axis] - normals[before, axis])
            bend[k] = min(max(bent / max(squared, 1e-12), -SHARPEST), SHARPEST)
        start += length
    for cap in range(2):
        if capped[cap] == OPEN:
            picture[2 * n + cap * CAP_POINTS : 2 * n + (cap + 1) * CAP_POINTS] = NOWHERE
    return picture, normals, pull, turn, grow, bend


@compiled
def _limb(projection, center, at, radius, ahead, beside, first, picture, normals, pull, grow):  # type: ignore[no-untyped-def]
    """Fill in the outline of half a ball, from one side of the tube around to the other."""
    ray, onward, normal, along = np.empty((4, 3))
    far, slant = 0.0, 0.0
    for axis in range(3):
        ray[axis] = at[axis] - center[axis]
        far += ray[axis] ** 2
        slant += ray[axis] * ahead[axis]
    length = 0.0
    for axis in range(3):
        onward[axis] = ahead[axis] - slant / far * ray[axis]
        length += onward[axis] ** 2
    length, far = max(np.sqrt(length), 1e-12), np.sqrt(far)
    nearer = min(radius / far, 1.0)
    for j in range(CAP_POINTS):
        angle = np.pi * (j + 1) / (CAP_POINTS + 1)
        for axis in range(3):
            limb = np.cos(angle) * beside[axis] + np.sin(angle) * onward[axis] / length
            normal[axis] = np.sqrt(1 - nearer**2) * limb - nearer / far * ray[axis]
            along[axis] = np.cos(angle) * onward[axis] / length - np.sin(angle) * beside[axis]
        _point(projection, at, radius, normal, along, ahead,
               first + j, picture, normals, pull, grow)  # fmt: skip


@compiled
def _frame(center, at, tangent, radius, toward, beside):  # type: ignore[no-untyped-def]
    """Fill in unit vectors across the curve, toward the camera and beside; where the rim is."""
    along, distance = 0.0, 0.0
    for axis in range(3):
        along += (at[axis] - center[axis]) * tangent[axis]
    for axis in range(3):
        toward[axis] = along * tangent[axis] - (at[axis] - center[axis])
        distance += toward[axis] ** 2
    nearness = 1 / max(np.sqrt(distance), 1e-12)
    for axis in range(3):
        toward[axis] *= nearness
    _cross(tangent, toward, beside)
    cosine = min(max(radius * nearness, 0.0), 1.0)
    return cosine, np.sqrt(1 - cosine**2)


@compiled
def _point(projection, at, radius, normal, along, ahead, k, picture, normals, pull, grow):  # type: ignore[no-untyped-def]
    """Fill in one point of the outline."""
    x, y, depth = _project(
        projection,
        at[0] + radius * normal[0],
        at[1] + radius * normal[1],
        at[2] + radius * normal[2],
    )
    inverse = 1.0 / depth
    x0 = (projection[0, 0] - x * projection[2, 0]) * inverse
    x1 = (projection[0, 1] - x * projection[2, 1]) * inverse
    x2 = (projection[0, 2] - x * projection[2, 2]) * inverse
    y0 = (projection[1, 0] - y * projection[2, 0]) * inverse
    y1 = (projection[1, 1] - y * projection[2, 1]) * inverse
    y2 = (projection[1, 2] - y * projection[2, 2]) * inverse
    dx = x0 * along[0] + x1 * along[1] + x2 * along[2]
    dy = y0 * along[0] + y1 * along[1] + y2 * along[2]
    out0, out1, out2 = normal[0] + ahead[0], normal[1] + ahead[1], normal[2] + ahead[2]
    out_x = x0 * out0 + x1 * out1 + x2 * out2
    out_y = y0 * out0 + y1 * out1 + y2 * out2
    length = 1.0 / max(np.sqrt(dx**2 + dy**2), 1e-12)
    nx, ny = dy * length, -dx * length
    if nx * out_x + ny * out_y < 0:
        nx, ny = -nx, -ny
    picture[k, 0], picture[k, 1] = x, y
    normals[k, 0], normals[k, 1] = nx, ny
    pull[k, 0], pull[k, 1], pull[k, 2] = nx * x0 + ny * y0, nx * x1 + ny * y1, nx * x2 + ny * y2
    grow[k] = pull[k, 0] * normal[0] + pull[k, 1] * normal[1] + pull[k, 2] * normal[2]


@compiled
def _project(projection, x, y, z):  # type: ignore[no-untyped-def]
    """Pixel and depth."""
    u = projection[0, 0] * x + projection[0, 1] * y + projection[0, 2] * z + projection[0, 3]
    v = projection[1, 0] * x + projection[1, 1] * y + projection[1, 2] * z + projection[1, 3]
    w = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
    return u / w, v / w, w


@compiled
def _cross(a, b, product):  # type: ignore[no-untyped-def]
    """Fill in the cross product, also where it takes the place of b."""
    x, y = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]
    product[0], product[1] = x, y
