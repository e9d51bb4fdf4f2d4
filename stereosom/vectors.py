"""Products of many vectors in space, and directions across them."""

from __future__ import annotations

import numpy as np

from .arrays import Floats


def perpendicular(vectors: Floats) -> Floats:
    """Unit vectors (n, 3) perpendicular to others of length one; which of them is arbitrary."""
    seed = np.eye(3)[np.argmin(np.abs(vectors), axis=1)]
    across = cross(vectors, seed)
    return np.asarray(across / np.sqrt(dot(across, across))[:, None])


def reflected(vectors: Floats, across: Floats) -> Floats:
    """Vectors (..., n, 3), each reflected in the plane across one of (n, 3); or not, by zero."""
    square = dot(across, across)
    share = np.where(square > 1e-24, 2 * dot(vectors, across) / (square + 1e-300), 0.0)
    return np.asarray(vectors - share[..., None] * across)


def dot(one: Floats, other: Floats) -> Floats:
    """Products of vectors (..., 3), each with its other."""
    return np.asarray(np.einsum("...i,...i", one, other))


def cross(one: Floats, other: Floats) -> Floats:
    """As numpy's, of vectors (..., 3), in a quarter of the time."""
    (x, y, z), (u, v, w) = np.moveaxis(one, -1, 0), np.moveaxis(other, -1, 0)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)
