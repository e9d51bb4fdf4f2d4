"""ROS camera_info YAML, one file per camera, as the camera_calibration package writes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from .content import Content, numbers
from .model import Calibration, View, assemble, lens_of
from .settings import Settings

SOURCE = "ROS camera_info"
_OF_THE_MESSAGE = {
    "k": "camera_matrix", "d": "distortion_coefficients", "r": "rectification_matrix",
    "p": "projection_matrix", "width": "image_width", "height": "image_height",
}  # fmt: skip
_MODELS = ("plumb_bob", "rational_polynomial", "equidistant")


def read_ros(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read a pair: left, then right.

    The message's definition (sensor_msgs/CameraInfo): K and D are of the raw picture, R turns
    raw camera axes to rectified ones, P = [K' | K' t] projects from the axes of the rectified
    first camera; lengths are metres.
    """
    infos = [_camera_info(content) for content in contents]
    if any(info is None for info in infos):
        return None
    found = [info for info in infos if info is not None]
    if len(contents) != 2:
        raise ValueError("is one camera's camera_info; give both files, left first")
    views = [_view(info, settings) for info in found]
    offsets = [numbers(info["projection_matrix"], "P", (3, 4)) for info in found]
    notes = [] if settings.units else ["lengths are read as metres, as ROS has them"]
    if not np.any([matrix[:, 3] for matrix in offsets]):
        raise ValueError(
            "projection_matrix: neither has a baseline in its last column; "
            "calibrate both cameras together"
        )
    source = SOURCE + (", rectified" if settings.rectified else "")
    return assemble(
        views[0], views[1], source, units=settings.units or "m",
        image_size=settings.image_size, notes=notes,
    )  # fmt: skip


def _camera_info(content: Content) -> dict[str, Any] | None:
    """The entries by their names in files; `ros2 topic echo` prints those of the message."""
    if content.kind != "yaml":
        return None
    named = {_OF_THE_MESSAGE.get(key.lower(), key): value for key, value in content.tree.items()}
    return named if {"camera_matrix", "projection_matrix"} <= set(named) else None


def _view(info: dict[str, Any], settings: Settings) -> View:
    projection = numbers(info["projection_matrix"], "projection_matrix", (3, 4))
    rectified = projection[:, :3]
    moved = np.linalg.solve(rectified, projection[:, 3])
    size = None
    if "image_width" in info and "image_height" in info:
        sides = (numbers(info[f"image_{side}"], "image size", ()) for side in ("width", "height"))
        width, height = (int(side) for side in sides)
        size = (width, height)
    if settings.rectified:
        return View(rectified, np.eye(3), moved, size)
    model = str(info.get("distortion_model", "plumb_bob"))
    if model not in _MODELS:
        raise ValueError(f"distortion_model: {model[:30]!r} is none of {', '.join(_MODELS)}")
    intrinsics = numbers(info["camera_matrix"], "camera_matrix", (3, 3))
    bends = numbers(info.get("distortion_coefficients", [0] * 5), "distortion_coefficients")
    turn = numbers(
        info.get("rectification_matrix", np.eye(3).tolist()), "rectification_matrix", (3, 3)
    )
    lens = lens_of(intrinsics, bends, fisheye=model == "equidistant")
    return View(intrinsics, turn.T, turn.T @ moved, size, lens)
