"""The device in space, before the pictures that show it: a stage that is set once for a run."""

from __future__ import annotations

from dataclasses import dataclass
from types import TracebackType
from typing import Any, Literal

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera, StereoRig

from ..acquisition import Image
from ..centerline import Centerline
from ..errors import InputError, require
from ..offscreen import prepare
from . import look as looks
from . import views
from .device import Shape, envelope, polyline, shape_of, tube
from .lettering import Lettering
from .style import (
    BACKGROUND,
    ENVELOPE,
    FAINT_INK,
    GHOST,
    INK,
    SHEET,
    UNDETERMINED,
    VIEW_COLORS,
    Picture,
    colors_of,
)
from .survey import Survey

pv = require("pyvista", "vtk")

View = Literal["overview", "best", "a", "b"]
# Rendered so many times larger and averaged: smooth edges, for a third of the time that VTK's
# own supersampling takes.
_FINE = 2
# Balls mark the ends: so many times as thick as the device.
_BALL = 1.4
# Every so many points of the device's surface are enough to keep words off it.
_SEEN = 6
_UNIT_BALL = pv.Sphere(radius=1.0)
Cameras = list[tuple[str, Camera]]


@dataclass(frozen=True, eq=False)
class Shot:
    """What is known of one instant.

    Parameters
    ----------
    line : Centerline, optional
        None where the frame has no curve.
    rig : StereoRig, optional
    images : pair of arrays, optional
        Pictures of both views, (rows, columns) or (rows, columns, 3), free of lens distortion.
    ghosts : tuple of Centerline
        Past shapes, the oldest first.
    heading : tuple of str
        What stands at the top left.
    """

    line: Centerline | None
    rig: StereoRig | None = None
    images: tuple[Image, Image] | None = None
    ghosts: tuple[Centerline, ...] = ()
    heading: tuple[str, ...] = ()


