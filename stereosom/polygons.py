"""Convex polygons: what a view can see, and where its border is."""

from __future__ import annotations

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
    to = corners[[*range(1, len(corners)), 0]]
    around = np.sum(corners[:, 0] * to[:, 1] - corners[:, 1] * to[:, 0])
    sides = (to - corners) * (1 if around >= 0 else -1)
    length = np.hypot(*sides.T)
    is_side = length > 1e-9
    normals = (sides[:, ::-1] * [-1, 1])[is_side] / length[is_side, None]
    level = np.sum(normals * corners[is_side], axis=1)
    inward = normals @ np.asarray(pixels, dtype=float).T - level[:, None]
    return np.asarray(inward.min(axis=0, initial=np.inf if is_side.any() else -np.inf))


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
