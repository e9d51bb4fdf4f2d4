"""The mock-up of the paper's Section III and its two cameras, photographed by VTK.

The pictures come from a renderer of their own, not from the core's projector, so that an
error of the core's camera cannot hide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom.synthetic import growing_helix

from ..errors import require
from ..offscreen import prepare

pv = require("pyvista", "vtk")
vtk_math = require("vtkmodules.vtkCommonMath", "vtk")

# Section III: 6.4 mm thick, 239 mm along the curve, 150 mm along z.
RADIUS, LENGTH, HEIGHT = 3.2, 239.0, 150.0
# The stage turns the mock-up about z, which lies level; x points up to the cameras.
AXIS, UP = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
# 8-bit grays of the matte white felt, the gray plastic, and painted bands.
FELT, PLASTIC, PAINT = 225, 120, 25

Gray = npt.NDArray[np.uint8]
Bands = Sequence[tuple[float, float]]


def backbone() -> Backbone:
    """The mock-up at rest: a polynomial of degree 6 from the origin, mm."""
    return growing_helix(LENGTH, HEIGHT)


def overhead_rig(
    convergence_deg: float = 45.0, distance: float = 700.0, focal_length: float = 2400.0
) -> StereoRig:
    """Two Sony XCD-X710 on a truss over the mock-up, looking down at its middle.

    The camera has 1024 × 768 square pixels of 4.65 µm; the paper names no lens. 2400 px are
    11.2 mm, and from 700 mm a pixel spans 0.29 mm: the mock-up then fills as many pixels as
    in the paper's Figure 5. As there, its axis runs along the pictures' rows in both views,
    so the cameras stand apart across the axis.

    Parameters
    ----------
    convergence_deg : float
        Between the two viewing axes; not given in the paper, which says "not orthogonal".
    distance : float
        From each camera to the middle of the mock-up, mm.
    focal_length : float
        Pixels.
    """
    size = (1024, 768)
    intrinsics = [
        [focal_length, 0, (size[0] - 1) / 2],
        [0, focal_length, (size[1] - 1) / 2],
        [0, 0, 1],
    ]
    target = HEIGHT / 2 * AXIS

    def camera(angle: float) -> Camera:
        forward = np.array([-np.cos(angle), -np.sin(angle), 0.0])
        rotation = np.stack([AXIS, np.cross(forward, AXIS), forward])
        return Camera.from_pose(
            intrinsics, rotation, -rotation @ (target - distance * forward), size
        )

    half = np.radians(convergence_deg) / 2
    return StereoRig(camera(-half), camera(half))


@dataclass(frozen=True, eq=False)
class Pose:
    """Where the stage has brought the mock-up: x → R x + t, mm."""

    rotation: Floats
    translation: Floats

    def of(self, curve: Backbone) -> Backbone:
        """The curve in this pose."""
        return curve.transformed(self.rotation, self.translation)


def poses(count: int = 20, seed: int = 2010, reach: float = 15.0) -> list[Pose]:
    """Seeded poses: any turn about the base axis, and up to `reach` mm along each axis."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        angle = rng.uniform(0, 2 * np.pi)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
        made.append(Pose(turn, rng.uniform(-reach, reach, 3)))
    return made


# ---- pictures ------------------------------------------------------------------------


def photograph(
    curve: Backbone,
    radius: float,
    camera: Camera,
    *,
    seed: int,
    bands: Bands = (),
    blur_px: float = 0.7,
    noise: float = 2.0,
) -> Gray:
    """What the camera's 8-bit sensor gives of the tube: blurred by the lens, and noisy.

    Parameters
    ----------
    curve, radius, camera, bands
        As in `render_tube`.
    seed : int
        Of the noise.
    blur_px : float
        Standard deviation of the lens's point spread, px.
    noise : float
        Standard deviation of each pixel, gray levels.

    Returns
    -------
    (rows, columns) array of uint8
    """
    clean = render_tube(curve, radius, camera, bands=bands).astype(float)
    seen = gaussian_filter(clean, blur_px, mode="nearest")
    seen += np.random.default_rng(seed).normal(0.0, noise, seen.shape)
    return np.clip(np.round(seen), 0, 255).astype(np.uint8)


