"""The voxels of space that every view sees occupied.

D. B. Camarillo, K. E. Loewke, C. R. Carlson, J. K. Salisbury, "Vision based 3-D shape sensing
of flexible manipulators", IEEE ICRA 2008; reference 4 of J. M. Croom et al., "Visual sensing of
continuum robot shape using self-organizing maps", IEEE ICRA 2010. There three orthogonal views
are carved, and ordered by an angle about a fixed point; here the voxels are refined from coarse
to fine, and ordered along the path through them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import cKDTree

from ..arrays import Booleans, Floats, check_array
from ..camera import Camera, StereoRig
from ..ends import Ends
from ..observation import Observation
from ..options import Options, check_positive, check_whole
from ..reconstruction import HardFrame, Reconstruction
from .ordering import begin, finish, middle_of, path_between

METHOD = "voxel-carving"

# Of one level: a hundred megabytes and a few seconds.
_MOST_CELLS = 1_000_000
# Half the diagonal of a pixel, rounded up.
_PIXEL_PX = 0.75
_FARTHEST_BASELINES = 20.0
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 4.0


@dataclass(frozen=True, eq=False)
class VoxelCarvingOptions(Options):
    """Options of the carving.

    Parameters
    ----------
    voxel_mm : float, optional
        Edge of a voxel. Default: a sixth of the device's width, but at least a pixel.
    reference_vectors : int
        Points along the curve to which the fit is made.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    voxel_mm: float | None = None
    reference_vectors: int = 50

    def __post_init__(self) -> None:
        check_positive(self.voxel_mm, "voxel_mm")
        check_whole(self.reference_vectors, "reference_vectors", 3, 1000)


