"""Pictures without a screen: the backbone in space between its views, and over each view."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom.observation import picture_border
from stereosom.reconstruction import Reconstruction

from .acquisition import Image
from .errors import require
from .files import write_whole
from .offscreen import prepare
from .polydata import Centerline, to_centerline

pv = require("pyvista", "vtk")

# Blue and orange of the Okabe-Ito palette: told apart with any color vision.
VIEW_COLORS = {"a": "#0072B2", "b": "#D55E00"}
_BACKGROUND, _INK, _SHEET = "#f7f8fa", "#22262b", "#e4e7ec"
_TITLES = {"Curvature": "curvature (1/mm)", "StandardDeviation": "standard deviation (mm)"}
# Below this angle the two pictures stand one behind the other and are seen from the side.
_NARROW_DEG = 25.0


def scene(
    result: Reconstruction | Centerline,
    rig: StereoRig,
    path: str | Path,
    images: tuple[Image, Image] | None = None,
    *,
    color_by: str = "Curvature",
    size: tuple[int, int] = (1600, 1200),
) -> None:
    """Write a picture of the device in space, before the two pictures that show it.

    Each picture is slid along its rays from where it was taken to just behind the device, so
    that seen from its source (X-ray focus, pinhole) it still covers the device exactly.

    Parameters
    ----------
    result : Reconstruction or Centerline
        One with a backbone.
    rig : StereoRig
    path : path
        A `.png`, written whole or not at all.
    images : pair of arrays, optional
        Pictures of view a and view b, (rows, columns) or (rows, columns, 3), free of lens
        distortion. Default: empty sheets.
    color_by : {'Curvature', 'StandardDeviation'}
        What colors the device.
    size : (int, int)
        Width and height, px.

    Raises
    ------
    InputError
        Where nothing can be rendered, or the file cannot be written.
    """
    prepare()
    line = to_centerline(result, samples=400) if isinstance(result, Reconstruction) else result
    plotter = pv.Plotter(off_screen=True, window_size=list(size))
    try:
        plotter.set_background(_BACKGROUND)
        plotter.enable_anti_aliasing("ssaa")
        extent = float(np.linalg.norm(np.ptp(line.points, axis=0)))
        _add_device(plotter, line, extent, color_by, size[1])
        quads = _picture_quads(line.points, rig)
        for view, quad, camera, image in zip(
            "ab", quads, (rig.a, rig.b), images or (None, None), strict=True
        ):
            _add_picture(plotter, view, quad, camera, image, line.points, extent)
        _add_words(plotter, line, rig, size[1])
        _look(plotter, rig, np.vstack([line.points, *(quad.points for quad in quads)]))
        with write_whole(path) as part:
            plotter.screenshot(part)
    finally:
        plotter.close()


def overlay(
    image: Image,
    backbone: Backbone,
    camera: Camera,
    path: str | Path,
    *,
    color: str = VIEW_COLORS["a"],
) -> None:
    """Write one view with the projected centerline, its base (round) and tip (diamond).

    Parameters
    ----------
    image : (rows, columns) or (rows, columns, 3) array
        Free of lens distortion. Shown between its 1st and 99th percentile.
    backbone : Backbone
    camera : Camera
    path : path
        A `.png`, written whole or not at all. The picture fills it, enlarged by a whole
        factor where it is small.
    color : str
        Of the line.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    # Matplotlib comes with pyvista; its Agg canvas needs no screen and no global state.
    agg = require("matplotlib.backends.backend_agg", "vtk")
    figures, effects = (require(f"matplotlib.{name}", "vtk") for name in ("figure", "patheffects"))
    picture = stretched(image)
    height, width = picture.shape[:2]
    factor = max(1, round(1000 / max(height, width)))
    figure = figures.Figure(figsize=(width * factor / 100, height * factor / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(picture, interpolation="nearest")
    x, y = camera.project(backbone.sample(400)).T
    # A light rim keeps the line readable on any background.
    rim = [effects.withStroke(linewidth=4.5, foreground="white", alpha=0.7)]
    axes.plot(x, y, color=color, linewidth=2, solid_capstyle="round", path_effects=rim)
    for at, marker in ((0, "o"), (-1, "D")):
        axes.plot(x[at], y[at], marker, ms=10, mfc="white", mec=color, mew=2.5)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    axes.axis("off")
    with write_whole(path) as part:
        agg.FigureCanvasAgg(figure).print_png(part)


def stretched(image: Image) -> npt.NDArray[np.uint8]:
    """Picture as (rows, columns, 3) bytes, its 1st to 99th percentile from black to white."""
    picture = np.asarray(image, dtype=float)
    if picture.ndim == 2:
        picture = picture[:, :, None]
    low, high = np.nanpercentile(picture, [1, 99])
    if high <= low:  # a mask of a thin device: all but one percent is background
        low, high = np.nanmin(picture), np.nanmax(picture)
    share = np.nan_to_num((picture - low) / max(high - low, 1e-12))
    return np.broadcast_to(np.round(255 * np.clip(share, 0, 1)), (*picture.shape[:2], 3)).astype(
        np.uint8
    )


# ---- the pictures in space -----------------------------------------------------------


def picture_quad(camera: Camera, depth: float) -> Any:
    """The camera's picture slid along its rays to a depth (mm), as a textured quad.

    Returns
    -------
    pyvista.PolyData
        Four corners, with texture coordinates (0, 0) at the picture's bottom left and (1, 1)
        at its top right, whichever way the projection mirrors.
    """
    corners = picture_border(camera)  # top left, top right, bottom right, bottom left
    quad = pv.PolyData(slid(camera, corners, depth), faces=[4, 0, 1, 2, 3])
    quad.active_texture_coordinates = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=float)
    return quad


def slid(camera: Camera, pixels: Floats, depth: float) -> Floats:
    """Where the rays of (n, 2) pixels reach a depth, (n, 3), mm."""
    rays = camera.rays(pixels)
    return np.asarray(camera.center + rays * (depth / (rays @ camera.axis))[:, None])


def _picture_quads(points: Floats, rig: StereoRig) -> tuple[Any, Any]:
    """Both pictures behind the device, far enough that neither cuts through the other."""
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    nearest = [float(camera.depth(points).max()) + 0.05 * extent for camera in (rig.a, rig.b)]
    narrow = rig.convergence_deg < _NARROW_DEG
    for gap in extent * np.arange(0, 5, 0.05):
        depth_a, depth_b = nearest[0] + (0 if narrow else gap), nearest[1] + gap
        quad_a, quad_b = picture_quad(rig.a, depth_a), picture_quad(rig.b, depth_b)
        past_b = rig.b.depth(quad_a.points) - depth_b
        past_a = rig.a.depth(quad_b.points) - depth_a
        if narrow and past_a.min() > 0.2 * extent:
            break
        if not narrow and (past_a.max() < 0 or past_b.max() < 0):
            break
    return quad_a, quad_b


def _add_picture(
    plotter: Any,
    view: str,
    quad: Any,
    camera: Camera,
    image: Image | None,
    points: Floats,
    extent: float,
) -> None:
    color = VIEW_COLORS[view]
    if image is None:
        plotter.add_mesh(quad, color=_SHEET, lighting=False)
    else:
        texture = pv.Texture(stretched(image))
        texture.interpolate = texture.mipmap = True
        plotter.add_mesh(quad, texture=texture, lighting=False)
    plotter.add_mesh(_polyline(quad.points[[0, 1, 2, 3, 0]]), color=color, line_width=3)
    # A hair before the picture, or the two would fight for the same depth.
    depth = float(camera.depth(quad.points).mean()) - 0.004 * extent
    shadow = slid(camera, camera.project(points), depth)
    plotter.add_mesh(_polyline(shadow), color=color, line_width=4)
    for end in (0, -1):
        ray = _polyline(np.array([points[end], shadow[end]]))
        plotter.add_mesh(ray, color=color, line_width=1.5, opacity=0.6)


# ---- the rest of the scene -----------------------------------------------------------


def _add_device(plotter: Any, line: Centerline, extent: float, color_by: str, height: int) -> None:
    tube = _polyline(line.points)
    values = line.arrays.get(color_by)
    if values is not None:
        tube[color_by] = values
    radius = float(np.median(line.arrays.get("Radius", [0.005 * extent])))
    tube = tube.tube(radius=radius, n_sides=32, capping=True)
    plotter.add_mesh(
        tube,
        scalars=None if values is None else color_by,
        color=None if values is not None else _INK,
        cmap="viridis",
        smooth_shading=True,
        specular=0.3,
        scalar_bar_args={
            "title": _TITLES.get(color_by, color_by),
            "color": _INK,
            "vertical": False,
            "position_x": 0.62,
            "position_y": 0.04,
            "width": 0.34,
            "height": 0.07,
            "title_font_size": height // 48,
            "label_font_size": height // 56,
            "n_labels": 3,
            "fmt": "%.2g",
        },
    )
    for end in (0, -1):
        ball = pv.Sphere(radius=1.6 * radius, center=line.points[end])
        plotter.add_mesh(ball, color=_INK if end else "white", specular=0.3)
    plotter.show_bounds(
        mesh=tube,
        grid="back",
        location="outer",
        xtitle="x (mm)",
        ytitle="y (mm)",
        ztitle="z (mm)",
        n_xlabels=3,
        n_ylabels=3,
        n_zlabels=5,
        fmt="%.0f",
        color="#7a828c",
        font_size=height // 70,
        bold=False,
    )


def _add_words(plotter: Any, line: Centerline, rig: StereoRig, height: int) -> None:
    words = [f"length {line.backbone.length:.1f} mm"]
    if "StandardDeviation" in line.arrays:
        spread = line.arrays["StandardDeviation"]
        words.append(
            f"standard deviation {np.median(spread):.2f} mm, at the tip {spread[-1]:.2f} mm"
        )
    words.append(f"frame {line.frame}, {line.time:.3f} s, views {rig.convergence_deg:.0f}° apart")
    plotter.add_text("\n".join(words), position="upper_left", font_size=height // 90, color=_INK)


def _look(plotter: Any, rig: StereoRig, everything: Floats) -> None:
    """Stand between the sources, a little above, and see all of the device and its pictures."""
    # A picture's y axis points down: its opposite is what the observers call up.
    down = sum(
        camera.pixel_to_ray[:, 1] / np.linalg.norm(camera.pixel_to_ray[:, 1])
        for camera in (rig.a, rig.b)
    )
    towards = rig.a.axis + rig.b.axis
    towards = towards / np.linalg.norm(towards)
    up = -(down - (down @ towards) * towards)
    up = up / np.linalg.norm(up)
    if rig.convergence_deg < _NARROW_DEG:
        side = np.cross(towards, up)
        towards = 0.6 * towards + 0.8 * side
    middle = (everything.min(axis=0) + everything.max(axis=0)) / 2
    towards = towards - 0.3 * up
    plotter.camera_position = [middle - towards, middle, up]
    plotter.camera.view_angle = 25
    plotter.reset_camera(bounds=pv.PolyData(everything).bounds)
    plotter.camera.zoom(1.25)


def _polyline(points: Floats) -> Any:
    line = pv.PolyData(np.asarray(points))
    line.lines = np.concatenate([[len(points)], np.arange(len(points))])
    line.verts = np.empty(0, dtype=int)
    return line
