"""Truth for tests, docs and users: curves, rigs, and the masks that the rigs see."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from .backbone import Backbone
from .camera import Camera, StereoRig
from .observation import Observation


def arc(radius: float = 50.0, angle_deg: float = 90.0) -> Backbone:
    """A circular arc in the x-z plane that leaves the origin along z.

    Examples
    --------
    >>> quarter = arc(radius=50, angle_deg=90)
    >>> round(quarter.length, 3)  # 50 π / 2
    78.54
    """
    angle = np.linspace(0.0, np.radians(angle_deg), 200)
    points = radius * np.column_stack([1 - np.cos(angle), np.zeros_like(angle), np.sin(angle)])
    return Backbone.through(points)


def growing_helix(
    length: float = 239.0, height: float = 150.0, turns: float = 1.25, degree: int = 6
) -> Backbone:
    """The paper's mock-up: a polynomial close to a helix whose radius grows linearly.

    It leaves the origin along z. `height` and `length` fix the final radius.

    Parameters
    ----------
    length, height : float
        Arc length, and extent along z, mm.
    turns : float
        How often it winds.
    degree : int
        Of the polynomial, as in the paper.
    """
    share = np.linspace(0.0, 1.0, 400)

    def helix(final_radius: float) -> Backbone:
        angle, radius = 2 * np.pi * turns * share, final_radius * share
        points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height * share])
        return Backbone.fit_polynomial(points - points[0], degree)

    low, high = 0.0, length
    for _ in range(60):  # the length grows with the radius: halve the interval
        middle = (low + high) / 2
        low, high = (middle, high) if helix(middle).length < length else (low, middle)
    return helix(high)


def converging_rig(
    angle_deg: float = 45.0,
    distance: float = 700.0,
    focal_length: float = 2400.0,
    image_size: tuple[int, int] = (1024, 768),
    target: tuple[float, float, float] = (0.0, 0.0, 75.0),
) -> StereoRig:
    """Two equal cameras that look at one point, seen from which they stand `angle_deg` apart.

    Parameters
    ----------
    angle_deg : float
        Convergence angle.
    distance : float
        From each camera to the target, mm.
    focal_length : float
        Pixels.
    image_size : (int, int)
        Width and height, pixels.
    target : (3,) floats
        Where both look, mm; the cameras stand at the same z.

    Examples
    --------
    >>> round(converging_rig(45).convergence_deg, 6)
    45.0
    """
    width, height = image_size
    intrinsics = np.array(
        [[focal_length, 0, (width - 1) / 2], [0, focal_length, (height - 1) / 2], [0, 0, 1]]
    )

    def camera(angle: float) -> Camera:
        forward = np.array([-np.cos(angle), -np.sin(angle), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        rotation = np.stack([np.cross(down, forward), down, forward])
        center = np.asarray(target) - distance * forward
        return Camera.from_pose(intrinsics, rotation, -rotation @ center, image_size)

    half = np.radians(angle_deg) / 2
    return StereoRig(camera(-half), camera(half))


def silhouette(backbone: Backbone, radius: float, camera: Camera) -> npt.NDArray[np.bool_]:
    """Mask, (height, width), of a tube with rounded ends as a camera sees it.

    The tube is the union of spheres along the curve; each covers the pixels within its
    projected radius, which holds to second order in radius over depth.
    """
    width, height = camera.image_size
    step = 0.25 * float(camera.pixel_size(backbone.sample(50)).min())
    points = backbone.sample(int(np.ceil(backbone.length / step)) + 1)
    points = points[camera.depth(points) > 0]
    mask = np.zeros((height, width), dtype=bool)
    if len(points) == 0:
        return mask
    center, reach = camera.project(points), radius / camera.pixel_size(points)
    margin = reach.max() + 1
    low = np.clip(np.floor(center.min(axis=0) - margin), 0, [width, height]).astype(int)
    high = np.clip(np.ceil(center.max(axis=0) + margin) + 1, 0, [width, height]).astype(int)
    x, y = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
    if x.size == 0:
        return mask
    distance, nearest = cKDTree(center).query(np.column_stack([x.ravel(), y.ravel()]))
    mask[low[1] : high[1], low[0] : high[0]] = (distance <= reach[nearest]).reshape(x.shape)
    return mask


def painted_bands(backbone: Backbone, count: int, share: float = 0.25) -> list[Backbone]:
    """Equal sections of a curve whose silhouettes are the bands of a device painted with them.

    Parameters
    ----------
    backbone : Backbone
    count : int
        Bands; their middles lie half a pitch from either end, and a pitch apart.
    share : float
        Of the pitch that is painted.

    Examples
    --------
    >>> bands = painted_bands(Backbone.through([[0, 0, 0], [0, 0, 40]]), count=4)
    >>> [round(float(band(band.length / 2)[2]), 6) for band in bands]
    [5.0, 15.0, 25.0, 35.0]
    """
    pitch = backbone.length / count
    middles = pitch * (np.arange(count) + 0.5)
    half = share * pitch / 2
    return [backbone.between(float(s - half), float(s + half)) for s in middles]


def observe(backbone: Backbone, radius: float, rig: StereoRig, time: float = 0.0) -> Observation:
    """Both silhouettes of a tube as one observation."""
    mask_a, mask_b = (silhouette(backbone, radius, camera) for camera in (rig.a, rig.b))
    return Observation.from_masks(mask_a, mask_b, rig, time=time)