def voxel_carving(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct the backbone as the middle of the voxels that both views see occupied.

    Parameters
    ----------
    observation : Observation
    options : VoxelCarvingOptions, optional

    Raises
    ------
    HardFrame
        Where the pixels of this observation do not allow it.

    Examples
    --------
    A quarter circle of radius 60 mm is 94 mm long:

    >>> from stereosom.synthetic import arc, converging_rig, observe
    >>> result = voxel_carving(observe(arc(60, 90), radius=1.0, rig=converging_rig(60)))
    >>> 92 < result.backbone.length < 98
    True
    """
    if not isinstance(options, VoxelCarvingOptions):
        shared = options or Options()
        options = VoxelCarvingOptions(prior=shared.prior, start=shared.start)
    seen, ends = begin(observation, options)
    rig = seen.rig
    bounds = shared_bounds(rig, seen.pixels_a, seen.pixels_b)
    pixel = float(max(np.max(camera.pixel_size(bounds)) for camera in (rig.a, rig.b)))
    width = pixel * max(_width(seen.pixels_a), _width(seen.pixels_b))
    voxel = options.voxel_mm or max(pixel, width / 6)
    voxels = carve([(rig.a, seen.pixels_a), (rig.b, seen.pixels_b)], voxel, bounds)
    path = path_between(voxels, ends)
    distance, _ = cKDTree(path).query(voxels)
    # Beyond the corners of the device's cross-section lies what the views see double.
    near = np.asarray(distance) <= 1.2 * width / _opening(rig, ends) + voxel
    references = middle_of(voxels[near], path, options.reference_vectors)
    return finish(seen, references, ends, options, METHOD)


def carve(views: Sequence[tuple[Camera, Any]], voxel_mm: float, bounds: Any) -> Floats:
    """Centers of the voxels that are occupied in every view, (m, 3), mm.

    It alone takes any number of views; an `Observation`, and with it the method, has two.
    A voxel is occupied where its center projects onto a device pixel, or as near to one as
    half a voxel. Cubes that no view can hold are left out at every halving, so that time and
    memory go with the device's surface and not with the space around it.

    Parameters
    ----------
    views : sequence of (Camera, (n, 2) array)
        Each camera with its device pixels.
    voxel_mm : float
        Edge of a voxel.
    bounds : (2, 3) array
        Lowest and highest corner of the space to carve, mm.

    Raises
    ------
    HardFrame
        Where more voxels stay than any thin device needs.
    ValueError
        Where there is no view, or the bounds or the voxel have no extent.

    Examples
    --------
    >>> camera = Camera([[1000, 0, 320, 320e3], [0, 1000, 240, 240e3], [0, 0, 1, 1e3]], (640, 480))
    >>> one_pixel = [(camera, [[320.0, 240.0]])]
    >>> len(carve(one_pixel, 1.0, [[-4, -4, -4], [4, 4, 4]]))  # 8 deep, 2 × 2 about the axis
    32
    """
    low, high = check_array(bounds, "bounds", (2, 3))
    if not views:
        raise ValueError("views: there is none to carve with")
    if not np.all(low < high):
        raise ValueError("bounds: the first corner must lie below the second")
    if not 0 < voxel_mm < np.inf:
        raise ValueError(f"voxel_mm: must be a positive number of mm, is {voxel_mm!r}")
    trees = []
    for camera, pixels in views:
        pixels = check_array(pixels, "pixels", (None, 2))
        if len(pixels) == 0:
            return np.zeros((0, 3))
        trees.append((camera, cKDTree(pixels)))
    halvings = max(0, int(np.ceil(np.log2(np.max(high - low) / voxel_mm))))
    size = voxel_mm * 2**halvings
    centers = ((low + high) / 2)[None, :]
    for level in range(halvings + 1):
        if level > 0:
            if 8 * len(centers) > _MOST_CELLS:
                raise HardFrame(
                    f"more than {_MOST_CELLS} voxels of {size / 2:.2g} mm are left to carve: the "
                    "views show no thin device, or the voxels are too small"
                )
            centers = (centers[:, None, :] + size * _CORNERS).reshape(-1, 3)
            size /= 2
        for camera, tree in trees:
            centers = centers[_may_hold(camera, tree, centers, size, level == halvings)]
    inside = np.all((centers > low) & (centers < high), axis=1)
    return np.asarray(centers[inside])


def _may_hold(camera: Camera, tree: Any, centers: Floats, size: float, finest: bool) -> Booleans:
    """Whether the cubes about the (n, 3) centers reach a device pixel, (n,)."""
    depth = camera.depth(centers)
    half_diagonal = size * np.sqrt(3) / 2
    before = depth > (0 if finest else half_diagonal)
    # A cube about the camera or behind it: the first cannot be told, the second is empty.
    held = (depth > -half_diagonal) & ~before & (not finest)
    points, depth = centers[before], depth[before]
    if finest:
        reach = np.maximum(_PIXEL_PX, 0.5 * size * camera.focal_length / depth)
    else:  # the ball about the cube, which a view off its axis stretches
        stretch = np.linalg.norm(points - camera.center, axis=1) / depth
        radius = camera.focal_length * half_diagonal / (depth - half_diagonal)
        reach = _PIXEL_PX + stretch * radius
    distance, _ = tree.query(camera.project(points))
    held[before] = np.asarray(distance) <= reach
    return np.asarray(held)


def shared_bounds(rig: StereoRig, pixels_a: Floats, pixels_b: Floats) -> Floats:
    """Corners of the smallest box about all that could show within both views' pixels, (2, 3), mm.

    Each side of a view's pixels is a plane through its camera: the box is found by six linear
    programs. Nothing is looked for beyond twenty baselines.

    Raises
    ------
    HardFrame
        Where the views' pixels can show no common point.
    """
    planes = []
    for camera, pixels in ((rig.a, pixels_a), (rig.b, pixels_b)):
        x, y, depth = camera.projection
        low, high = pixels.min(axis=0) - 1, pixels.max(axis=0) + 1
        planes += [low[0] * depth - x, x - high[0] * depth, low[1] * depth - y, y - high[1] * depth]
        planes += [-depth, depth - [0, 0, 0, _FARTHEST_BASELINES * rig.baseline]]
    below = np.stack(planes)
    corners = np.empty((2, 3))
    for axis in range(3):
        for corner, sign in enumerate((1.0, -1.0)):
            goal = sign * np.eye(3)[axis]
            found = linprog(goal, below[:, :3], -below[:, 3], bounds=(None, None))
            if found.status != 0 or found.x is None:
                raise HardFrame("no point in space shows within the device's pixels of both views")
            corners[corner, axis] = found.x[axis]
    return corners


def _width(pixels: Floats) -> float:
    """Width of the device, px: twice its pixels over those at its edge, which lack a neighbor."""
    farthest = np.asarray(cKDTree(pixels).query(pixels, k=min(5, len(pixels)))[0])[:, -1]
    return 2 * len(pixels) / max(1, int(np.sum(farthest > 1.1)))


def _opening(rig: StereoRig, ends: Ends) -> float:
    """Sine of half the angle, or of half its supplement, between both rays at the device."""
    rays = np.stack([ends.base - rig.a.center, ends.base - rig.b.center])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    cosine = min(abs(float(rays[0] @ rays[1])), 1.0)
    return max(float(np.sqrt((1 - cosine) / 2)), 0.01)
