"""Lengths along curves, in space and in pictures, and points at even steps of them."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats


def reach_along(points: Floats) -> Floats:
    """Length along a polyline (n, 3) up to each of its points, (n,)."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def evenly(points: Floats, reach: Floats, count: int) -> Floats:
    """Points (count, 3) at even steps along a polyline.

    Parameters
    ----------
    points : (n, 3) array
    reach : (n,) array
        What the steps are measured by: from zero on, not falling.
    count : int
    """
    even = reach[-1] / (count - 1) * np.arange(count)
    return np.column_stack([np.interp(even, reach, axis) for axis in points.T])


def steps_in_picture(projection: Floats, curve: Floats) -> tuple[Floats, float]:
    """Lengths of the steps along a curve in a picture, and the mean depth of its points.

    Parameters
    ----------
    projection : (3, 4) array
        Its third row is so scaled that it gives the depth.
    curve : (n, 3) array
        mm.

    Returns
    -------
    steps : (n - 1,) array
        px.
    depth : float
        mm.
    """
    homogeneous = curve @ projection[:, :3].T + projection[:, 3]
    picture = homogeneous[:, :2] / homogeneous[:, 2:]
    return np.linalg.norm(np.diff(picture, axis=0), axis=1), float(homogeneous[:, 2].mean())


def reach_in_pictures(
    projection_a: Floats, focal_a: float, projection_b: Floats, focal_b: float, curve: Floats
) -> Floats:
    """Length along a curve up to each point, as the picture shows it that shows more, (n,), mm.

    Where the views leave depth open, length in space would count errors of it.

    Parameters
    ----------
    projection_a, projection_b
        As of `steps_in_picture`.
    focal_a, focal_b : float
        px.
    curve : (n, 3) array
        mm.
    """
    steps_a, depth_a = steps_in_picture(projection_a, curve)
    steps_b, depth_b = steps_in_picture(projection_b, curve)
    steps = np.maximum(steps_a * depth_a / focal_a, steps_b * depth_b / focal_b)
    return np.concatenate([[0.0], np.cumsum(steps)])
