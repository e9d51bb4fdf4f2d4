"""The two pictures in space: behind the device, each in its own pyramid of rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats
from stereosom.camera import Camera, StereoRig

from ..acquisition import Image
from ..errors import require
from .look import NARROW_DEG, extent, picture_corners
from .style import Picture

pv = require("pyvista", "vtk")

# A source nearer than so many times the device's extent is drawn, too.
_NEAR = 3.0


def stretched(image: Image) -> Picture:
    """Picture as (rows, columns, 3) bytes, its 1st to 99th percentile from black to white."""
    gray = shades(image)
    return np.broadcast_to(gray, (*gray.shape[:2], 3))


def shades(image: Image) -> npt.NDArray[np.uint8]:
    """The same with one value a pixel where the picture is gray, (rows, columns, 1 or 3)."""
    picture = np.asarray(image)
    if picture.ndim == 2:
        picture = picture[:, :, None]
    # A grid of every few pixels has the same percentiles, and saves most of the time.
    every = max(1, int(np.sqrt(picture.shape[0] * picture.shape[1]) / 256))
    low, high = np.nanpercentile(picture[::every, ::every].astype(np.float32), [1, 99])
    if high <= low:  # a mask of a thin device: all but one percent is background
        low, high = float(np.nanmin(picture)), float(np.nanmax(picture))
    if picture.dtype in (np.uint8, np.uint16):  # few values: each is worked out once
        return np.take(_grays(np.arange(np.iinfo(picture.dtype).max + 1), low, high), picture)
    return _grays(picture, low, high)


def _grays(values: npt.NDArray[Any], low: float, high: float) -> npt.NDArray[np.uint8]:
    share = np.nan_to_num((values.astype(np.float32) - low) / max(high - low, 1e-12))
    return np.asarray(np.round(255 * np.clip(share, 0, 1)), dtype=np.uint8)


def picture_quad(camera: Camera, depth: float) -> Any:
    """The camera's picture slid along its rays to a depth (mm), as a textured quad.

    Returns
    -------
    pyvista.PolyData
        Four corners, with texture coordinates (0, 0) at the picture's bottom left and (1, 1)
        at its top right, whichever way the projection mirrors.
    """
    quad = pv.PolyData(picture_corners(camera, depth), faces=[4, 0, 1, 2, 3])
    quad.active_texture_coordinates = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=float)
    return quad


def texture(image: Image, stage: int) -> Any:
    """A picture to be spread over its quad, on a stage that is so many px high.

    Mipmaps keep a picture smooth that is drawn less than half as large as it is; with them,
    software OpenGL takes twice as long to draw a shot. A picture fills about half the stage.
    """
    rows = shades(image)[::-1]  # VTK counts rows from the bottom
    grid = pv.ImageData(dimensions=(rows.shape[1], rows.shape[0], 1))
    grid.point_data["picture"] = rows.reshape(-1, rows.shape[2])
    made = pv.Texture(grid)
    made.interpolate = True
    made.mipmap = max(np.shape(image)[:2]) > stage
    return made


def picture_depths(points: Floats, rig: StereoRig, reach: float = 0.0) -> tuple[float, float]:
    """Depths (mm) at which both pictures stand behind (n, 3) points, neither cutting the other.

    Behind what lies within `reach` of the points, too, mm.
    """
    span = extent(points)
    behind = max(0.05 * span, 1.05 * reach)
    nearest = [float(camera.depth(points).max()) + behind for camera in (rig.a, rig.b)]
    narrow = rig.convergence_deg < NARROW_DEG
    depth_a, depth_b = nearest
    for gap in span * np.arange(0, 20, 0.1):
        depth_a, depth_b = nearest[0] + (0 if narrow else gap), nearest[1] + gap
        past_b = rig.b.depth(picture_corners(rig.a, depth_a)) - depth_b
        past_a = rig.a.depth(picture_corners(rig.b, depth_b)) - depth_a
        # Not on a multiple of the step: rounding would decide for views side by side.
        if narrow and past_a.min() > 0.45 * span:
            break
        if not narrow and (past_a.max() < 0 or past_b.max() < 0):
            break
    return depth_a, depth_b


def frustum_start(camera: Camera, depth: float, points: Floats) -> float:
    """Depth (mm) at which the drawn pyramid of rays before a picture begins.

    At the source where that is near, and else, cut off squarely, before the (n, 3) points: an
    X-ray source stands ten times as far away as the device is long.
    """
    if depth < _NEAR * extent(points):
        return 1e-3 * depth
    return max(float(camera.depth(points).min()) - 0.25 * extent(points), 0.1 * depth)


def frustum(camera: Camera, start: float, depth: float) -> Any:
    """The pyramid of rays before a picture, between two depths (mm), as lines."""
    far, near = picture_corners(camera, depth), picture_corners(camera, start)
    corners: npt.NDArray[np.float64] = np.vstack([far, near])
    edges = [(k, k + 4) for k in range(4)] + [(k + 4, (k + 1) % 4 + 4) for k in range(4)]
    mesh = pv.PolyData(corners)
    mesh.lines = np.array([(2, *edge) for edge in edges]).ravel()
    mesh.verts = np.empty(0, dtype=int)
    return mesh
