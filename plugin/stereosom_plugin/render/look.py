"""Where a picture is taken from: the views themselves, between them, or the device's best side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera, StereoRig
from stereosom.observation import picture_border

from .style import letter_height

# Lines of small words above and below the part that things in space fill, and the share of the
# width that is left empty on each side.
_ABOVE, _BELOW, _BESIDE = 9.0, 6.0, 0.06
# Below this angle the two views stand side by side, and are seen from aside.
NARROW_DEG = 45.0


@dataclass(frozen=True, eq=False)
class Look:
    """A picture's own camera: central or parallel projection onto an upright rectangle.

    Parameters
    ----------
    position : (3,) array
        Of the eye, mm.
    towards, up : (3,) arrays
        Unit vectors, at right angles.
    half : float
        Half of what the height of the picture spans: as a tangent, or in mm where parallel.
    shift : (float, float)
        What the middle of the picture shows, right and up of `towards`; in the same unit.
    parallel : bool
    mirrored : bool
        Left and right are exchanged after the picture is taken: an X-ray picture is seen from
        behind its detector.
    upright : (3,) array, optional
        Unit vector about which the eye is led around. Default: `up`.
    """

    position: Floats
    towards: Floats
    up: Floats
    half: float
    shift: tuple[float, float] = (0.0, 0.0)
    parallel: bool = False
    mirrored: bool = False
    upright: Floats | None = None

    @property
    def axes(self) -> Floats:
        """Right, up and towards as columns, (3, 3)."""
        return np.column_stack([np.cross(self.towards, self.up), self.up, self.towards])

    def project(self, points: Floats, size: tuple[int, int]) -> Floats:
        """Pixels (x right, y down) of (n, 3) points in a picture of (width, height), (n, 2)."""
        x, y, _ = self._flat(points).T
        width, height = size
        per_pixel = 2 * self.half / height
        across = (x - self.shift[0]) / per_pixel
        across = -across if self.mirrored else across
        return np.column_stack(
            [(width - 1) / 2 + across, (height - 1) / 2 - (y - self.shift[1]) / per_pixel]
        )

    def pixels_per_mm(self, point: Floats, height: int) -> float:
        """How many pixels a millimetre across the line of sight takes at a point (3,)."""
        depth = 1.0 if self.parallel else self._flat(point[None])[0, 2]
        return float(height / (2 * self.half * depth))

    def fitted(self, points: Floats, size: tuple[int, int]) -> Look:
        """The same eye, with (n, 3) points filling the free part of a picture of a size."""
        x, y, _ = self._flat(points).T
        left, top, right, bottom = free_part(size)
        aspect = size[0] / size[1]
        half = max(
            np.ptp(x) / aspect / (2 * (right - left)), np.ptp(y) / (2 * (bottom - top)), 1e-9
        )
        # Where the free part's own middle lies, seen from the middle of the picture.
        off_x = (left + right - 1) * half * aspect * (-1 if self.mirrored else 1)
        off_y = (1 - top - bottom) * half
        middle = ((x.min() + x.max()) / 2 - off_x, (y.min() + y.max()) / 2 - off_y)
        return replace(self, half=float(half), shift=(float(middle[0]), float(middle[1])))

    def turned(self, angle_deg: float, pivot: Floats) -> Look:
        """The eye led around a point (3,), about the upright through it."""
        turn = _turn(self.up if self.upright is None else self.upright, angle_deg)
        position = pivot + turn @ (self.position - pivot)
        return replace(self, position=position, towards=turn @ self.towards, up=turn @ self.up)

    def all_around(self, points: Floats, pivot: Floats) -> Floats:
        """All places, seen from the eye, that (n, 3) points take as it is led around."""
        axis = self.up if self.upright is None else self.upright
        turns = [_turn(axis, angle) for angle in range(0, 360, 10)]
        return np.vstack([pivot + (points - pivot) @ turn.T for turn in turns])

    def aim(self, plotter: Any) -> None:
        """Set pyvista's camera so."""
        camera = plotter.camera
        camera.position, camera.up = self.position, self.up
        camera.focal_point = self.position + self.towards
        camera.parallel_projection = self.parallel
        if self.parallel:
            camera.parallel_scale = self.half
        else:
            camera.view_angle = 2 * np.degrees(np.arctan(self.half))
        aspect = plotter.window_size[0] / plotter.window_size[1]
        camera.SetWindowCenter(self.shift[0] / (self.half * aspect), self.shift[1] / self.half)
        plotter.renderer.reset_camera_clipping_range()

    def _flat(self, points: Floats) -> Floats:
        local = (points - self.position) @ self.axes
        if not self.parallel:
            local[:, :2] /= local[:, 2:]
        return np.asarray(local)


