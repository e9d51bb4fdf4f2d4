"""As `reference.lines`, in loops that numba compiles."""

from __future__ import annotations

from math import sqrt

import numpy as np

from stereosom.numba_options import compiled

# Rows of so many values are looked through for their middle, of which a sample of so many tells.
LONG, SAMPLED = 96, 24


@compiled
def light_across(picture, line, normals, across, least):  # type: ignore[no-untyped-def]
    """As `reference.light_across`."""
    rows, columns = picture.shape
    n, m = len(line), len(across)
    light = np.empty((n, m), np.float32)
    least, pixels = np.float32(least), np.ascontiguousarray(picture).reshape(rows * columns)
    for i in range(n):
        x_first, y_first = line[i]
        x_ahead, y_ahead = normals[i]
        x_least, x_last = x_first + across[0] * x_ahead, x_first + across[m - 1] * x_ahead
        y_least, y_last = y_first + across[0] * y_ahead, y_first + across[m - 1] * y_ahead
        inside = min(x_least, x_last) >= 0 and max(x_least, x_last) < columns - 1
        inside = inside and min(y_least, y_last) >= 0 and max(y_least, y_last) < rows - 1
        for j in range(m):
            x, y = x_first + across[j] * x_ahead, y_first + across[j] * y_ahead
            right, down = np.uint64(1), columns
            if not inside:
                x, y = min(max(x, 0.0), columns - 1.0), min(max(y, 0.0), rows - 1.0)
                right, down = np.uint64(x < columns - 1), columns * int(y < rows - 1)
            column, row = np.int32(x), np.int32(y)
            x_share, y_share = np.float32(x - column), np.float32(y - row)
            # Without a sign, a place need not be looked at for a negative one.
            at, below = np.uint64(row * columns + column), np.uint64(row * columns + column + down)
            upper = pixels[at] + x_share * (pixels[at + right] - pixels[at])
            lower = pixels[below] + x_share * (pixels[below + right] - pixels[below])
            light[i, j] = max(upper + y_share * (lower - upper), least)
    return light


@compiled
def medians(values):  # type: ignore[no-untyped-def]
    """As `reference.medians`."""
    n, count = values.shape
    low, high = (count - 1) // 2, count // 2
    found = np.empty(n, values.dtype)
    row, some = np.empty(count, values.dtype), np.empty(count + 1, values.dtype)
    for i in range(n):
        for j in range(count):
            row[j] = values[i, j]
        few, below = row, 0
        if count >= LONG:
            below, held = _about_the_middle(row, some)
            if below <= low and high < below + held:
                few = some[:held]
            else:
                below = 0
        _select(few, high - below)
        middle = few[high - below]
        if low < high:
            before = few[0]
            for j in range(1, high - below):
                before = max(before, few[j])
            middle = (before + middle) / 2
        found[i] = middle
    return found


@compiled
def middles(values, size):  # type: ignore[no-untyped-def]
    """As `reference.middles`."""
    n, reach = len(values), size // 2
    found, some = np.empty(n), np.empty(size)
    for i in range(n):
        for k in range(size):
            value, at = values[min(max(i + k - reach, 0), n - 1)], k
            while at > 0 and some[at - 1] > value:
                some[at] = some[at - 1]
                at -= 1
            some[at] = value
        found[i] = some[reach]
    return found


@compiled
def _about_the_middle(row, some):  # type: ignore[no-untyped-def]
    """Pick values about the middle of a row into `some`: how many lie below, and are picked."""
    step = len(row) // SAMPLED
    sample = row[: SAMPLED * step : step].copy()
    _select(sample, 2 * SAMPLED // 3)
    most = sample[2 * SAMPLED // 3]
    _select(sample, SAMPLED // 3)
    least = sample[SAMPLED // 3]
    below, held = 0, 0
    # No branches: which way they go would be guessed wrongly half of the time.
    for j in range(len(row)):
        value = row[j]
        some[held] = value
        below += value < least
        held += (least <= value) & (value <= most)
    return below, held


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
def _mirrored(place, count):  # type: ignore[no-untyped-def]
    """A place beyond an end, mirrored back into the row."""
    while place < 0 or place >= count:
        place = -1 - place if place < 0 else 2 * count - 1 - place
    return place


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
def blurred(values, weights):  # type: ignore[no-untyped-def]
    """As `reference.blurred`."""
    n, m = values.shape
    reach = len(weights) // 2
    flat, smooth = np.ascontiguousarray(values).reshape(n * m), np.zeros(n * m)
    inner = max(n - 2 * reach, 0)
    # What is not near an end is one long row, so that several values are done at once.
    into = smooth[reach * m : (reach + inner) * m]
    for k in range(2 * reach + 1):
        light, weight = flat[k * m : (k + inner) * m], weights[k]
        for i in range(inner * m):
            into[i] += weight * light[i]
    for i in range(n):
        if reach <= i < reach + inner:
            continue
        for k in range(-reach, reach + 1):
            at, weight = _mirrored(i + k, n), weights[k + reach]
            for j in range(m):
                smooth[i * m + j] += weight * flat[at * m + j]
    return smooth.reshape((n, m))


@compiled
def absorbed(log, across, beyond, weights):  # type: ignore[no-untyped-def]
    """As `reference.absorbed`."""
    n, m = log.shape
    left, right = _level(log[:, :beyond], weights), _level(log[:, m - beyond :], weights)
    middle = -(across[0] + across[beyond - 1]) / 2
    share = (across + middle) / (2 * middle)
    dark = np.empty((n, m))
    for i in range(n):
        before, change = left[i, 0], right[i, 0] - left[i, 0]
        for j in range(m):
            dark[i, j] = before + share[j] * change - log[i, j]
    return dark


@compiled
def normals(line):  # type: ignore[no-untyped-def]
    """As `reference.normals`."""
    last = len(line) - 1
    across = np.empty((last + 1, 2))
    for i in range(last + 1):
        before, behind = max(i - 1, 0), min(i + 1, last)
        x, y = line[behind, 0] - line[before, 0], line[behind, 1] - line[before, 1]
        length = max(sqrt(x**2 + y**2), 1e-9)
        across[i, 0], across[i, 1] = -y / length, x / length
    return across


@compiled
def evenly(line, spacing):  # type: ignore[no-untyped-def]
    """As `reference.evenly`."""
    n = len(line)
    way = np.zeros(n)
    for i in range(1, n):
        x, y = line[i, 0] - line[i - 1, 0], line[i, 1] - line[i - 1, 1]
        way[i] = way[i - 1] + sqrt(x**2 + y**2)
    count = max(2, round(way[n - 1] / spacing) + 1)
    found = np.empty((count, 2))
    piece = 0
    for i in range(count):
        at = way[n - 1] * i / (count - 1)
        while piece < n - 2 and way[piece + 1] <= at:
            piece += 1
        share = min((at - way[piece]) / max(way[piece + 1] - way[piece], 1e-300), 1.0)
        for axis in range(2):
            found[i, axis] = line[piece, axis] + share * (line[piece + 1, axis] - line[piece, axis])
    return found
