"""A view's own picture, and over it where the device was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats
from stereosom.camera import Camera

from ..acquisition import Image
from ..centerline import Centerline
from ..errors import require
from ..lens import Lens
from .lettering import Lettering
from .style import BACKGROUND, SEGMENTED, VIEW_COLORS, Picture, rgb
from .views import shades

# Lines are drawn so many times larger and averaged, so that they end up smooth.
_FINE = 3
_USUAL_SIDE, _POINTS = 1000, 400
GAP = 8


@dataclass(frozen=True, eq=False)
class Overlay:
    """What is drawn over one view's picture.

    Parameters
    ----------
    image : (rows, columns) or (rows, columns, 3) array
    camera : Camera
    points : (n, 3) array, optional
        The centerline, base to tip, mm; None where the frame has no curve.
    color : str
        Of the line.
    segmented : (m, 2) array, optional
        Pixels (x, y) on the device, whose outline is drawn.
    title : str
        At the top left of the picture.
    deviation : (n,) array, optional
        Standard deviation of the centerline's place across it in this picture, px: a band
        shows two of them.
    lens : Lens, optional
        Through which the picture was taken. Default: it is free of lens distortion.
    """

    image: Image
    camera: Camera
    points: Floats | None
    color: str = VIEW_COLORS["a"]
    segmented: Floats | None = None
    title: str = ""
    deviation: Floats | None = None
    lens: Lens | None = None

    def seen(self, pixels: Floats) -> Floats:
        """Pixels (n, 2) of the camera as the picture shows them; not a number beyond the lens."""
        return pixels if self.lens is None else self.lens.distort_where_defined(pixels)

    @classmethod
    def of(
        cls,
        line: Centerline | None,
        image: Image,
        camera: Camera,
        view: str,
        title: str = "",
        segmented: Floats | None = None,
        lens: Lens | None = None,
    ) -> Overlay:
        """Lay a centerline over the picture of view 'a' or 'b', with what is known of it."""
        color = VIEW_COLORS[view]
        if line is None:
            return cls(image, camera, None, color, segmented, title, lens=lens)
        points, deviation = line.backbone.sample(_POINTS), None
        covariance = line.arrays.get("Covariance")
        if covariance is not None and covariance.shape == (len(line.points), 6):
            here, there = np.linspace(0, 1, _POINTS), np.linspace(0, 1, len(covariance))
            xx, yy, zz, xy, yz, xz = (np.interp(here, there, part) for part in covariance.T)
            full = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), -1, 0)
            if np.isfinite(full).all():
                deviation = deviation_px(camera, points, full)
        return cls(image, camera, points, color, segmented, title, deviation, lens)


def overlaid(
    overlay: Overlay, *, size: tuple[int, int] | None = None, scale_bar: bool = False
) -> Picture:
    """Draw one view with its centerline: base round, tip a diamond.

    Parameters
    ----------
    overlay : Overlay
    size : (int, int), optional
        Width and height to fill, px; what the picture leaves stays light. Default: the
        picture's own, enlarged by a whole factor where it is small.
    scale_bar : bool
        Draw one, which holds at the device's depth.
    """
    picture, scale, corner = _placed(shades(overlay.image), size)
    layer = _Layer(picture)

    def pixels(at: Floats) -> Floats:
        # The middle of the top left pixel is (0, 0) before and after.
        return np.asarray((at + 0.5) * scale - 0.5 + corner)

    if overlay.segmented is not None and len(overlay.segmented):
        size_or_all = None if overlay.lens else overlay.camera.image_size
        for loop in outlines(overlay.segmented, size_or_all):
            shown = overlay.seen(loop)
            layer.line(pixels(shown[np.isfinite(shown).all(axis=1)]), SEGMENTED, 1.6)
    shown = np.empty((0, 2))
    if overlay.points is not None:
        shown = overlay.seen(overlay.camera.project(overlay.points))
    known = np.isfinite(shown).all(axis=1)
    if known.any():
        line = pixels(shown[known])
        if overlay.deviation is not None:
            layer.band(line, 2 * scale * overlay.deviation[known], overlay.color)
        # A light rim keeps the line readable on any background.
        layer.line(line, "#ffffff", 5.0, opacity=0.7)
        layer.line(line, overlay.color, 2.6)
        layer.mark(line[0], overlay.color, sides=40)
        layer.mark(line[-1], overlay.color, sides=4)
    if not overlay.title and not scale_bar:
        return layer.picture
    lettering = Lettering(layer.picture)
    lettering.plate(overlay.title, (round(corner[0]), round(corner[1])))
    if scale_bar and overlay.points is not None:
        depth = float(np.mean(overlay.camera.depth(overlay.points)))
        per_mm = scale * overlay.camera.focal_length / depth
        lettering.scale_bar(per_mm, " at the device", plate=True)
    return lettering.picture


def beside(pictures: Sequence[Picture], gap: int = GAP) -> Picture:
    """Pictures in a row, as high as the highest."""
    high = max(picture.shape[0] for picture in pictures)
    parts: list[Picture] = []
    for picture in pictures:
        if parts:
            parts.append(_sheet(high, gap))
        below = high - picture.shape[0]
        parts.append(np.vstack([picture, _sheet(below, picture.shape[1])]))
    return np.hstack(parts)


def padded(picture: Picture, size: tuple[int, int] | None, *, even: bool) -> Picture:
    """A picture with light borders, so that it has a size, or at least an even one."""
    high, wide = picture.shape[:2]
    if size is None:
        size = (wide + wide % 2, high + high % 2) if even else (wide, high)
    if size == (wide, high):
        return picture
    sheet = _sheet(size[1], size[0])
    left, top = (size[0] - wide) // 2, (size[1] - high) // 2
    sheet[top : top + high, left : left + wide] = picture
    return sheet


def outlines(pixels: Floats, size: tuple[int, int] | None = None) -> list[Floats]:
    """Outlines of a set of (n, 2) pixels, (m, 2) each, closed.

    Of those in a picture of (width, height); through a lens, it may show others as well.
    """
    column, row = np.round(pixels).astype(int).T
    if size is not None:
        inside = (column >= 0) & (row >= 0) & (column < size[0]) & (row < size[1])
        column, row = column[inside], row[inside]
    if not len(column):
        return []
    # The box about the pixels is all that has to be searched, with one around it.
    left, top = column.min() - 1, row.min() - 1
    mask = np.zeros((row.max() - top + 2, column.max() - left + 2))
    mask[row - top, column - left] = 1
    contours = require("contourpy", "vtk").contour_generator(z=mask).lines(0.5)
    return [np.add(_corners(contour), (left, top)) for contour in contours]


def _corners(loop: Floats) -> Floats:
    """The points of a line at which it turns, and its ends: the rest takes time to draw."""
    steps = np.diff(loop, axis=0)
    turns = np.any(steps[1:] != steps[:-1], axis=1)
    return np.asarray(loop[np.concatenate([[True], turns, [True]])])


def deviation_px(camera: Camera, points: Floats, covariance: Floats) -> Floats:
    """Standard deviation across a projected curve, px, from (n, 3, 3) covariances in mm²."""
    jacobian = camera.jacobian(points)
    flat = jacobian @ covariance @ jacobian.transpose(0, 2, 1)
    along = np.gradient(camera.project(points), axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    return np.asarray(np.sqrt(np.maximum(np.einsum("ni,nij,nj->n", across, flat, across), 0)))


class _Layer:
    """A picture on which smooth lines are drawn."""

    def __init__(self, picture: Picture) -> None:
        self._modules = require("PIL.Image", "vtk"), require("PIL.ImageDraw", "vtk")
        self._image = self._modules[0].fromarray(np.ascontiguousarray(picture))
        self._unit = max(1.0, max(self._image.size) / 1100)

    @property
    def picture(self) -> Picture:
        return np.array(self._image, dtype=np.uint8)

    def line(self, points: Floats, color: str, width: float, opacity: float = 1.0) -> None:
        def draw(pen: Any, at: Floats) -> None:
            thick = max(1, round(_FINE * width * self._unit))
            pen.line([tuple(point) for point in at], fill=255, width=thick, joint="curve")
            for end in (at[0], at[-1]):  # round ends
                pen.circle(tuple(end), thick / 2, fill=255)

        self._blend(points, width * self._unit, draw, color, opacity)

    def band(self, points: Floats, half: Floats, color: str) -> None:
        along = np.gradient(points, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        across = half[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
        corners = np.vstack([points + across, (points - across)[::-1]])
        self._blend(
            corners, 2, lambda pen, at: pen.polygon([tuple(p) for p in at], fill=255), color, 0.3
        )

    def mark(self, place: Floats, color: str, sides: int) -> None:
        angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
        edge = np.column_stack([np.cos(angles), np.sin(angles)]) * self._unit
        for radius, fill in ((8.0, color), (5.2, "#ffffff")):
            corners = place + radius * edge * (1.15 if sides == 4 else 0.85)
            self._blend(
                corners, 2, lambda pen, at: pen.polygon([tuple(p) for p in at], fill=255), fill, 1.0
            )

    def _blend(self, points: Floats, pad: float, draw: Any, color: str, opacity: float) -> None:
        """Draw white on black, finely, in the box about the points; lay the color on by it."""
        image, pens = self._modules
        low = np.floor(points.min(axis=0) - pad - 2).clip(0).astype(int)
        high = np.ceil(points.max(axis=0) + pad + 3).astype(int).clip(None, self._image.size)
        wide, tall = high - low
        if wide <= 0 or tall <= 0:
            return
        fine = image.new("L", (int(wide) * _FINE, int(tall) * _FINE))
        draw(pens.Draw(fine), (points + 0.5 - low) * _FINE - 0.5)
        share = fine.resize((int(wide), int(tall)), image.Resampling.BOX)
        self._image.paste(rgb(color), tuple(low.tolist()), share.point(lambda v: v * opacity))


def _placed(
    picture: Picture, size: tuple[int, int] | None
) -> tuple[Picture, float, npt.NDArray[np.float64]]:
    """The picture enlarged, in colors, its scale, and where its top left corner is."""
    high, wide = picture.shape[:2]
    if size is None:
        factor = max(1, round(_USUAL_SIDE / max(high, wide)))
        enlarged = np.repeat(np.repeat(picture, factor, 0), factor, 1)
        return _colored(enlarged), factor, np.zeros(2)
    image = require("PIL.Image", "vtk")
    scale = min(size[0] / wide, size[1] / high)
    fitted = (max(1, round(wide * scale)), max(1, round(high * scale)))
    how = image.Resampling.BICUBIC if scale > 1 else image.Resampling.BOX
    resized = image.fromarray(np.ascontiguousarray(_colored(picture))).resize(fitted, how)
    corner = np.array([(size[0] - fitted[0]) // 2, (size[1] - fitted[1]) // 2])
    sheet = _sheet(size[1], size[0])
    sheet[corner[1] : corner[1] + fitted[1], corner[0] : corner[0] + fitted[0]] = resized
    return sheet, scale, corner.astype(float)


def _colored(picture: Picture) -> Picture:
    return np.broadcast_to(picture, (*picture.shape[:2], 3))


def _sheet(high: int, wide: int) -> Picture:
    return np.full((high, wide, 3), rgb(BACKGROUND), dtype=np.uint8)