def render_tube(
    curve: Backbone,
    radius: float,
    camera: Camera,
    *,
    bands: Bands = (),
    gray: int = PLASTIC,
    paint: int = PAINT,
    background: int = FELT,
    light: Floats | None = UP,
    oversampling: int = 3,
    smoothed: bool = True,
) -> Gray:
    """Render a matte tube with flat ends before an even background.

    Parameters
    ----------
    curve : Backbone
    radius : float
        Millimetres.
    camera : Camera
        Any, also one that mirrors.
    bands : sequence of (float, float)
        Stretches of arc length, mm, that are painted.
    gray, paint, background : int
        0 to 255, of the tube, its bands and the background, where light falls straight.
    light : (3,) array, optional
        World direction towards a distant lamp. None: the lamp is at the camera.
    oversampling : int
        Rays across a pixel, each way.
    smoothed : bool
        As in `render`.

    Returns
    -------
    (rows, columns) array of uint8
    """
    sides, ends = tube_mesh(curve, radius, bands, gray, paint)
    style: dict[str, Any] = {
        "scalars": "gray",
        "rgb": True,
        "ambient": 0.45,
        "diffuse": 0.55,
        "specular": 0.0,
    }

    def fill(plotter: Any) -> None:
        towards = camera.center - curve(curve.length / 2) if light is None else light
        lamp = pv.Light(light_type="scene light")
        lamp.positional = False
        lamp.position, lamp.focal_point = tuple(towards), (0.0, 0.0, 0.0)
        plotter.add_light(lamp)
        plotter.add_mesh(sides, smooth_shading=False, interpolation="Gouraud", **style)
        plotter.add_mesh(ends, interpolation="Flat", **style)

    return render(camera, fill, background=background, oversampling=oversampling, smoothed=smoothed)


def render(
    camera: Camera, fill: Any, *, background: int, oversampling: int = 3, smoothed: bool = True
) -> Gray:
    """Render what `fill(plotter)` adds as a camera sees it.

    Parameters
    ----------
    camera : Camera
    fill : callable
        Adds meshes and lights to a pyvista plotter.
    background : int
        Gray, 0 to 255.
    oversampling : int
        Rays across a pixel, each way: their mean is the pixel.
    smoothed : bool
        Whether the graphics library smooths edges besides. It draws a dark thing thinner by some
        0.05 px on either side, so masks that are measured are better without.

    Returns
    -------
    (rows, columns) array of uint8
    """
    prepare()
    width, height = camera.image_size
    size = [width * oversampling, height * oversampling]
    plotter = pv.Plotter(off_screen=True, window_size=size, lighting="none")
    try:
        if not smoothed:
            plotter.render_window.SetMultiSamples(0)
        plotter.set_background([background] * 3)
        fill(plotter)
        # The first picture sets the camera up by its own rules; ours must come after.
        plotter.render()
        point_camera(plotter.camera, camera, _depths(plotter.bounds, camera))
        fine = np.asarray(plotter.screenshot(return_img=True))[:, :, 0].astype(float)
    finally:
        plotter.close()
    blocks = fine.reshape(height, oversampling, width, oversampling)
    return np.asarray(np.round(blocks.mean(axis=(1, 3))).astype(np.uint8))


