"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from __future__ import annotations

import numpy as np
from numba import njit

from .reference import (
    AGREEING,
    ALONG_PX,
    AROUND,
    CAP_POINTS,
    FARTHEST,
    HARMONICS,
    LEAST_SPREAD,
    MARGIN,
    NARROWEST_PX,
    NEAR_PX,
    NOWHERE,
    SHARPEST,
    SPREADS,
    TURNED,
    WIDEST_PX,
)

# Outline points are kept in cells of this size, px.
CELL_PX = 8.0

_compile = njit(cache=True, fastmath=False, nogil=True)


@_compile
def contour(pixels):  # type: ignore[no-untyped-def]
    """As `reference.contour`."""
    left, top = np.floor(pixels[:, 0].min()) - MARGIN, np.floor(pixels[:, 1].min()) - MARGIN
    width = int(np.rint(pixels[:, 0].max() - left)) + MARGIN + 1
    height = int(np.rint(pixels[:, 1].max() - top)) + MARGIN + 1
    inside = np.zeros(width * height, dtype=np.uint8)
    at = np.empty(len(pixels), dtype=np.int64)
    for i in range(len(pixels)):
        column, row = int(np.rint(pixels[i, 0] - left)), int(np.rint(pixels[i, 1] - top))
        at[i] = row * width + column
        inside[at[i]] = 1
    outer = np.zeros(width * height, dtype=np.uint8)
    kept, count = 0, 0
    for i in range(len(at)):
        missing = 0
        for step in (1, -1, width, -width):
            missing += 1 - inside[at[i] + step]
        if missing and not outer[at[i]]:
            outer[at[i]] = 1
            at[kept] = at[i]
            kept += 1
            count += missing
    at = np.sort(at[:kept])
    points, directions = np.empty((count, 2)), np.empty((count, 2))
    k = 0
    for step, across_x, across_y in (
        (1, 0.5, 0.0),
        (-1, -0.5, 0.0),
        (width, 0.0, 0.5),
        (-width, 0.0, -0.5),
    ):
        for i in range(kept):
            if inside[at[i] + step]:
                continue
            points[k, 0] = at[i] % width + across_x + left
            points[k, 1] = at[i] // width + across_y + top
            x, y = 0.5 * across_x, 0.5 * across_y
            for j in range(len(AROUND)):
                near = at[i] + AROUND[j, 1] * width + AROUND[j, 0]
                beside = inside[near] + inside[near + step]
                x -= beside * AROUND[j, 0]
                y -= beside * AROUND[j, 1]
            length = max(np.sqrt(x**2 + y**2), 1e-9)
            directions[k, 0], directions[k, 1] = x / length, y / length
            k += 1
    return points, directions


@_compile
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
        if not capped[cap]:
            picture[2 * n + cap * CAP_POINTS : 2 * n + (cap + 1) * CAP_POINTS] = NOWHERE
    return picture, normals, pull, turn, grow, bend


@_compile
def match(picture, normals, bend, samples, points, directions, turning, reach):  # type: ignore[no-untyped-def]
    """As `reference.match`: the same nearest points, found in a grid of cells."""
    count = len(picture)
    spacing = np.zeros(count)
    start = 0
    for length in (samples, samples, CAP_POINTS, CAP_POINTS):
        for k in range(start, start + length - 1):
            step = np.hypot(picture[k + 1, 0] - picture[k, 0], picture[k + 1, 1] - picture[k, 1])
            spacing[k], spacing[k + 1] = max(spacing[k], step), max(spacing[k + 1], step)
        start += length
    nearest = np.full(len(points), -1, dtype=np.int64)
    residual = np.zeros(len(points))
    cell = CELL_PX
    rings = int(reach / cell) + 1
    left, top = points[:, 0].min() - 2 * cell, points[:, 1].min() - 2 * cell
    columns = int((points[:, 0].max() - left) / cell) + 3
    rows = int((points[:, 1].max() - top) / cell) + 3
    # Chains of outline points by cell: the last one in each, and the one before each.
    last = np.full(rows * columns, -1, dtype=np.int32)
    previous = np.full(count, -1, dtype=np.int32)
    for k in range(count):
        x, y = (picture[k, 0] - left) / cell, (picture[k, 1] - top) / cell
        if 0 <= x < columns and 0 <= y < rows:
            at = int(y) * columns + int(x)
            previous[k], last[at] = last[at], k
    turning_squared = turning**2
    for i in range(len(points)):
        px, py = points[i, 0], points[i, 1]
        dx, dy = directions[i, 0], directions[i, 1]
        column, row = int((px - left) / cell), int((py - top) / cell)
        best, found = reach**2, -1
        for ring in range(rings + 1):
            # All beyond the rings that were searched are farther off than this.
            if ring and best <= ((ring - 1) * cell) ** 2:
                break
            for near_row in range(max(row - ring, 0), min(row + ring + 1, rows)):
                edge = near_row == row - ring or near_row == row + ring
                for near_column in range(column - ring, column + ring + 1, 1 if edge else 2 * ring):
                    if near_column < 0 or near_column >= columns:
                        continue
                    k = last[near_row * columns + near_column]
                    while k >= 0:
                        squared = (px - picture[k, 0]) ** 2 + (py - picture[k, 1]) ** 2
                        if squared < best:
                            turned = (dx - normals[k, 0]) ** 2 + (dy - normals[k, 1]) ** 2
                            squared += turning_squared * turned
                            if squared < best:
                                best, found = squared, k
                        k = previous[k]
        if found < 0:
            continue
        nx, ny = normals[found, 0], normals[found, 1]
        if dx * nx + dy * ny <= AGREEING:
            continue
        ox, oy = px - picture[found, 0], py - picture[found, 1]
        along = nx * oy - ny * ox
        if abs(along) >= spacing[found] + ALONG_PX:
            continue
        nearest[i] = found
        residual[i] = ox * nx + oy * ny + 0.5 * bend[found] * along**2
    return nearest, residual


