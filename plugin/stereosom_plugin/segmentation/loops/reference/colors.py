"""Colors of a picture between its pixels, and how like a device they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Booleans, Floats, Integers

Light = npt.NDArray[np.float32]


def sampled(picture: Any, x: Floats, y: Floats) -> Light:
    """Colors, (n, m, channels), at places (n, m), by straight lines between pixels.

    Parameters
    ----------
    picture : (rows, columns, channels) array
        In one piece; beyond the border it goes on as there.
    x, y : (n, m) array
        px.
    """
    rows, columns = picture.shape[:2]
    x, y = np.clip(x, 0, columns - 1), np.clip(y, 0, rows - 1)
    column, row = x.astype(np.intp), y.astype(np.intp)
    right, below = np.minimum(column + 1, columns - 1), np.minimum(row + 1, rows - 1)
    x_share, y_share = (share.astype(np.float32)[..., None] for share in (x - column, y - row))

    def between(line: Any) -> Light:
        left = picture[line, column].astype(np.float32)
        return np.asarray(left + x_share * (picture[line, right].astype(np.float32) - left))

    upper, lower = between(row), between(below)
    return np.asarray(upper + y_share * (lower - upper))


def likeness(picture: Any, x: Floats, y: Floats, table: Light, shades: int) -> Light:
    """What a table of all colors says, (n, m), of those at places (n, m).

    Parameters
    ----------
    picture : (rows, columns, channels) array of uint8
    x, y : (n, m) array
        px.
    table : (shades ** channels,) array
    shades : int
        How many of each color are told apart.
    """
    levels = np.minimum(
        (sampled(picture, x, y) * np.float32(shades / 255)).astype(np.intp), shades - 1
    )
    number = np.zeros(x.shape, dtype=np.intp)
    for channel in range(picture.shape[2]):
        number = number * shades + np.minimum(levels[..., channel], shades - 1)
    return table[number]


def shades(picture: Light, count: int) -> Integers:
    """Number of each pixel's color, (rows, columns), where so many of each color are told apart.

    Parameters
    ----------
    picture : (rows, columns, channels) array
        Light, 0 to 1.
    count : int
    """
    level = np.clip(picture * np.float32(count), 0, count - 1).astype(np.intp)
    number = level[..., 0]
    for channel in range(1, picture.shape[-1]):
        number = number * count + level[..., channel]
    return np.asarray(number)


def counted(picture: Light, sample: Booleans, count: int) -> Integers:
    """How often each color is in a sample of a picture, and elsewhere, (2, count ** channels)."""
    number, most = shades(picture, count), count ** picture.shape[2]
    return np.stack([np.bincount(number[part], minlength=most) for part in (sample, ~sample)])