def point_camera(eye: Any, camera: Camera, depths: tuple[float, float]) -> None:
    """Give a vtkCamera the projection of a `Camera`, principal point, skew and all.

    VTK sees x right, y up and looks along −z, in clip coordinates from −1 to 1 over the
    picture's outer border; pixel (0, 0) has its centre half a pixel inside of it.

    Parameters
    ----------
    eye : vtkCamera
    camera : Camera
    depths : (float, float)
        Nearest and farthest depth to be seen, mm.
    """
    width, height = camera.image_size
    near, far = depths
    forward = camera.axis
    down = camera.projection[1, :3] - (camera.projection[1, :3] @ forward) * forward
    eye.SetPosition(*camera.center)
    eye.SetFocalPoint(*(camera.center + forward))
    eye.SetViewUp(*(-down / np.linalg.norm(down)))
    view = eye.GetViewTransformMatrix()
    turn = np.array([[view.GetElement(i, j) for j in range(3)] for i in range(3)])
    x, y, depth = camera.projection[:, :3] @ turn.T  # homogeneous pixels from VTK's view axes
    clip = np.zeros((4, 4))
    clip[0, :3] = 2 / width * (x + 0.5 * depth) - depth
    clip[1, :3] = depth - 2 / height * (y + 0.5 * depth)
    clip[2, :3] = (far + near) / (far - near) * depth
    clip[2, 3] = -2 * far * near / (far - near)
    clip[3, :3] = depth
    matrix = vtk_math.vtkMatrix4x4()
    matrix.DeepCopy(clip.ravel())
    eye.SetExplicitProjectionTransformMatrix(matrix)
    eye.UseExplicitProjectionTransformMatrixOn()


def tube_mesh(
    curve: Backbone, radius: float, bands: Bands = (), gray: int = PLASTIC, paint: int = PAINT
) -> tuple[Any, Any]:
    """The side of a tube, and its two flat ends, as pyvista meshes.

    Cells hold `gray` (RGB, uint8); the points of the side hold the true surface's normals.
    Rings stand every 0.5 mm or less, and exactly where a band begins or ends.
    """
    around = 64
    marks = np.clip(np.ravel(bands), 0, curve.length)
    s = np.unique(np.concatenate([curve.arc_lengths(int(2 * curve.length) + 2), marks]))
    frames, angle = curve.frames(s), np.linspace(0, 2 * np.pi, around, endpoint=False)
    normals = (
        np.cos(angle)[:, None] * frames[:, None, 1] + np.sin(angle)[:, None] * frames[:, None, 2]
    )
    rings = curve(s)[:, None] + radius * normals
    index = np.arange(rings.shape[0] * around).reshape(-1, around)
    onward = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], onward[:-1], onward[1:], index[1:]], axis=-1).reshape(-1, 4)
    sides = pv.PolyData(rings.reshape(-1, 3), np.insert(quads, 0, 4, axis=1).ravel())
    sides.point_data.active_normals = normals.reshape(-1, 3)
    middle = (s[:-1] + s[1:]) / 2
    painted = np.any([(middle > low) & (middle < high) for low, high in bands], axis=0)
    painted = np.broadcast_to(painted, middle.shape)
    sides.cell_data["gray"] = _rgb(np.repeat(np.where(painted, paint, gray), around))
    faces = np.concatenate(
        [[around], np.arange(around)[::-1], [around], np.arange(around) + around]
    )
    ends = pv.PolyData(rings[[0, -1]].reshape(-1, 3), faces)
    ends.cell_data["gray"] = _rgb(np.where(painted[[0, -1]], paint, gray))
    return sides, ends


def _rgb(gray: Any) -> Gray:
    return np.repeat(np.asarray(gray, dtype=np.uint8)[:, None], 3, axis=1)


def _depths(bounds: Sequence[float], camera: Camera) -> tuple[float, float]:
    """Depths between which a box lies, with room, mm."""
    corners = np.stack(np.meshgrid(bounds[:2], bounds[2:4], bounds[4:]), axis=-1).reshape(-1, 3)
    depth = camera.depth(corners)
    return max(0.5 * float(depth.min()), 0.01 * float(depth.max())), 1.5 * float(depth.max())
