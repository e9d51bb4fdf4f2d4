"""`StereoRig`: two cameras together; triangulation and epipolar geometry."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from ..arrays import Floats
from .projection import Camera

Frame = Literal["patient_lps", "isocenter_lps", "camera_a", "world"]


@dataclass(frozen=True, eq=False)
class StereoRig:
    """The two cameras together, in one world frame.

    Parameters
    ----------
    a, b : Camera
        DICOM planes A and B, or left and right eye.
    frame : {'world', 'patient_lps', 'isocenter_lps', 'camera_a'}
        Which axes the world has.

    Raises
    ------
    ValueError
        Where both cameras stand in one place: two such views hold no depth.

    Examples
    --------
    Two cameras 1000 mm from the origin, one on the x axis and one on the y axis:

    >>> k, size = [[1000, 0, 320], [0, 1000, 240], [0, 0, 1]], (640, 480)
    >>> on_x = Camera.from_pose(k, [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], [0, 0, 1000], size)
    >>> on_y = Camera.from_pose(k, [[-1, 0, 0], [0, 0, -1], [0, -1, 0]], [0, 0, 1000], size)
    >>> rig = StereoRig(on_x, on_y)
    >>> round(rig.baseline, 2), round(rig.convergence_deg, 6)
    (1414.21, 90.0)
    """

    a: Camera
    b: Camera
    frame: Frame = "world"

    def __post_init__(self) -> None:
        if self.frame not in get_args(Frame):
            raise ValueError(f"frame: {self.frame!r} is not one of {', '.join(get_args(Frame))}")
        reach = max(np.abs(self.a.center).max(), np.abs(self.b.center).max(), 1.0)
        if self.baseline < 1e-6 * reach:
            raise ValueError(
                "rig: both cameras stand in the same place, so the views hold no depth; "
                "give the geometry of two different views"
            )

    @classmethod
    def from_projections(
        cls,
        projection_a: Any,
        projection_b: Any,
        size_a: tuple[int, int],
        size_b: tuple[int, int],
        frame: Frame = "world",
    ) -> StereoRig:
        """Make a rig of two matrices whose signs may be arbitrary.

        A matrix from a file and its negative describe the same picture. Taken are the signs
        that put the field that both views share in front of both cameras; where the given
        signs do that, they stay.
        """
        a, b = Camera(projection_a, size_a), Camera(projection_b, size_b)
        candidates = [
            cls(Camera(sign_a * a.projection, size_a), Camera(sign_b * b.projection, size_b), frame)
            for sign_a, sign_b in ((1, 1), (-1, -1), (1, -1), (-1, 1))
        ]
        shared = [_shared_field(rig) for rig in candidates]
        # Parallel views share as much behind as in front: only clearly more outweighs the given.
        best = int(np.argmax(shared))
        return candidates[best] if shared[best] > 1.5 * shared[0] else candidates[0]

    @cached_property
    def baseline(self) -> float:
        """Distance between the two camera centres, mm."""
        return float(np.linalg.norm(self.b.center - self.a.center))

    @cached_property
    def convergence_deg(self) -> float:
        """Angle between the two viewing axes, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.a.axis @ self.b.axis, -1, 1))))

    @cached_property
    def fundamental(self) -> Floats:
        """Fundamental matrix F, (3, 3): x_bᵀ F x_a = 0 for two pictures of one point.

        Scaled so that x_bᵀ F x_a is t·(d_a × d_b) for the unit baseline t and rays d of
        depth 1: about the gap between the rays over their depth.
        """
        t = (self.b.center - self.a.center) / self.baseline
        cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
        return np.asarray(self.b.pixel_to_ray.T @ cross @ self.a.pixel_to_ray)

    def epipolar_angle(self, camera: Camera, pixels: Any) -> Floats:
        """Angle of the epipolar plane through each pixel, about the baseline, (n,), rad.

        Pixels of the two views that show one point have the same angle; zero lies between
        the two viewing axes.

        Parameters
        ----------
        camera : Camera
            `rig.a` or `rig.b`, whichever the pixels belong to.
        pixels : (n, 2) array
        """
        forms = np.stack(self._epipolar_axes) @ camera.pixel_to_ray
        x, y = np.asarray(pixels, dtype=float).T  # an angle asks for no rays of unit length
        forward, up = (by_x * x + by_y * y + rest for by_x, by_y, rest in forms)
        return np.asarray(np.arctan2(up, forward))

    def epipolar_line(self, camera: Camera, angle: float) -> Floats:
        """Line l, (3,), in a view that shows the epipolar plane at `angle` (rad).

        l·(x, y, 1) is zero on the line and positive on the side of larger angles.
        """
        forward, up = self._epipolar_axes
        normal = np.cos(angle) * up - np.sin(angle) * forward
        return np.asarray(camera.pixel_to_ray.T @ normal)

    @cached_property
    def _epipolar_axes(self) -> tuple[Floats, Floats]:
        t = (self.b.center - self.a.center) / self.baseline
        forward = self.a.axis + self.b.axis
        forward = forward - (forward @ t) * t
        if np.linalg.norm(forward) < 1e-9:  # both look along the baseline: any direction serves
            forward = np.cross(t, np.eye(3)[np.argmin(np.abs(t))])
        forward = forward / np.linalg.norm(forward)
        return forward, np.cross(t, forward)