def free_part(size: tuple[int, int]) -> tuple[float, float, float, float]:
    """The part of a picture that has no words: left, top, right, bottom, as shares of its sides.

    Examples
    --------
    >>> free_part((1600, 1200))
    (0.06, 0.18, 0.94, 0.88)
    """
    line = letter_height(size) / size[1]
    # A picture that words would fill is shared half and half.
    top, below = min(_ABOVE * line, 0.35), min(_BELOW * line, 0.2)
    return (_BESIDE, top, 1 - _BESIDE, 1 - below)


def from_view(camera: Camera) -> Look:
    """See what a view sees, as its picture shows it: the pictures fall on each other exactly."""
    towards = camera.axis
    down = camera.pixel_to_ray[:, 1]
    up = _unit((down @ towards) * towards - down)
    mirrored = bool(np.cross(towards, up) @ camera.pixel_to_ray[:, 0] < 0)
    return Look(camera.center, towards, up, half=1.0, mirrored=mirrored)


def between_views(rig: StereoRig | None, points: Floats) -> Look:
    """Look from between the sources, a little above, at (n, 3) points."""
    towards, up, upright = _overview_axes(rig)
    # From four times their extent things keep their shape, and still show their depth.
    position = _middle(points) - 4 * extent(points) * towards
    return Look(position, towards, up, half=1.0, upright=upright)


def best_side(rig: StereoRig | None, points: Floats) -> Look:
    """Look squarely at the plane in which (n, 3) points spread most, without perspective.

    Of its two sides, the one that is nearer to the sources.
    """
    towards, up, _ = _overview_axes(rig)
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if spread[1] > 1e-3 * spread[0]:
        normal = axes[2] * (1 if axes[2] @ towards >= 0 else -1)
    else:  # straight: any side is as good, so the usual one
        normal = towards - (towards @ axes[0]) * axes[0]
        normal = normal if np.linalg.norm(normal) > 1e-6 else np.cross(axes[0], up)
    normal = _unit(normal)
    upright = up - (up @ normal) * normal
    upright = upright if np.linalg.norm(upright) > 0.2 else axes[0] - (axes[0] @ normal) * normal
    position = _middle(points) - 4 * extent(points) * normal
    return Look(position, normal, _unit(upright), half=1.0, parallel=True)


def extent(points: Floats) -> float:
    """Diagonal of the box about (n, 3) points, mm."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def picture_corners(camera: Camera, depth: float) -> Floats:
    """Where the rays of a picture's corners reach a depth (mm): (4, 3), from top left."""
    return slid(camera, picture_border(camera), depth)


def slid(camera: Camera, pixels: Floats, depth: float) -> Floats:
    """Where the rays of (n, 2) pixels reach a depth, (n, 3), mm."""
    rays = camera.rays(pixels)
    return np.asarray(camera.center + rays * (depth / (rays @ camera.axis))[:, None])


def _overview_axes(rig: StereoRig | None) -> tuple[Floats, Floats, Floats]:
    """Where to look, what is up there, and what is upright in the world: unit vectors."""
    if rig is None:  # patients are drawn head up, from in front and a little aside
        towards = _unit(np.array([0.6, 0.8, -0.35]))
        head = np.array([0.0, 0.0, 1.0])
        return towards, _upright(head, towards), head
    towards = rig.a.axis + rig.b.axis
    # Views that face each other have no between.
    towards = rig.a.axis if np.linalg.norm(towards) < 1e-3 else _unit(towards)
    # A picture's y axis points down: its opposite is what the observers call up.
    up = -_upright(_unit(rig.a.pixel_to_ray[:, 1]), towards)
    if rig.convergence_deg < NARROW_DEG:
        towards = 0.6 * towards + 0.8 * np.cross(towards, up)
    towards = _unit(towards - 0.35 * up)
    return towards, _upright(up, towards), up


def _upright(up: Floats, towards: Floats) -> Floats:
    """What of `up` is at right angles to `towards`, of unit length."""
    rest = up - (up @ towards) * towards
    if np.linalg.norm(rest) < 1e-3:
        rest = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))])
    return _unit(rest)


def _middle(points: Floats) -> Floats:
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _turn(axis: Floats, angle_deg: float) -> Floats:
    """Rotation about a unit vector (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(angle_deg)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
