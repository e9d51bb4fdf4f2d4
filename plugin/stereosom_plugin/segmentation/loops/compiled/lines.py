"""As `reference.lines`, in loops that numba compiles."""

from __future__ import annotations

from math import erfc, exp, pi, sqrt

import numpy as np

from .numba_options import compiled


@compiled
def log_across(picture, line, normals, across, least):  # type: ignore[no-untyped-def]
    """As `reference.log_across`."""
    rows, columns = picture.shape
    n, m = len(line), len(across)
    log = np.empty((n, m), np.float32)
    least = np.float32(least)
    for i in range(n):
        for j in range(m):
            x = min(max(line[i, 0] + across[j] * normals[i, 0], 0.0), columns - 1.0)
            y = min(max(line[i, 1] + across[j] * normals[i, 1], 0.0), rows - 1.0)
            column, row = int(x), int(y)
            right, below = min(column + 1, columns - 1), min(row + 1, rows - 1)
            x, y = x - column, y - row
            upper = (1 - x) * picture[row, column] + x * picture[row, right]
            lower = (1 - x) * picture[below, column] + x * picture[below, right]
            log[i, j] = np.log(max(np.float32((1 - y) * upper + y * lower), least))
    return log


@compiled
def medians(values):  # type: ignore[no-untyped-def]
    """As `reference.medians`."""
    n, count = values.shape
    low, high = (count - 1) // 2, count // 2
    found = np.empty(n, values.dtype)
    row = np.empty(count, values.dtype)
    for i in range(n):
        for j in range(count):
            row[j] = values[i, j]
        _select(row, high)
        middle = row[high]
        if low < high:
            below = row[0]
            for j in range(1, high):
                below = max(below, row[j])
            middle = (below + middle) / 2
        found[i] = middle
    return found


@compiled
def _select(row, place):  # type: ignore[no-untyped-def]
    """Put what belongs at a place of a sorted row there, nothing greater before it (Hoare)."""
    left, right = 0, len(row) - 1
    while left < right:
        pivot = row[(left + right) // 2]
        i, j = left, right
        while i <= j:
            while row[i] < pivot:
                i += 1
            while row[j] > pivot:
                j -= 1
            if i <= j:
                row[i], row[j] = row[j], row[i]
                i += 1
                j -= 1
        if place <= j:
            right = j
        elif place >= i:
            left = i
        else:
            return


@compiled
def best_way(score, price):  # type: ignore[no-untyped-def]
    """As `reference.best_way`."""
    count, wide = score.shape
    most = len(price) // 2
    came = np.empty((count, wide), np.int32)
    total, before = np.empty(wide), np.empty(wide)
    for j in range(wide):
        total[j] = score[0, j]
    for row in range(1, count):
        before, total = total, before
        for j in range(wide):
            best, where = -np.inf, j
            for turn in range(len(price)):
                at = j + turn - most
                if 0 <= at < wide and before[at] - price[turn] > best:
                    best, where = before[at] - price[turn], at
            came[row, j] = where
            total[j] = best + score[row, j]
    way = np.empty(count, np.intp)
    way[count - 1] = np.argmax(total)
    for row in range(count - 1, 0, -1):
        way[row - 1] = came[row, way[row]]
    return way


@compiled
def blurred(values, weights):  # type: ignore[no-untyped-def]
    """As `reference.blurred`."""
    n, m = values.shape
    reach = len(weights) // 2
    smooth = np.zeros((n, m))
    for i in range(n):
        for k in range(-reach, reach + 1):
            at, weight = _mirrored(i + k, n), weights[k + reach]
            for j in range(m):
                smooth[i, j] += weight * values[at, j]
    return smooth


@compiled
def _mirrored(place, count):  # type: ignore[no-untyped-def]
    """A place beyond an end, mirrored back into the row."""
    while place < 0 or place >= count:
        place = -1 - place if place < 0 else 2 * count - 1 - place
    return place


@compiled
def absorbed(log, across, beyond, weights):  # type: ignore[no-untyped-def]
    """As `reference.absorbed`."""
    n, m = log.shape
    left, right = _level(log[:, :beyond], weights), _level(log[:, m - beyond :], weights)
    middle = -(across[0] + across[beyond - 1]) / 2
    dark = np.empty((n, m))
    for j in range(m):
        share = (across[j] + middle) / (2 * middle)
        for i in range(n):
            dark[i, j] = left[i, 0] * (1 - share) + right[i, 0] * share - log[i, j]
    return dark


@compiled
def _level(beside, weights):  # type: ignore[no-untyped-def]
    """Medians of rows (n, m), smooth from one to the next, (n, 1)."""
    n = len(beside)
    level = medians(beside)
    around = np.empty((n, 5))
    for i in range(n):
        for k in range(5):
            around[i, k] = level[_mirrored(i + k - 2, n)]
    return blurred(medians(around).reshape(n, 1), weights)


@compiled
def tube_profile(place, chords, parameters):  # type: ignore[no-untyped-def]
    """As `reference.tube_profile`."""
    n, m = len(place), len(chords)
    radius, absorption, blur, center = parameters
    profile, slopes = np.zeros(n), np.zeros((n, 4))
    taken, turned = 0.0, 0.0
    for box in range(m - 1, -1, -1):
        through = sqrt(1 - chords[box] ** 2)
        passes = exp(-absorption * through)
        weight, taken = 1 - passes - taken, 1 - passes
        grows, turned = through * passes - turned, through * passes
        wide = chords[box] + 0.5 / m
        for i in range(n):
            right = (place[i] - center + radius * wide) / blur
            left = (place[i] - center - radius * wide) / blur
            inside = 0.5 * (erfc(-right / sqrt(2.0)) - erfc(-left / sqrt(2.0)))
            high = exp(-(right**2) / 2) / sqrt(2 * pi)
            low = exp(-(left**2) / 2) / sqrt(2 * pi)
            profile[i] += weight * inside
            slopes[i, 0] += weight * wide * (high + low) / blur
            slopes[i, 1] += grows * inside
            slopes[i, 2] += weight * (left * low - right * high) / blur
            slopes[i, 3] += weight * (low - high) / blur
    return profile, slopes
