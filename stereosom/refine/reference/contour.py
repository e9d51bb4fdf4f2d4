"""The edges of a mask, and which way is out of it."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats

# The outward direction of a mask's edge is read off the pixels around it, within this distance.
_AROUND_PX = 3
MARGIN = _AROUND_PX + 2
AROUND = np.array(
    [
        (x, y)
        for y in range(-_AROUND_PX, _AROUND_PX + 1)
        for x in range(-_AROUND_PX, _AROUND_PX + 1)
        if 0 < x**2 + y**2 <= _AROUND_PX**2
    ]
)


def contour(pixels: Floats) -> tuple[Floats, Floats]:
    """Edge points of a mask, and the outward directions there; see `mask_contour`.

    Parameters
    ----------
    pixels : (n, 2) array

    Returns
    -------
    (m, 2) array, px; (m, 2) array of unit vectors
    """
    corner = np.floor(pixels.min(axis=0)) - MARGIN
    cells = np.rint(pixels - corner).astype(np.int64)
    width, height = cells.max(axis=0) + MARGIN + 1
    inside = np.zeros(width * height, dtype=np.uint8)
    at = np.unique(cells[:, 1] * width + cells[:, 0])  # in one order, whatever theirs is
    inside[at] = 1
    points, directions = [], []
    for step, across in (
        (1, (0.5, 0.0)),
        (-1, (-0.5, 0.0)),
        (width, (0.0, 0.5)),
        (-width, (0.0, -0.5)),
    ):
        edge = inside[at + step] == 0
        points.append(np.column_stack([at[edge] % width, at[edge] // width]) + across)
        away = np.zeros((int(edge.sum()), 2))
        for x, y in AROUND:
            beside = inside[at[edge] + y * width + x].astype(float)
            beside += inside[at[edge] + step + y * width + x]
            away -= beside[:, None] * (float(x), float(y))
        # Of a line of single pixels both sides look alike: then outward is away from the pixel.
        directions.append(away + np.multiply(across, 0.5))
    direction = np.vstack(directions)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    return np.vstack(points) + corner, direction
