"""Pictures and films without a screen: the device in space, and over its views.

`style` holds colors and typeface; `look` where the eye is; `device` the tube and the envelope
around it; `views` the pictures in space; `lettering` words that never overlap; `survey` what a
whole run spans; `scene` puts them on a stage; `overlay` draws over a view's own picture; `film`
writes MP4 and GIF.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom.reconstruction import Reconstruction

from ..acquisition import Image
from ..errors import require
from ..files import write_whole
from ..polydata import Centerline, to_centerline
from .film import check_even, write_film
from .overlay import GAP, Overlay, beside, overlaid, padded
from .scene import Shot, Stage, View, heading
from .style import COLOR_BY, VIEW_COLORS, Picture
from .survey import Survey, survey
from .views import picture_quad, stretched

__all__ = [
    "COLOR_BY",
    "GAP",
    "VIEW_COLORS",
    "Overlay",
    "Shot",
    "Stage",
    "Survey",
    "View",
    "beside",
    "check_even",
    "heading",
    "overlaid",
    "overlay",
    "padded",
    "picture_quad",
    "scene",
    "stretched",
    "survey",
    "write_film",
    "write_picture",
]


def scene(
    result: Reconstruction | Centerline,
    rig: StereoRig | None,
    path: str | Path,
    images: tuple[Image, Image] | None = None,
    *,
    color_by: str | None = None,
    view: View = "overview",
    ghosts: tuple[Centerline, ...] = (),
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
    color_by : {'Curvature', 'StandardDeviation', 'Time'}, optional
        What colors the device. Default: curvature where it is known.
    view : {'overview', 'best', 'a', 'b'}
        From between the views; squarely from the device's best side, without perspective; or
        as one of the views sees it.
    ghosts : tuple of Centerline
        Past shapes, the oldest first.
    size : (int, int)
        Width and height, px.

    Raises
    ------
    InputError
        Where nothing can be rendered, or the file cannot be written, or `color_by` names what
        the result does not hold.
    """
    line = to_centerline(result, samples=400) if isinstance(result, Reconstruction) else result
    spanned = survey((line, *ghosts), color_by)
    with write_whole(path) as part, Stage(spanned, rig, view=view, size=size) as stage:
        shot = Shot(line, rig, images, ghosts, heading(line, rig))
        save_png(stage.draw(shot), part)


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
    write_picture(overlaid(Overlay(image, camera, backbone.sample(400), color=color)), path)


def write_picture(picture: Picture, path: str | Path) -> None:
    """Write (rows, columns, 3) bytes as a `.png`, whole or not at all.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    with write_whole(path) as part:
        save_png(picture, part)


def save_png(picture: Picture, path: Path) -> None:
    """Write (rows, columns, 3) bytes as a `.png` in place."""
    image: Any = require("PIL.Image", "vtk")
    image.fromarray(np.ascontiguousarray(picture)).save(path, format="PNG", optimize=False)