def triangulate(rig: StereoRig, pixels_a: Any, pixels_b: Any) -> Floats:
    """Points in space that are closest to both rays of each pixel pair.

    Parameters
    ----------
    rig : StereoRig
    pixels_a, pixels_b : (n, 2) array
        Corresponding pixels of view a and view b.

    Returns
    -------
    (n, 3) array
        World points, mm: the middle of the shortest connection of the two rays
        (Hartley and Zisserman, 12.1, "mid-point method").

    Raises
    ------
    ValueError
        Where two rays are parallel.

    Examples
    --------
    >>> k, size = [[1000, 0, 320], [0, 1000, 240], [0, 0, 1]], (640, 480)
    >>> left = Camera.from_pose(k, np.eye(3), [0, 0, 0], size)
    >>> right = Camera.from_pose(k, np.eye(3), [-5, 0, 0], size)
    >>> triangulate(StereoRig(left, right), [[320, 240]], [[270, 240]]).round(9)  # 5·1000/50
    array([[  0.,   0., 100.]])
    """
    to_a, to_b = rig.a.rays(pixels_a), rig.b.rays(pixels_b)
    between = rig.b.center - rig.a.center
    cosine = np.sum(to_a * to_b, axis=1)
    sine_squared = np.sum(np.cross(to_a, to_b) ** 2, axis=1)
    if np.any(sine_squared < 1e-16):
        raise ValueError("triangulate: two rays are parallel, so they meet nowhere")
    along_a, along_b = to_a @ between, to_b @ between
    reach_a = (along_a - cosine * along_b) / sine_squared
    reach_b = (cosine * along_a - along_b) / sine_squared
    on_a = rig.a.center + reach_a[:, None] * to_a
    on_b = rig.b.center + reach_b[:, None] * to_b
    return np.asarray((on_a + on_b) / 2)


def _shared_field(rig: StereoRig) -> int:
    """Of a grid of points in front of camera a, how many does camera b see before it?"""
    (width, height), (width_b, height_b) = rig.a.image_size, rig.b.image_size
    x, y = np.meshgrid(np.linspace(0, width - 1, 5), np.linspace(0, height - 1, 5))
    rays = rig.a.rays(np.column_stack([x.ravel(), y.ravel()]))
    reach = rig.baseline * np.geomspace(0.1, 20, 40)
    points = (rig.a.center + reach[:, None, None] * rays).reshape(-1, 3)
    points = points[rig.b.depth(points) > 0]
    if len(points) == 0:
        return 0
    pixels = rig.b.project(points)
    inside = np.all((pixels > -0.5) & (pixels < [width_b - 0.5, height_b - 0.5]), axis=1)
    return int(inside.sum())
