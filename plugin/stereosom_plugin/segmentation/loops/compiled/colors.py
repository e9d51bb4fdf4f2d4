"""As `reference.colors`, in loops that numba compiles."""

from __future__ import annotations

import numpy as np

from stereosom.numba_options import compiled


@compiled
def sampled(picture, x, y):  # type: ignore[no-untyped-def]
    """As `reference.sampled`."""
    pixels, size, channels = picture.reshape(picture.size), picture.shape[:2], picture.shape[2]
    n, m = x.shape
    colors = np.empty((n, m, channels), np.float32)
    for i in range(n):
        for j in range(m):
            at, right, below, x_share, y_share = _about(x[i, j], y[i, j], size, channels)
            for channel in range(channels):
                colors[i, j, channel] = _mixed(pixels, at, right, below, x_share, y_share)
                at += np.uint64(1)
    return colors


@compiled
def likeness(picture, x, y, table, shades):  # type: ignore[no-untyped-def]
    """As `reference.likeness`."""
    pixels, size, channels = picture.reshape(picture.size), picture.shape[:2], picture.shape[2]
    n, m = x.shape
    found, scale = np.empty((n, m), table.dtype), np.float32(shades / 255)
    for i in range(n):
        for j in range(m):
            at, right, below, x_share, y_share = _about(x[i, j], y[i, j], size, channels)
            number = 0
            for _ in range(channels):
                level = np.int64(scale * _mixed(pixels, at, right, below, x_share, y_share))
                number = number * shades + min(level, shades - 1)
                at += np.uint64(1)
            found[i, j] = table[number]
    return found


@compiled
def shades(picture, count):  # type: ignore[no-untyped-def]
    """As `reference.shades`."""
    rows, columns, _ = picture.shape
    number = np.empty((rows, columns), np.intp)
    for i in range(rows):
        for j in range(columns):
            number[i, j] = _shade(picture[i, j], count)
    return number


@compiled
def counted(picture, sample, count):  # type: ignore[no-untyped-def]
    """As `reference.counted`."""
    rows, columns, channels = picture.shape
    found = np.zeros((2, count**channels), np.intp)
    for i in range(rows):
        for j in range(columns):
            found[0 if sample[i, j] else 1, _shade(picture[i, j], count)] += 1
    return found


@compiled
def _shade(color, count):  # type: ignore[no-untyped-def]
    number = 0
    for channel in range(len(color)):
        level = int(min(max(color[channel] * np.float32(count), 0.0), count - 1.0))
        number = number * count + level
    return number


@compiled
def _about(x, y, size, channels):  # type: ignore[no-untyped-def]
    """Where the pixel before a place begins, how far its neighbors are, and the shares of those."""
    rows, columns = size
    x, y = min(max(x, 0.0), columns - 1.0), min(max(y, 0.0), rows - 1.0)
    column, row = np.int32(x), np.int32(y)
    # Without a sign, a place need not be looked at for a negative one.
    at = np.uint64((row * columns + column) * channels)
    right = np.uint64(channels * int(column < columns - 1))
    below = np.uint64(channels * columns * int(row < rows - 1))
    return at, right, below, np.float32(x - column), np.float32(y - row)


@compiled
def _mixed(pixels, at, right, below, x_share, y_share):  # type: ignore[no-untyped-def]
    up, down = np.float32(pixels[at]), np.float32(pixels[at + below])
    upper = up + x_share * (np.float32(pixels[at + right]) - up)
    lower = down + x_share * (np.float32(pixels[at + below + right]) - down)
    return upper + y_share * (lower - upper)
