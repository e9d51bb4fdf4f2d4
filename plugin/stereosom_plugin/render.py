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
_BACKGROUND, _SHEET = "#f7f8fa", "#e4e7ec"
_INK, _GRID, _GRID_INK = "#22262b", "#aab1ba", "#59616b"
# So many lines of small text fill the height of a picture.
_LINES = 58
_TITLES = {"Curvature": "curvature (1/mm)", "StandardDeviation": "standard deviation (mm)"}
# Below this angle the two pictures stand one behind the other and are seen from the side.
_NARROW_DEG = 45.0


def scene(
    result: Reconstruction | Centerline,
    rig: StereoRig | None,
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
    rig : StereoRig, optional
        Without one the device is drawn alone.
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
        quads = _picture_quads(line.points, rig) if rig else ()
        letter = _look(plotter, rig, np.vstack([line.points, *(quad.points for quad in quads)]))
        plotter.enable_anti_aliasing("ssaa")
        _add_device(plotter, line, rig, color_by, letter)
        for view, quad, camera, image in zip(
            "ab", quads, (rig.a, rig.b) if rig else (), images or (None, None), strict=False
        ):
            _add_picture(plotter, view, quad, camera, image, line.points, letter)
        _add_words(plotter, line, rig, size[1])
        plotter.renderer.reset_camera_clipping_range()
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
    extent = _extent(points)
    nearest = [float(camera.depth(points).max()) + 0.05 * extent for camera in (rig.a, rig.b)]
    narrow = rig.convergence_deg < _NARROW_DEG
    for gap in extent * np.arange(0, 20, 0.1):
        depth_a, depth_b = nearest[0] + (0 if narrow else gap), nearest[1] + gap
        quad_a, quad_b = picture_quad(rig.a, depth_a), picture_quad(rig.b, depth_b)
        past_b = rig.b.depth(quad_a.points) - depth_b
        past_a = rig.a.depth(quad_b.points) - depth_a
        if narrow and past_a.min() > 0.5 * extent:
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
    letter: float,
) -> None:
    color = VIEW_COLORS[view]
    if image is None:
        plotter.add_mesh(quad, color=_SHEET, lighting=False)
    else:
        texture = pv.Texture(stretched(image))
        texture.interpolate = texture.mipmap = True
        plotter.add_mesh(quad, texture=texture, lighting=False)
    plotter.add_mesh(_polyline(quad.points[[0, 1, 2, 3, 0]]), color=color, line_width=3)
    top, bottom = quad.points[:2].mean(axis=0), quad.points[2:].mean(axis=0)
    above = top + 1.3 * letter * (top - bottom) / np.linalg.norm(top - bottom)
    _add_label(plotter, above, f"view {view}", color)
    # A hair before the picture, or the two would fight for the same depth.
    depth = float(camera.depth(quad.points).mean()) - 0.004 * _extent(points)
    shadow = slid(camera, camera.project(points), depth)
    plotter.add_mesh(_polyline(shadow), color=color, line_width=4)
    for end in (0, -1):
        ray = _polyline(np.array([points[end], shadow[end]]))
        plotter.add_mesh(ray, color=color, line_width=1.5, opacity=0.6)


# ---- the rest of the scene -----------------------------------------------------------


