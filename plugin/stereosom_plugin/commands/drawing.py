"""Pictures of a result, with the pictures that it was made of where they are found."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import masks
from ..acquisition import Image
from ..calibration import read_rig
from ..centerline import Centerline
from ..output import RECORD, RIG


def draw(
    line: Centerline,
    rigs: Sequence[Any],
    images: tuple[Image, Image] | None,
    picture: Path,
    *,
    color_by: str = "Curvature",
    overlays: Path | None = None,
) -> None:
    """Draw a curve in space, and, where `overlays` names a folder, over both pictures."""
    from .. import render as pictures

    rig = rigs[min(line.frame, len(rigs) - 1)] if rigs else None
    pictures.scene(line, rig, picture, images, color_by=color_by)
    if overlays and images and rig:
        for view, image, camera in zip("ab", images, (rig.a, rig.b), strict=True):
            path = overlays / f"overlay_{view}.png"
            color = pictures.VIEW_COLORS[view]
            pictures.overlay(image, line.backbone, camera, path, color=color)


def source_pictures(folder: Path, frame: int) -> tuple[Image, Image] | None:
    """The pictures that a folder was made of, where they are still in their place."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        paths = [Path(source["path"]) for source in record["inputs"]]
        if record["command"] == "fluoroscopy":
            from ..fluoroscopy import read_biplane

            return read_biplane(paths[0], paths[1]).read(frame)
        rigs = read_rig(folder / RIG)
        half = len(paths) // 2
        pair = (paths[frame], paths[half + frame])
        return masks.read_masks(*pair, rigs[:1]).read(0)
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        return None
