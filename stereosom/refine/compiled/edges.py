"""As `reference.edges`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.edges import (
    ABOUT,
    AGREEING,
    ALONG_PX,
    COVERED_PX,
    FARTHEST,
    LEAST_SPREAD,
    NARROWEST_PX,
    NEAR_PX,
    SPREADS,
    TURNED,
    WIDEST_PX,
)
from ..reference.outline import CAP_POINTS
from .outline import outline

# Outline points are kept in cells of this size, px.
CELL_PX = 8.0


@compiled
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
    left, top = points[:, 0].min() - 2 * CELL_PX, points[:, 1].min() - 2 * CELL_PX
    columns = int((points[:, 0].max() - left) / CELL_PX) + 3
    rows = int((points[:, 1].max() - top) / CELL_PX) + 3
    listed, number, begins = _by_cell(picture, normals, turning, left, top, columns, rows)
    for i in range(len(points)):
        px, py = points[i, 0], points[i, 1]
        dx, dy = directions[i, 0], directions[i, 1]
        edge = px, py, turning * dx, turning * dy
        # Half a cell lies between an edge and what is farther than these four cells.
        column, row = int((px - left) / CELL_PX - 0.5), int((py - top) / CELL_PX - 0.5)
        at = row * columns + column
        best, found = _nearest(edge, listed, begins[at], begins[at + 2], reach**2, -1)
        at += columns
        best, found = _nearest(edge, listed, begins[at], begins[at + 2], best, found)
        if best > (CELL_PX / 2) ** 2:
            near = np.sqrt(best)
            start = max(int((px - near - left) / CELL_PX), 0)
            stop = min(int((px + near - left) / CELL_PX), columns - 1) + 1
            above = max(int((py - near - top) / CELL_PX), 0)
            below = min(int((py + near - top) / CELL_PX), rows - 1) + 1
            for at in range(above * columns, below * columns, columns):
                best, found = _nearest(
                    edge, listed, begins[at + start], begins[at + stop], best, found
                )
        if found < 0:
            continue
        found = number[found]
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


@compiled
def _by_cell(picture, normals, turning, left, top, columns, rows):  # type: ignore[no-untyped-def]
    """Points of an outline in the order of their cells, what their numbers are, where cells begin.

    Of each its place, px, and its normal times `turning`. Those beyond the grid are in its border.
    """
    count = len(picture)
    place = np.empty(count, dtype=np.int64)
    begins = np.zeros(rows * columns + 2, dtype=np.int64)
    for k in range(count):
        x = min(max((picture[k, 0] - left) / CELL_PX, 0.0), columns - 1.0)
        y = min(max((picture[k, 1] - top) / CELL_PX, 0.0), rows - 1.0)
        place[k] = int(y) * columns + int(x)
        begins[place[k] + 2] += 1
    for cell in range(2, len(begins)):
        begins[cell] += begins[cell - 1]
    listed, number = np.empty((count, 4)), np.empty(count, dtype=np.int64)
    for k in range(count):
        at = begins[place[k] + 1]
        listed[at, 0], listed[at, 1] = picture[k, 0], picture[k, 1]
        listed[at, 2], listed[at, 3] = turning * normals[k, 0], turning * normals[k, 1]
        number[at] = k
        begins[place[k] + 1] += 1  # it ends where the next one begins
    return listed, number, begins


@compiled
def _nearest(edge, listed, start, stop, best, found):  # type: ignore[no-untyped-def]
    """The nearest to an edge among some points of an outline, if it is nearer than the best."""
    x, y, dx, dy = edge
    for k in range(start, stop):
        squared = (x - listed[k, 0]) ** 2 + (y - listed[k, 1]) ** 2
        squared += (dx - listed[k, 2]) ** 2 + (dy - listed[k, 3]) ** 2
        if squared < best:
            best, found = squared, k
    return best, found


@compiled
def look(projection, center, curve, tangents, radius, capped, points, directions, gate):  # type: ignore[no-untyped-def]
    """As `reference.look`."""
    for i in range(len(curve)):
        depth = projection[2, 3]
        for axis in range(3):
            depth += projection[2, axis] * curve[i, axis]
        if not depth > 2 * radius:
            raise ValueError("the tube runs behind the camera")
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
    ends, about = np.empty((2, 2)), np.zeros(2)
    for end in range(2):
        at = end * (len(curve) - 1)
        for axis in range(2):
            ends[end, axis] = (picture[at, axis] + picture[len(curve) + at, axis]) / 2
    kept, weights, pulls, holds = 0, 0.0, 0.0, 0.0
    scale = 1 / (2 * spread) if spread > 0 else 0.0
    for i in range(len(points)):
        k, r = nearest[i], residual[i]
        if k < 0 or not abs(r) < limit:
            for end in range(2):
                away = (points[i, 0] - ends[end, 0]) ** 2 + (points[i, 1] - ends[end, 1]) ** 2
                about[end] += away < (ABOUT * half_width) ** 2
            continue
        far = (r * scale) ** 2
        w = 1 / (1 + far)
        weight[k] += w
        total[k] += w * r
        squares[k] += w * r**2
        kept += 1
        weights += w
        pulls += (w * r) ** 2
        holds += (1 - far) * w**2
    noise, alone = 0.0, 0.0
    if kept:
        alone = pulls / weights
        noise = pulls / kept * (weights / kept) / max(holds / kept, 0.1) ** 2
    told = 0
    sums = np.zeros((3, 4))
    start = 0
    for number, length in enumerate((len(curve), len(curve), CAP_POINTS, CAP_POINTS)):
        for k in range(start, start + length):
            told += weight[k] > 0
            sums[0, number] += weight[k]
            sums[1, number] += total[k]
            sums[2, number] += squares[k]
        start += length
    slant = np.empty(2)
    for end in range(2):
        at = end * (len(curve) - 1)
        along, far = 0.0, 0.0
        for axis in range(3):
            ray = curve[at, axis] - center[axis]
            along += ray * tangents[at, axis]
            far += ray**2
        slant[end] = abs(along) / np.sqrt(far)
    stray = 1 - kept / max(len(points), 1)
    numbers = np.array(
        [noise, stray, half_width, told, alone, about[0], about[1], slant[0], slant[1]]
    )
    return picture, normals, pull, turn, grow, weight, total, squares, sums, numbers


@compiled
def rims_seen(weight, squares, samples, tolerance):  # type: ignore[no-untyped-def]
    """As `reference.rims_seen`."""
    seen = np.zeros((2, samples), dtype=np.bool_)
    for rim in range(2):
        for i in range(samples):
            k = rim * samples + i
            if weight[k] > 0 and np.sqrt(squares[k] / max(weight[k], 1e-12)) < tolerance:
                seen[rim, max(i - 2, 0) : i + 3] = True
    return seen


@compiled
def middle_offset(weight, total, samples):  # type: ignore[no-untyped-def]
    """As `reference.middle_offset`."""
    squares, count = 0.0, 0
    for i in range(samples):
        left, right = weight[i], weight[samples + i]
        if left > 0 and right > 0:
            squares += ((total[i] / left - total[samples + i] / right) / 2) ** 2
            count += 1
    return np.sqrt(squares / max(count, 1))


@compiled
def unseen(picture, seen, capped):  # type: ignore[no-untyped-def]
    """As `reference.unseen`."""
    n = seen.shape[1]
    length, bare = 0.0, 0.0
    for rim in range(2):
        start, stop = 0, n
        found = np.flatnonzero(seen[rim])
        if len(found):
            start = 0 if capped[0] else found[0]
            stop = n if capped[1] else found[-1]
        for i in range(start, stop):
            if not seen[rim, i]:
                before, after = max(i - 1, 0), min(i + 1, n - 1)
                step = picture[rim * n + after] - picture[rim * n + before]
                spacing = np.hypot(step[0], step[1]) / (after - before)
                length += spacing
                if not _covered(picture, n, rim * n + i):
                    bare += spacing
    return length, bare


@compiled
def _covered(picture, samples, at):  # type: ignore[no-untyped-def]
    """Whether a point of a tube's outline lies within the tube."""
    x, y = picture[at, 0], picture[at, 1]
    for j in range(samples):
        left, right = picture[j], picture[samples + j]
        half_width = np.hypot(left[0] - right[0], left[1] - right[1]) / 2
        away = np.hypot(x - (left[0] + right[0]) / 2, y - (left[1] + right[1]) / 2)
        if away < half_width - COVERED_PX:
            return True
    return False
