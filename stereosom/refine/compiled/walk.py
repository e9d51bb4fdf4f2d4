"""As `reference.walk`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.walk import (
    ALIKE,
    BESIDE_PX,
    BEYOND,
    DIRECTIONS,
    DRAWN_IN,
    FOLLOWED,
    NARROWEST,
    PATIENCE,
    SHOWN,
    TILTED,
    TURNED,
    WIDEST,
)

# A view is a tuple: its projection, the mask, and the column and row of the mask's corner.


@compiled
def walk(projection_a, pixels_a, projection_b, pixels_b, guess, radius, rounded):  # type: ignore[no-untyped-def]
    """As `reference.walk`."""
    view_a, view_b = drawn(projection_a, pixels_a), drawn(projection_b, pixels_b)
    n, off = len(guess), 0
    for place in guess:
        x_a, y_a = shown_at(view_a, place, place)[:2]
        x_b, y_b = shown_at(view_b, place, place)[:2]
        off += not (has(view_a, x_a, y_a) and has(view_b, x_b, y_b))
    if off == 0:
        return np.empty((0, 3)), 0
    headings = np.empty((n, 3))
    for k in range(n):
        headings[k] = guess[min(k + 1, n - 1)] - guess[max(k - 1, 0)]
        make_unit(headings[k])
    longest, run, begin = 0, 0, 0
    row = np.empty(3)
    for at in range(n):
        on_both = True
        for view in (view_a, view_b):
            if on_both:
                told, offset = beside(view, guess[at], headings[at], radius, False, row)
                scale = shown_at(view, guess[at], headings[at])[4]
                on_both = told and abs(offset) <= radius * scale
        run = run + 1 if on_both else 0
        if run > longest:
            longest, begin = run, at - (run - 1) // 2
    if longest == 0:
        return np.empty((0, 3)), 0
    to_base = one_way(view_a, view_b, guess, headings, begin, -1, radius, rounded[0])
    to_tip = one_way(view_a, view_b, guess, headings, begin, 1, radius, rounded[1])
    if len(to_base) == 0 or len(to_tip) == 0:
        return np.empty((0, 3)), 0
    return np.concatenate((to_base[:0:-1], to_tip)), begin - len(to_base) + 1


@compiled
def one_way(view_a, view_b, guess, headings, begin, way, radius, rounded):  # type: ignore[no-untyped-def]
    """As `reference.walk._one_way`."""
    step = 0.0
    for axis in range(3):
        step += (guess[1, axis] - guess[0, axis]) ** 2
    step = np.sqrt(step)
    left = len(guess) - begin if way > 0 else begin + 1
    path = np.empty((left + int(BEYOND * len(guess)), 3))
    place, heading = guess[begin].copy(), way * headings[begin]
    row_a, row_b, moved = np.empty(3), np.empty(3), np.empty(3)
    covered = 0
    for number in range(len(path)):
        x, y = shown_at(view_a, place, heading)[:2]
        on_a = has(view_a, x, y)
        x, y = shown_at(view_b, place, heading)[:2]
        on_b = has(view_b, x, y)
        _, offset_a = beside(view_a, place, heading, radius, on_b, row_a)
        _, offset_b = beside(view_b, place, heading, radius, on_a, row_b)
        move(row_a, offset_a, row_b, offset_b, moved)
        for axis in range(3):
            place[axis] += (FOLLOWED if number else 1.0) * moved[axis]
            if number:
                heading[axis] += TURNED / step * moved[axis]
        make_unit(heading)
        path[number] = place
        if covers(view_a, place, heading, radius, rounded) and covers(
            view_b, place, heading, radius, rounded
        ):
            covered = number + 1
        elif (number + 1 - covered) * step > PATIENCE * radius:
            break
        at = begin + way * (number + 1)
        if 0 <= at < len(guess):
            for axis in range(3):
                heading[axis] += way * (headings[at, axis] - headings[at - way, axis])
            make_unit(heading)
        for axis in range(3):
            place[axis] += step * heading[axis]
    return path[:covered]


@compiled
def move(row_a, offset_a, row_b, offset_b, moved):  # type: ignore[no-untyped-def]
    """As `reference.walk._moved`."""
    aa, bb, ab = 0.0, 0.0, 0.0
    for axis in range(3):
        aa += row_a[axis] ** 2
        bb += row_b[axis] ** 2
        ab += row_a[axis] * row_b[axis]
    damping = ALIKE**2 * max(aa, bb)
    moved[:] = 0.0
    if damping > 0:
        determinant = (aa + damping) * (bb + damping) - ab**2
        by_a = ((bb + damping) * offset_a - ab * offset_b) / determinant
        by_b = ((aa + damping) * offset_b - ab * offset_a) / determinant
        for axis in range(3):
            moved[axis] = by_a * row_a[axis] + by_b * row_b[axis]


@compiled
def make_unit(vector):  # type: ignore[no-untyped-def]
    """As `reference.walk._unit`."""
    length = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    for axis in range(3):
        vector[axis] /= length


@compiled
def drawn(projection, pixels):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask.of`."""
    left, right = int(np.rint(pixels[0, 0])), int(np.rint(pixels[0, 0]))
    top, bottom = int(np.rint(pixels[0, 1])), int(np.rint(pixels[0, 1]))
    for k in range(len(pixels)):
        column, row = int(np.rint(pixels[k, 0])), int(np.rint(pixels[k, 1]))
        left, right = min(left, column), max(right, column)
        top, bottom = min(top, row), max(bottom, row)
    inside = np.zeros((bottom - top + 1, right - left + 1), dtype=np.bool_)
    for k in range(len(pixels)):
        inside[int(np.rint(pixels[k, 1])) - top, int(np.rint(pixels[k, 0])) - left] = True
    return projection, inside, left, top