def _add_device(
    plotter: Any, line: Centerline, rig: StereoRig | None, color_by: str, letter: float
) -> None:
    tube = _polyline(line.points)
    values = line.arrays.get(color_by)
    if values is not None:
        tube[color_by] = values
    radius = float(np.median(line.arrays.get("Radius", [0.005 * _extent(line.points)])))
    plotter.add_mesh(
        tube.tube(radius=radius, n_sides=32, capping=True),
        scalars=None if values is None else color_by,
        color=_INK if values is None else None,
        cmap="viridis",
        # A single sharp place, at an end perhaps, must not take all the colors.
        clim=None if values is None else np.percentile(values, (3, 97)).tolist(),
        smooth_shading=True,
        specular=0.3,
        scalar_bar_args={
            # The empty line keeps VTK from setting the numbers into the title.
            "title": f"{_TITLES.get(color_by, color_by)}\n",
            "vertical": False,
            "position_x": 0.66,
            "position_y": 0.89,
            "width": 0.3,
            "height": 0.08,
            "n_labels": 3,
            "fmt": "%.2g",
            "unconstrained_font_size": True,
            "title_font_size": plotter.window_size[1] // 50,
            "label_font_size": plotter.window_size[1] // 55,
            "font_family": "arial",
            "color": _INK,
        },
    )
    towards, up = _viewpoint(rig)
    for end, inner, name in ((0, 1, "base"), (-1, -2, "tip")):
        ball = pv.Sphere(radius=1.6 * radius, center=line.points[end])
        plotter.add_mesh(ball, color=_INK if end else "white", specular=0.3)
        aside = np.cross(line.points[end] - line.points[inner], towards)
        aside *= np.sign(aside @ (up + np.cross(towards, up))) / np.linalg.norm(aside)
        _add_label(plotter, line.points[end] + (2 * letter + radius) * aside, name, _INK)
    _add_grid(plotter, line.points, rig, letter)


def _add_grid(plotter: Any, points: Floats, rig: StereoRig | None, letter: float) -> None:
    """Draw the far walls of the device's box, ruled in round millimetres, and the numbers."""
    extent = _extent(points)
    power = 10.0 ** np.floor(np.log10(extent / 5))
    step = power * max(factor for factor in (1, 2, 5) if factor * power <= extent / 5)
    decimals = max(0, -int(np.floor(np.log10(step))))
    low, high = points.min(axis=0) - 0.03 * extent, points.max(axis=0) + 0.03 * extent
    center = (low + high) / 2
    towards, up = _viewpoint(rig)
    far, near = np.where(towards > 0, (high, low), (low, high))
    preferred = -up - 0.4 * np.cross(towards, up)  # numbers stand below, and to the left
    for k, axis in enumerate(np.eye(3)):
        i, j = (k + 1) % 3, (k + 2) % 3
        ticks = np.arange(np.ceil(low[k] / step), np.floor(high[k] / step) + 1) * step
        for value in (low[k], *ticks, high[k]):  # on the two far walls that run along this axis
            for across in (i, j):
                rule = np.tile(far, (2, 1))
                rule[:, k], rule[:, across] = value, (low[across], high[across])
                plotter.add_mesh(_polyline(rule), color=_GRID, line_width=1)
        # Of a box's edges along an axis, the outline has the two between a far and a near wall.
        edges = np.tile(center, (2, 1))
        edges[:, [i, j]] = [[far[i], near[j]], [near[i], far[j]]]
        edge = max(edges, key=lambda middle: float((middle - center) @ preferred))
        # Away from the box and square to the edge, as the eye sees them.
        seen = axis - (axis @ towards) * towards
        outwards = np.cross(seen, towards)
        outwards *= np.sign(outwards @ (edge - center)) / max(np.linalg.norm(outwards), 1e-12)
        # An axis that points at the eye has room for few numbers.
        every = int(np.ceil(2.4 * letter / max(step * np.linalg.norm(seen), 0.01 * letter)))
        for tick in ticks[::every]:
            spot = np.where(axis == 1, tick, edge) + 1.5 * letter * outwards
            _add_label(plotter, spot, f"{tick + 0.0:.{decimals}f}", _GRID_INK)
        title = edge + 4.8 * letter * outwards
        _add_label(plotter, title, f"{'xyz'[k]} (mm)", _GRID_INK)