class Stage:
    """Draws one shot after another from the same eye, or from one that goes around.

    Parameters
    ----------
    survey : Survey
        What the run spans.
    rig : StereoRig, optional
        Where the views stand; needed to look along one of them.
    view : {'overview', 'best', 'a', 'b'}
    size : (int, int)
        Width and height, px.
    turning : bool
        Leave room for all that comes by when the eye goes around.

    Raises
    ------
    InputError
        Where nothing can be rendered, or a view is asked for and no rig is known.
    """

    def __init__(
        self,
        survey: Survey,
        rig: StereoRig | None,
        *,
        view: View = "overview",
        size: tuple[int, int] = (1600, 1200),
        turning: bool = False,
    ) -> None:
        if view in VIEW_COLORS and rig is None:
            raise InputError(
                f"view {view}", "is not known without a rig", "give a folder that holds rig.json"
            )
        prepare()
        self._survey, self._view, self._size, self._turning = survey, view, size, turning
        self._rig: StereoRig | None = None
        self._depths = (0.0, 0.0)
        self._pivot = (survey.points.min(axis=0) + survey.points.max(axis=0)) / 2
        self._plotter = pv.Plotter(off_screen=True, window_size=[_FINE * side for side in size])
        self._actors: dict[str, Any] = {}
        self._meshes: dict[str, Any] = {}
        self._standing: dict[str, tuple[Camera, float, tuple[Any, Any, Any]]] = {}
        self._ghosts: dict[int, tuple[Centerline, Any]] = {}
        self._plotter.set_background(BACKGROUND)
        self._plotter.disable_anti_aliasing()
        # Hulls show their front only, and are few: they need no sorting by pixel, which would
        # take half as long again.
        self._plotter.renderer.SetUseOIT(False)
        self._look = self._looking(rig)

    def __enter__(self) -> Stage:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._plotter.close()

    def draw(self, shot: Shot, turn_deg: float = 0.0) -> Picture:
        """Draw a shot, (rows, columns, 3); the eye may be led around the device first."""
        return self.lettered(shot, turn_deg).picture

    def lettered(self, shot: Shot, turn_deg: float = 0.0) -> Lettering:
        """Draw a shot, and return it with the places that its words take."""
        if self._view in VIEW_COLORS and shot.rig is not self._rig:  # a C-arm that moves
            self._look = self._looking(shot.rig)
        look = self._look.turned(turn_deg, self._pivot) if turn_deg else self._look
        for actor in self._actors.values():
            actor.visibility = False
        shape = shape_of(shot.line, self._survey.color_by) if shot.line else None
        self._put_device(shape, shot)
        for name, camera in self._cameras(shot.rig):
            self._put_picture(name, camera, shot, shape, look)
        look.aim(self._plotter)
        self._plotter.render_window.Render()
        lettering = Lettering(self._taken()[:, :: -1 if look.mirrored else 1])
        self._write(lettering, look, shot, shape)
        return lettering

    def _taken(self) -> Picture:
        """What was rendered last, (rows, columns, 3), averaged to the size of the picture."""
        window, size = self._plotter.render_window, tuple(_FINE * side for side in self._size)
        pixels = require("vtkmodules.vtkCommonCore", "vtk").vtkUnsignedCharArray()
        # With a fourth byte, as OpenGL and Pillow keep them: nothing has to be rearranged.
        window.GetRGBACharPixelData(0, 0, size[0] - 1, size[1] - 1, 0, pixels)
        images = require("PIL.Image", "vtk")
        taken = images.frombuffer("RGBX", size, memoryview(pixels), "raw", "RGBX", 0, 1)
        upright = taken.reduce(_FINE).transpose(images.Transpose.FLIP_TOP_BOTTOM)
        return np.asarray(upright.convert("RGB"))

    # ---- what is looked at -----------------------------------------------------------

    def _looking(self, rig: StereoRig | None) -> looks.Look:
        self._rig, points = rig, self._survey.points
        if rig is not None:
            self._depths = views.picture_depths(points, rig, self._survey.reach)
        fill = [self._survey.surface]
        if self._view == "best":
            look = looks.best_side(rig, points)
        elif self._view == "overview" or rig is None:
            for name, camera in self._cameras(rig):
                depth = self._depth(name)
                start = views.frustum_start(camera, depth, points)
                fill.append(looks.picture_corners(camera, depth))
                if start < 0.01 * depth:
                    fill.append(looks.picture_corners(camera, start))
            look = looks.between_views(rig, np.vstack(fill))
        else:
            camera = getattr(rig, self._view)
            fill.append(looks.picture_corners(camera, self._depth(self._view)))
            look = looks.from_view(camera)
        if self._turning:
            fill = [look.all_around(np.vstack(fill), self._pivot)]
        return look.fitted(np.vstack(fill), self._size)

    def _cameras(self, rig: StereoRig | None) -> Cameras:
        """The views whose pictures stand on the stage."""
        if rig is None or self._view == "best":
            return []
        names = "ab" if self._view == "overview" else self._view
        return [(name, getattr(rig, name)) for name in names]

    def _depth(self, view: str) -> float:
        return self._depths["ab".index(view)]

    # ---- what stands there -----------------------------------------------------------

    def _put(self, name: str, mesh: Any, **style: Any) -> Any:
        """Show a mesh: in place of the one that had its name, or as a new one."""
        actor = self._actors.get(name)
        if actor is None:
            style = {"show_scalar_bar": False, "reset_camera": False, **style}
            actor = self._actors[name] = self._plotter.add_mesh(mesh, name=name, **style)
        elif self._meshes[name] is not mesh:  # else OpenGL has it already
            actor.mapper.dataset = mesh
        self._meshes[name] = mesh
        actor.visibility = True
        return actor

    def _put_device(self, shape: Shape | None, shot: Shot) -> None:
        by_time = self._survey.color_by == "Time"
        # Most of these were on the last picture, too.
        self._ghosts = {
            id(line): self._ghosts.get(id(line))
            or (line, self._colored(shape_of(line, self._survey.color_by), by_time))
            for line in shot.ghosts
        }
        for number, (_, mesh) in enumerate(self._ghosts.values()):
            actor = self._put(f"ghost {number}", mesh, **self._paint(by_time))
            if not by_time:
                actor.prop.color, actor.prop.culling = GHOST, "back"
                actor.prop.opacity = 0.15 + 0.35 * (number + 1) / len(shot.ghosts)
        if shape is None:
            return
        colored = self._survey.color_by is not None
        self._put("device", self._colored(shape, colored), **self._paint(colored))
        around = envelope(shape)
        if around is not None:
            # Its far side only: a halo, which leaves the device the colors of the color bar.
            self._put("envelope", around, color=ENVELOPE, opacity=0.35, culling="front",
                      scalars=None, lighting=False)  # fmt: skip
        for end, name in ((0, "base"), (-1, "tip")):
            color = INK if end else "white"
            ball = self._put(name, _UNIT_BALL, color=color, specular=0.3, smooth_shading=True)
            ball.position, ball.scale = shape.points[end], _BALL * shape.radius[end]

    def _colored(self, shape: Shape, colored: bool) -> Any:
        mesh = tube(shape)
        if colored and self._survey.color_by is not None:
            mesh["colors"] = colors_of(mesh["values"], self._survey.limits, self._survey.color_by)
            mesh.point_data.remove("values")
        return mesh

    def _paint(self, colored: bool) -> dict[str, Any]:
        # Much ambient light: the colors on the tube must be those of the color bar.
        light = {"smooth_shading": True, "ambient": 0.45, "diffuse": 0.65}
        return {"scalars": "colors", "rgb": True, **light} if colored else {"color": INK, **light}

    def _put_picture(
        self, name: str, camera: Camera, shot: Shot, shape: Shape | None, look: looks.Look
    ) -> None:
        color, depth = VIEW_COLORS[name], self._depth(name)
        quad, border, rays = self._stand(name, camera, depth)
        # From behind it would be seen the wrong way round, and would hide the device.
        if camera.depth(look.position[None])[0] < depth:
            image = shot.images["ab".index(name)] if shot.images else None
            style = {"color": SHEET if image is None else "white", "lighting": False}
            actor = self._put(f"picture {name}", quad, **style)
            stage = _FINE * min(self._size)
            actor.texture = None if image is None else views.texture(image, stage)
        self._put(f"border {name}", border, color=color, line_width=self._line(3))
        if self._view != "overview":
            return
        self._put(f"frustum {name}", rays, color=color, line_width=self._line(1.2), opacity=0.45)
        if shape is None:
            return
        # A hair before the picture, or the two would fight for the same depth.
        before = depth - 0.004 * looks.extent(self._survey.points)
        shadow = looks.slid(camera, camera.project(shape.points), before)
        self._put(f"shadow {name}", polyline(shadow), color=color, line_width=self._line(3.5))
        for end in (0, -1):
            ray = polyline(np.array([shape.points[end], shadow[end]]))
            self._put(
                f"ray {name} {end}", ray, color=color, line_width=self._line(1.5), opacity=0.7
            )

    def _stand(self, name: str, camera: Camera, depth: float) -> tuple[Any, Any, Any]:
        """A view's picture, its border and its rays, which stay the same until the view moves."""
        known = self._standing.get(name)
        if known is None or known[0] is not camera or known[1] != depth:
            quad = views.picture_quad(camera, depth)
            start = views.frustum_start(camera, depth, self._survey.points)
            border = polyline(quad.points[[0, 1, 2, 3, 0]])
            known = (camera, depth, (quad, border, views.frustum(camera, start, depth)))
            self._standing[name] = known
        return known[2]

    def _line(self, width: float) -> float:
        """A line's width in a picture of any size, as it is in one of 1200 rows."""
        return _FINE * max(1.0, width * self._size[1] / 1200)

    # ---- what is said ----------------------------------------------------------------

    def _write(
        self, lettering: Lettering, look: looks.Look, shot: Shot, shape: Shape | None
    ) -> None:
        survey = self._survey
        if survey.color_by is not None:
            lettering.color_bar(survey.color_by, survey.limits)
        lettering.heading(shot.heading)
        scale = look.pixels_per_mm(self._pivot, self._size[1])
        lettering.scale_bar(scale, "" if look.parallel else " at the device")
        flip = [-1.0 if look.mirrored else 1.0, -1.0]
        lettering.axes(look.axes[:, :2] * flip, axis_names(shot.rig))
        lettering.swatches(self._legend(shot, shape))
        device = np.empty((0, 2))
        if shape is not None:
            device = look.project(tube(shape).points[:: _SEEN + 1], self._size)
            ends = look.project(shape.points[[-1, 0]], self._size)
            thick = _BALL * scale * shape.radius[[-1, 0]]
            for end, ball, name in zip(ends, thick, ("tip", "base"), strict=True):
                lettering.name(end, name, INK, device, ball)
        for name, camera in self._cameras(shot.rig):
            corners = looks.picture_corners(camera, self._depth(name))
            top = look.project(corners[:2].mean(axis=0)[None], self._size)[0]
            lettering.name(
                top, f"view {name}", VIEW_COLORS[name], device, 0.5 * lettering.letter, 270
            )

    def _legend(self, shot: Shot, shape: Shape | None) -> list[tuple[str, str, float]]:
        legend = []
        if shape is not None and shape.spread is not None:
            legend.append(("within 2 standard deviations", ENVELOPE, 0.35))
        if shape is not None and not shape.determined.all() and self._survey.color_by:
            legend.append(("not determined by the views", UNDETERMINED, 1.0))
        if shot.ghosts and self._survey.color_by != "Time":
            first, last = shot.ghosts[0].frame, shot.ghosts[-1].frame
            frames = f"frame {last}" if first == last else f"frames {first} to {last}"
            legend.append((f"before: {frames}", GHOST, 0.5))
        if shape is not None and not shape.radius_known:
            legend.append(("radius not known", FAINT_INK, 0.0))
        return legend


def axis_names(rig: StereoRig | None) -> tuple[str, str, str]:
    """What a rig calls its axes: those of a patient are left, posterior, superior."""
    if rig is not None and rig.frame.endswith("lps"):
        return ("L", "P", "S")
    return ("x", "y", "z")


def heading(line: Centerline, rig: StereoRig | None) -> tuple[str, ...]:
    """Say what a curve is: frame, time, length, how sure it is."""
    lines = [f"frame {line.frame} · {line.time:.3f} s", f"length {line.backbone.length:.1f} mm"]
    spread: Floats = line.arrays.get("StandardDeviation", np.empty(0))
    if spread.ndim == 1 and len(spread) and np.isfinite(spread).all():
        lines.append(
            f"standard deviation {np.median(spread):.2f} mm, {spread[-1]:.2f} mm at the tip"
        )
    if rig is not None:
        side_by_side = rig.convergence_deg < 10  # then the distance says more than the angle
        apart = f"{rig.baseline:.1f} mm" if side_by_side else f"{rig.convergence_deg:.0f}°"
        lines.append(f"views {apart} apart")
    return tuple(lines)
