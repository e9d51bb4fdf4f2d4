"""As `reference.pictures`, in loops that numba compiles."""

from __future__ import annotations

from math import exp, floor, sqrt

import numpy as np

from .lines import _mirrored
from .numba_options import compiled


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
    steps, square = line[1:] - line[:-1], np.empty(last + 1)
    for j in range(last + 1):
        square[j] = max(steps[j, 0] ** 2 + steps[j, 1] ** 2, 1e-12)
    shown = sqrt(square[last])
    x_ahead, y_ahead = steps[last, 0] / shown, steps[last, 1] / shown
    share = np.empty(n)
    for i in range(n):
        least, nearest = np.inf, 0
        for j in range(last + 1):
            x, y = pixels[i, 0] - line[j, 0], pixels[i, 1] - line[j, 1]
            along = min(max((x * steps[j, 0] + y * steps[j, 1]) / square[j], 0.0), 1.0)
            x, y = x - along * steps[j, 0], y - along * steps[j, 1]
            if x * x + y * y < least:
                least, nearest = x * x + y * y, j
        share[i] = sqrt(max(1 - least / radius**2, 0.0))
        if not ends:
            continue
        x, y = pixels[i, 0] - line[last + 1, 0], pixels[i, 1] - line[last + 1, 1]
        beyond = x * x_ahead + y * y_ahead
        if nearest == last and beyond > -0.5:
            share[i] *= min(max(0.5 - beyond, 0.0), 1.0)
        if face:
            away = beyond**2 / max(1 - (shown / pace) ** 2, 0.02) + (y * x_ahead - x * y_ahead) ** 2
            share[i] = max(share[i], sqrt(max(1 - away / radius**2, 0.0)))
    return share


@compiled
def blurred_root(share, shown, absorption, weights):  # type: ignore[no-untyped-def]
    """As `reference.blurred_root`."""
    rows, columns = shown.shape
    reach = len(weights) // 2
    light = np.ones((rows, columns))
    at = 0
    for row in range(rows):
        for column in range(columns):
            if shown[row, column]:
                light[row, column] = exp(-absorption * share[at])
                at += 1
    down = np.empty((rows, columns))
    for row in range(rows):
        for column in range(columns):
            total = 0.0
            for k in range(-reach, reach + 1):
                total += weights[k + reach] * light[_mirrored(row + k, rows), column]
            down[row, column] = total
    root = np.empty(len(share))
    at = 0
    for row in range(rows):
        for column in range(columns):
            if shown[row, column]:
                total = 0.0
                for k in range(-reach, reach + 1):
                    total += weights[k + reach] * down[row, _mirrored(column + k, columns)]
                root[at] = sqrt(total)
                at += 1
    return root


@compiled
def heaped(points, shape):  # type: ignore[no-untyped-def]
    """As `reference.heaped`."""
    rows, columns = shape
    heap = np.zeros((rows, columns))
    for i in range(len(points)):
        # floor may be -1: what lies partly beyond the border counts partly.
        column, row = floor(points[i, 0]), floor(points[i, 1])
        right, below = points[i, 0] - column, points[i, 1] - row
        for down in range(2):
            for over in range(2):
                y, x = row + down, column + over
                if 0 <= y < rows and 0 <= x < columns:
                    heap[y, x] += (right if over else 1 - right) * (below if down else 1 - below)
    return heap


@compiled
def draw_line(mask, line, radius):  # type: ignore[no-untyped-def]
    """As `reference.draw_line`."""
    rows, columns = mask.shape
    last = len(line) - 2
    before = 0.0
    for step in range(last + 1):
        x_step, y_step = line[step + 1, 0] - line[step, 0], line[step + 1, 1] - line[step, 1]
        length = max(sqrt(x_step**2 + y_step**2), 1e-9)
        x_step, y_step = x_step / length, y_step / length
        mitre = 0.0
        if step < last:
            x_next, y_next = (
                line[step + 2, 0] - line[step + 1, 0],
                line[step + 2, 1] - line[step + 1, 1],
            )
            cosine = (x_step * x_next + y_step * y_next) / max(sqrt(x_next**2 + y_next**2), 1e-9)
            mitre = (
                sqrt(min(max((1 - cosine) / (1 + max(cosine, 0.0)), 0.0), 1.0)) * radius[step + 1]
            )
        half = (radius[step] + radius[step + 1]) / 2
        reach = sqrt(half**2 + max(before, length + mitre) ** 2)
        x_first, y_first = (
            max(floor(line[step, 0] - reach), 0),
            max(floor(line[step, 1] - reach), 0),
        )
        for row in range(y_first, min(floor(line[step, 1] + reach) + 2, rows)):
            for column in range(x_first, min(floor(line[step, 0] + reach) + 2, columns)):
                x, y = column - line[step, 0], row - line[step, 1]
                along, aside = x * x_step + y * y_step, abs(x * y_step - y * x_step)
                if -before <= along <= length + mitre and aside <= half:
                    mask[row, column] = True
        before = mitre


@compiled
def darker_lines(smooth, taps, aside, absorption, direction):  # type: ignore[no-untyped-def]
    """As `reference.darker_lines`."""
    rows, columns = absorption.shape
    margin = (smooth.shape[0] - rows) // 2
    side = int(np.abs(aside).max())
    high, wide, edge = rows + 2 * side, columns + 2 * side, margin - side
    better = np.zeros((rows, columns), np.bool_)
    mean, sides = np.empty((high, wide), np.float32), np.empty(columns, np.float32)
    share = np.float32(1 / taps.shape[1])
    for number in range(len(taps)):
        # Rows are taken as arrays of their own, so that several pixels are done at once.
        for row in range(high):
            into = mean[row]
            into[:] = 0
            for tap in range(taps.shape[1]):
                first, at = edge + taps[number, tap, 0], edge + row + taps[number, tap, 1]
                light = smooth[at, first : first + wide]
                for column in range(wide):
                    into[column] += light[column]
            for column in range(wide):
                into[column] *= share
        x, y = aside[number]
        for row in range(rows):
            here = mean[side + row, side : side + columns]
            left = mean[side + row - y, side - x : side - x + columns]
            right = mean[side + row + y, side + x : side + x + columns]
            for column in range(columns):
                sides[column] = min(left[column], right[column]) - here[column]
            most, which, more = absorption[row], direction[row], better[row]
            for column in range(columns):
                if sides[column] > most[column]:
                    most[column] = sides[column]
                    which[column] = number
                    more[column] = True
    return better