@compiled
def has(view, x, y):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask.has`."""
    _, inside, left, top = view
    column, row = np.floor(x + 0.5) - left, np.floor(y + 0.5) - top
    height, width = inside.shape
    return 0 <= column < width and 0 <= row < height and inside[int(row), int(column)]


@compiled
def shown_at(view, place, heading):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask.shows`: x, y, the heading's x and y, and the scale."""
    projection = view[0]
    x, y, depth = projection[0, 3], projection[1, 3], projection[2, 3]
    for axis in range(3):
        x += projection[0, axis] * place[axis]
        y += projection[1, axis] * place[axis]
        depth += projection[2, axis] * place[axis]
    x, y = x / depth, y / depth
    ahead_x, ahead_y, squares = 0.0, 0.0, 0.0
    for axis in range(3):
        by_x = (projection[0, axis] - x * projection[2, axis]) / depth
        by_y = (projection[1, axis] - y * projection[2, axis]) / depth
        ahead_x += by_x * heading[axis]
        ahead_y += by_y * heading[axis]
        squares += by_x**2 + by_y**2
    return x, y, ahead_x, ahead_y, np.sqrt(squares / 2), depth


@compiled
def beside(view, place, heading, radius, kept_in, row):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask.beside`, with what is told per mm in `row`, and if it is."""
    projection = view[0]
    x, y, ahead_x, ahead_y, scale, depth = shown_at(view, place, heading)
    half, length = radius * scale, np.hypot(ahead_x, ahead_y)
    across_x, across_y, offset = 0.0, 0.0, np.nan
    if length >= SHOWN * scale:
        across_x, across_y = -ahead_y / length, ahead_x / length
        offset = middle(view, x, y, across_x, across_y, half)
    if np.isnan(offset) and kept_in and not has(view, x, y):
        across_x, across_y, offset = nearest(view, x, y, half)
    row[:] = 0.0
    if np.isnan(offset):
        return False, 0.0
    along = 0.0
    for axis in range(3):
        row[axis] = across_x * (projection[0, axis] - x * projection[2, axis]) / depth
        row[axis] += across_y * (projection[1, axis] - y * projection[2, axis]) / depth
        along += row[axis] * heading[axis]
    for axis in range(3):
        row[axis] -= along * heading[axis]
    return True, offset


@compiled
def middle(view, x, y, across_x, across_y, half):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask._middle`."""
    start = 0.0
    if not has(view, x, y):
        away = 1.0
        while away < half + BESIDE_PX and start == 0:
            if has(view, x + away * across_x, y + away * across_y):
                start = away
            elif has(view, x - away * across_x, y - away * across_y):
                start = -away
            away += 1.0
        if start == 0:
            return np.nan
    most = 4 * half + 2
    high = low = start
    while high - start < most and has(
        view, x + (high + 0.5) * across_x, y + (high + 0.5) * across_y
    ):
        high += 0.5
    while start - low < most and has(view, x + (low - 0.5) * across_x, y + (low - 0.5) * across_y):
        low -= 0.5
    width = high - low + 0.5
    if not NARROWEST * half - 1 <= width <= WIDEST * half + 1:
        return np.nan
    return (high + low) / 2


@compiled
def nearest(view, x, y, half):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask._nearest`."""
    away = 1.0
    while away < half + BESIDE_PX:
        for k in range(DIRECTIONS):
            angle = 2 * np.pi / DIRECTIONS * k
            way_x, way_y = np.cos(angle), np.sin(angle)
            if has(view, x + away * way_x, y + away * way_y):
                return way_x, way_y, away + DRAWN_IN * half
        away += 1.0
    return 0.0, 0.0, np.nan


@compiled
def covers(view, place, heading, radius, rounded):  # type: ignore[no-untyped-def]
    """As `reference.walk.Mask.covers`."""
    x, y, ahead_x, ahead_y, scale, _ = shown_at(view, place, heading)
    length = np.hypot(ahead_x, ahead_y)
    shown = min(length / scale, 1.0)
    reach = radius * scale * (1.0 if rounded else np.sqrt(1 - shown**2))
    if shown > TILTED:
        x, y = x + reach / length * ahead_x, y + reach / length * ahead_y
    return has(view, x, y)
