"""As `reference.edges`, in loops that numba compiles."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np

from stereosom.numba_options import compiled

from .lines import _mirrored


@compiled
def weighted(values, weights, bell, more):  # type: ignore[no-untyped-def]
    """As `reference.weighted`."""
    n, m = values.shape
    reach = len(bell) // 2
    margin, wide = min(reach + 1, n - 1), weights.shape[1]
    mean = np.empty((n, m))
    product, weight = np.empty(n + 2 * reach), np.empty(n + 2 * reach)
    total, share = np.empty(n), np.empty(n)
    for j in range(m):
        for i in range(n + 2 * reach):
            at = _mirrored(i - reach + margin, n + 2 * margin) - margin
            inner = -at if at < 0 else 2 * n - 2 - at if at >= n else at
            value = values[inner, j]
            if inner != at:
                value = 2 * values[0 if at < 0 else n - 1, j] - value
            weight[i] = weights[inner, min(j, wide - 1)]
            product[i] = value * weight[i]
        total[:], share[:] = 0, more
        for k in range(len(bell)):
            for i in range(n):  # several at once
                total[i] += bell[k] * product[i + k]
                share[i] += bell[k] * weight[i + k]
        for i in range(n):
            mean[i, j] = total[i] / share[i]
    return mean


@compiled
def most_gain(gain, first, reach):  # type: ignore[no-untyped-def]
    """As `reference.most_gain`."""
    n, m = gain.shape
    found, smooth = np.empty((2, n), np.intp), np.empty(m)
    for i in range(n):
        smooth[:] = 0
        for k in range(-2, 3):
            at = _mirrored(i + k, n)
            for j in range(m):
                smooth[j] += gain[at, j]
        for number in range(2):
            most, total = -np.inf, 0.0
            for away in range(1, reach + 1):
                column = first[i] + (2 * number - 1) * away
                total += smooth[min(max(column, 0), m - 1)]
                if total > most:
                    most, found[number, i] = total, away
    return found


@compiled
def half_way(profile, step, least_hue):  # type: ignore[no-untyped-def]
    """As `reference.half_way`."""
    n, wide, channels = profile.shape
    rows = profile.reshape((n, wide * channels))
    total = np.zeros((n, wide * channels), profile.dtype)
    inner, way, hue = np.empty((n, channels)), np.empty((n, channels)), np.empty((n, channels))
    shift, far = np.empty(n), np.zeros(n)
    of_hue = 0.0
    for i in range(n):
        for k in range(-2, 3):
            row, into = rows[_mirrored(i + k, n)], total[i]
            for j in range(len(row)):  # several at once
                into[j] += row[j]
        along, brightness = 0.0, 0.0
        for c in range(channels):
            within, outer = 0.0, 0.0
            for j in range(6):
                within += total[i, (1 + j) * channels + c]
                outer += total[i, (14 + j) * channels + c]
            inner[i, c], way[i, c] = within / 6, (outer - within) / 6
            along += way[i, c] * inner[i, c]
            brightness += inner[i, c] ** 2
        for c in range(channels):
            hue[i, c] = way[i, c] - along / max(brightness, 25e-6) * inner[i, c]
            far[i] += way[i, c] ** 2
            of_hue += hue[i, c] ** 2
    by_hue = of_hue > least_hue * far.sum()
    if by_hue:
        way = hue
    for i in range(n):
        square, taken = 0.0, 0.0
        for c in range(channels):
            square += way[i, c] ** 2
        for j in range(wide):
            share = 0.0
            for c in range(channels):
                share += (total[i, j * channels + c] - inner[i, c]) * way[i, c]
            taken += min(max(share / max(square, 25e-6), 0.0), 1.0)
        shift[i], far[i] = (10.5 - taken) * step, sqrt(far[i]) / 5
    return shift, far, by_hue


@compiled
def held(total, ends, reaches, short, begin, step):  # type: ignore[no-untyped-def]
    """As `reference.held`."""
    n, m = total.shape
    before = np.zeros((len(ends), len(reaches)))
    for i in range(len(ends)):
        for kind in range(len(reaches)):
            for j in range(m):
                place = (ends[i] - reaches[kind] * short[j] - begin) / step
                place = min(max(place, 0.0), n - 1.0)
                row = min(int(place), n - 2)
                share = place - row
                before[i, kind] += (1 - share) * total[row, j] + share * total[row + 1, j]
    return before


@compiled
def fill(drawn, outline):  # type: ignore[no-untyped-def]
    """As `reference.fill`."""
    rows, columns = drawn.shape
    n = len(outline)
    begin = np.zeros(rows + 1, np.intp)
    for i in range(n):
        first, last = _rows_crossed(outline[i, 1], outline[(i + 1) % n, 1], rows)
        for row in range(first, last):
            begin[row + 1] += 1
    for row in range(rows):
        begin[row + 1] += begin[row]
    place, turn = np.empty(begin[rows]), np.empty(begin[rows], np.int8)
    filled = begin[:-1].copy()
    for i in range(n):
        (x, y), (to_x, to_y) = outline[i], outline[(i + 1) % n]
        first, last = _rows_crossed(y, to_y, rows)
        for row in range(first, last):
            here, at = x + (row - y) * (to_x - x) / (to_y - y), filled[row]
            while at > begin[row] and place[at - 1] > here:
                place[at], turn[at] = place[at - 1], turn[at - 1]
                at -= 1
            place[at], turn[at] = here, 1 if to_y > y else -1
            filled[row] += 1
    for row in range(rows):
        turns = 0
        for k in range(begin[row], begin[row + 1] - 1):
            turns += turn[k]
            if turns:
                start, stop = max(ceil(place[k]), 0), min(ceil(place[k + 1]), columns)
                for column in range(start, stop):
                    drawn[row, column] = True


@compiled
def _rows_crossed(y, to_y, rows):  # type: ignore[no-untyped-def]
    """The first line of pixels that a side crosses, and that after the last."""
    first = min(max(ceil(min(y, to_y)), 0), rows)
    return first, min(max(ceil(max(y, to_y)), first), rows)
