"""As `reference.pictures`, in loops that numba compiles."""

from __future__ import annotations

from math import floor, sqrt

import numpy as np

from stereosom.numba_options import compiled


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
