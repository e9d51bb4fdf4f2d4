"""Both eyes in one picture or one film, and how to take them apart."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from ..acquisition import Image

Layout = Literal["side-by-side", "top-bottom", "interleaved", "interleaved-frames"]
LAYOUTS: tuple[Layout, ...] = get_args(Layout)


def eye_size(size: tuple[int, int], layout: Layout) -> tuple[int, int]:
    """Width and height of one eye's share of a stacked picture, px.

    Examples
    --------
    >>> eye_size((1280, 360), "side-by-side")
    (640, 360)
    """
    width, height = size
    if layout == "side-by-side":
        return width // 2, height
    if layout in ("top-bottom", "interleaved"):
        return width, height // 2
    return width, height


def apart(picture: Image, layout: Layout) -> tuple[Image, Image]:
    """Left and right eye of a stacked picture: left, top, or the even lines are the left one's.

    Parameters
    ----------
    picture : (rows, columns, 3) array
    layout : {'side-by-side', 'top-bottom', 'interleaved'}

    Examples
    --------
    >>> left, right = apart(np.arange(4).reshape(4, 1, 1), "interleaved")
    >>> left.ravel().tolist(), right.ravel().tolist()
    ([0, 2], [1, 3])
    """
    rows, columns = picture.shape[0] // 2, picture.shape[1] // 2
    if layout == "side-by-side":
        return picture[:, :columns], picture[:, columns : 2 * columns]
    if layout == "top-bottom":
        return picture[:rows], picture[rows : 2 * rows]
    return picture[0 : 2 * rows : 2], picture[1 : 2 * rows : 2]


def widened(eye: Image, size: tuple[int, int], first_line: int | None = None) -> Image:
    """An eye's squeezed picture brought back to its camera's size, linearly.

    Parameters
    ----------
    eye : (rows, columns, 3) array
    size : (int, int)
        Width and height of the camera's picture, px.
    first_line : int, optional
        Of interleaved pictures: the line of the camera's picture that the eye's first one is;
        every second one follows. Default: pixels cover the whole picture evenly.

    Examples
    --------
    >>> widened(np.array([[[10]], [[20]]], dtype=np.uint8), (1, 4), 0).ravel().tolist()
    [10, 15, 20, 20]
    """
    width, height = size
    for axis, count in ((0, height), (1, width)):
        have = eye.shape[axis]
        if have == count:
            continue
        if axis == 0 and first_line is not None:
            place = (np.arange(count) - first_line) / 2
        else:
            place = (np.arange(count) + 0.5) * have / count - 0.5
        place = np.clip(place, 0, have - 1)
        low = np.minimum(place.astype(int), max(have - 2, 0))
        share = (place - low).astype(np.float32)
        share = share[:, None, None] if axis == 0 else share[None, :, None]
        next_one = np.minimum(low + 1, have - 1)
        mixed = eye.take(low, axis) * (1 - share) + eye.take(next_one, axis) * share
        eye = np.rint(mixed).astype(eye.dtype)
    return eye