def _add_words(plotter: Any, line: Centerline, rig: StereoRig | None, height: int) -> None:
    words = [f"length {line.backbone.length:.1f} mm"]
    if "StandardDeviation" in line.arrays:
        spread = line.arrays["StandardDeviation"]
        words.append(
            f"standard deviation {np.median(spread):.2f} mm, {spread[-1]:.2f} mm at the tip"
        )
    apart = f", views {rig.convergence_deg:.0f}° apart" if rig else ""
    words.append(f"frame {line.frame}, {line.time:.3f} s{apart}")
    text = pv.Text("\n".join(words), position=(height // 30, height - height // 30))
    text.prop = pv.TextProperty(
        color=_INK, font_size=height // 45, font_family="arial", justification_vertical="top"
    )
    plotter.add_actor(text)


def _add_label(plotter: Any, spot: Floats, text: str, color: str) -> None:
    """Put words over a place in space, in front of everything."""
    label = pv.Text(text)
    label.GetPositionCoordinate().SetCoordinateSystemToWorld()
    label.GetPositionCoordinate().SetValue(*spot)
    # A light ground lets the words be read before a dark picture.
    label.prop = pv.TextProperty(
        color=color,
        font_size=plotter.window_size[1] // _LINES,
        font_family="arial",
        background_color=_BACKGROUND,
        background_opacity=0.75,
        justification_horizontal="center",
        justification_vertical="center",
    )
    plotter.add_actor(label, reset_camera=False)


def _viewpoint(rig: StereoRig | None) -> tuple[Floats, Floats]:
    """Look from between the sources, a little above: unit vectors of view and of up, (3,)."""
    if rig is None:  # patients are drawn head up, from in front and a little aside
        slope = np.hypot(1.0, 0.35)
        return np.array([0.6, 0.8, -0.35]) / slope, np.array([0.21, 0.28, 1.0]) / slope
    towards = rig.a.axis + rig.b.axis
    if np.linalg.norm(towards) < 1e-3:  # the views face each other
        towards = rig.a.axis
    towards = towards / np.linalg.norm(towards)
    # A picture's y axis points down: its opposite is what the observers call up.
    down = rig.a.pixel_to_ray[:, 1] / np.linalg.norm(rig.a.pixel_to_ray[:, 1])
    up = (down @ towards) * towards - down
    if np.linalg.norm(up) < 1e-3:  # view a looks up or down at what view b calls level
        up = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))])
    up = up / np.linalg.norm(up)
    if rig.convergence_deg < _NARROW_DEG:
        towards = 0.6 * towards + 0.8 * np.cross(towards, up)
    towards = towards - 0.35 * up
    towards = towards / np.linalg.norm(towards)
    up = up - (up @ towards) * towards
    return towards, up / np.linalg.norm(up)


def _look(plotter: Any, rig: StereoRig | None, everything: Floats) -> float:
    """Let the camera see (n, 3) points from the viewpoint, filling the picture.

    Returns the height of a line of small text, in mm amid the points.
    """
    towards, up = _viewpoint(rig)
    plotter.camera.view_angle = 20
    # The camera that frames a sphere about all leaves much empty: move it up to the points.
    right, middle = np.cross(towards, up), (everything.min(axis=0) + everything.max(axis=0)) / 2
    local = (everything - middle) @ np.column_stack([right, up, towards])
    center = (local.max(axis=0) + local.min(axis=0)) / 2 * [1, 1, 0]
    middle, local = middle + center[0] * right + center[1] * up, local - center
    half = np.tan(np.radians(plotter.camera.view_angle / 2)) * 0.78
    aspect = plotter.window_size[0] / plotter.window_size[1]
    reach = np.maximum(np.abs(local[:, 0]) / aspect, np.abs(local[:, 1])) / half - local[:, 2]
    middle = middle + 0.03 * half * reach.max() * up  # room for the words at the top
    position = middle - towards * float(reach.max())
    plotter.camera_position = [position, middle, up]
    return float(2 * half * reach.max() / _LINES)


def _extent(points: Floats) -> float:
    """Diagonal of the box about (n, 3) points, mm."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _polyline(points: Floats) -> Any:
    line = pv.PolyData(np.asarray(points))
    line.lines = np.concatenate([[len(points)], np.arange(len(points))])
    line.verts = np.empty(0, dtype=int)
    return line
