"""Convex polygons: what a view can see, and where its border is."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from .arrays import Booleans, Floats


def inside_by(corners: Floats, pixels: Any) -> Floats:
    """How far pixels (n, 2) lie inside the nearest side of a convex polygon, (n,).

    Negative where they lie outside of one.

    Parameters
    ----------
    corners : (m, 2) array
        In order, either way round; some may coincide.
    pixels : (n, 2) array

    Examples
    --------
    >>> square = np.array([[0.0, 0], [10, 0], [10, 10], [0, 10]])
    >>> inside_by(square, [[2, 5], [13, 5]])
    array([ 2., -3.])
    """
    normals, level = _sides(corners.tobytes())
    if len(level) == 0:
        return np.full(len(pixels), -np.inf)
    # A side after the other: a minimum over the few sides of each pixel takes eight times as long.
    return np.asarray((normals @ np.asarray(pixels, dtype=float).T - level).min(axis=0))


@lru_cache(maxsize=256)  # views see the same from frame to frame
def _sides(corners: bytes) -> tuple[Floats, Floats]:
    """Inward normals (k, 2) of a polygon's sides, and how far they are along these, (k, 1)."""
    at = np.frombuffer(corners).reshape(-1, 2)
    to = at[[*range(1, len(at)), 0]] if len(at) else at
    around = np.sum(at[:, 0] * to[:, 1] - at[:, 1] * to[:, 0])
    sides = (to - at) * (1 if around >= 0 else -1)
    length = np.hypot(*sides.T)
    is_side = length > 1e-9
    normals = (sides[:, ::-1] * [-1, 1])[is_side] / length[is_side, None]
    return normals, np.sum(normals * at[is_side], axis=1, keepdims=True)


def in_polygon(corners: Floats, pixels: Any) -> Booleans:
    """Whether pixels (n, 2) lie in a convex polygon (m, 2)."""
    return np.asarray(inside_by(corners, pixels) >= 0)


def clipped(corners: Floats, line: Floats) -> Floats:
    """The part of a convex polygon (m, 2) where line·(x, y, 1) is not negative."""
    height = corners @ line[:2] + line[2]
    kept: list[Floats] = []
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if height[i] >= 0:
            kept.append(corners[i])
        if (height[i] >= 0) != (height[j] >= 0):
            share = height[i] / (height[i] - height[j])
            kept.append(corners[i] + share * (corners[j] - corners[i]))
    return np.array(kept)