@_compile
def look(projection, center, curve, tangents, radius, capped, points, directions, gate):  # type: ignore[no-untyped-def]
    """As `reference.look`."""
    picture, normals, pull, turn, grow, bend = outline(
        projection, center, curve, tangents, radius, capped
    )
    half_width = radius * np.median(grow[: 2 * len(curve)])
    turning = min(max(half_width, NARROWEST_PX), WIDEST_PX)
    reach = (gate if gate > 0 else NEAR_PX) + TURNED * turning
    nearest, residual = match(
        picture, normals, bend, len(curve), points, directions, turning, reach
    )
    spread, limit = 0.0, gate
    if gate <= 0:
        found = np.abs(residual[nearest >= 0])
        if len(found):
            spread = max(LEAST_SPREAD, 1.4826 * np.median(found))
            limit = max(FARTHEST, SPREADS * spread)
    count = len(picture)
    weight, total, squares = np.zeros(count), np.zeros(count), np.zeros(count)
    kept, weights, pulls, holds = 0, 0.0, 0.0, 0.0
    for i in range(len(points)):
        k, r = nearest[i], residual[i]
        if k < 0 or not abs(r) < limit:
            continue
        far = (r / (2 * spread)) ** 2 if spread > 0 else 0.0
        w = 1 / (1 + far)
        weight[k] += w
        total[k] += w * r
        squares[k] += w * r**2
        kept += 1
        weights += w
        pulls += (w * r) ** 2
        holds += (1 - far) * w**2
    noise = 0.0
    if kept:
        noise = pulls / kept * (weights / kept) / max(holds / kept, 0.1) ** 2
    numbers = np.array([noise, 1 - kept / max(len(points), 1), half_width])
    return picture, normals, pull, turn, grow, weight, total, squares, numbers


@_compile
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


@_compile
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


@_compile
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


@_compile
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


@_compile
def _frame(center, at, tangent, radius, toward, beside):  # type: ignore[no-untyped-def]
    """Fill in unit vectors across the curve, toward the camera and beside; where the rim is."""
    along, distance = 0.0, 0.0
    for axis in range(3):
        along += (at[axis] - center[axis]) * tangent[axis]
    for axis in range(3):
        toward[axis] = along * tangent[axis] - (at[axis] - center[axis])
        distance += toward[axis] ** 2
    distance = max(np.sqrt(distance), 1e-12)
    for axis in range(3):
        toward[axis] /= distance
    _cross(tangent, toward, beside)
    cosine = min(max(radius / distance, 0.0), 1.0)
    return cosine, np.sqrt(1 - cosine**2)


@_compile
def _point(projection, at, radius, normal, along, ahead, k, picture, normals, pull, grow):  # type: ignore[no-untyped-def]
    """Fill in one point of the outline."""
    x, y, depth = _project(
        projection,
        at[0] + radius * normal[0],
        at[1] + radius * normal[1],
        at[2] + radius * normal[2],
    )
    dx, dy, out_x, out_y = 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        of_x = (projection[0, axis] - x * projection[2, axis]) / depth
        of_y = (projection[1, axis] - y * projection[2, axis]) / depth
        dx += of_x * along[axis]
        dy += of_y * along[axis]
        out_x += of_x * (normal[axis] + ahead[axis])
        out_y += of_y * (normal[axis] + ahead[axis])
    length = max(np.sqrt(dx**2 + dy**2), 1e-12)
    nx, ny = dy / length, -dx / length
    if nx * out_x + ny * out_y < 0:
        nx, ny = -nx, -ny
    picture[k, 0], picture[k, 1] = x, y
    normals[k, 0], normals[k, 1] = nx, ny
    grow[k] = 0.0
    for axis in range(3):
        of_x = (projection[0, axis] - x * projection[2, axis]) / depth
        of_y = (projection[1, axis] - y * projection[2, axis]) / depth
        pull[k, axis] = nx * of_x + ny * of_y
        grow[k] += pull[k, axis] * normal[axis]


@_compile
def _project(projection, x, y, z):  # type: ignore[no-untyped-def]
    """Pixel and depth."""
    u = projection[0, 0] * x + projection[0, 1] * y + projection[0, 2] * z + projection[0, 3]
    v = projection[1, 0] * x + projection[1, 1] * y + projection[1, 2] * z + projection[1, 3]
    w = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
    return u / w, v / w, w


@_compile
def _cross(a, b, product):  # type: ignore[no-untyped-def]
    """Fill in the cross product, also where it takes the place of b."""
    x, y = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]
    product[0], product[1] = x, y
