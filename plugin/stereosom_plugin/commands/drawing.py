"""Results and the pictures that they were made of, as they are drawn."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from stereosom.camera import StereoRig

from .. import masks
from ..acquisition import Acquisition, Image
from ..calibration import read_calibration, read_rig
from ..centerline import Centerline, read_vtp
from ..errors import InputError
from ..output import RECORD, RIG, Row, centerline_path, read_table

# A film looks at each curve twice. A point and all that is known of it take some 200 bytes.
_MOST_POINTS_KEPT = 200_000
_WITH_CURVE = ("ok", "predicted")


def draw(
    line: Centerline,
    rigs: Sequence[Any],
    images: tuple[Image, Image] | None,
    picture: Path,
    *,
    overlays: Path | None = None,
) -> None:
    """Draw a curve in space, and, where `overlays` names a folder, over both pictures."""
    from .. import render as pictures

    rig = rigs[min(line.frame, len(rigs) - 1)] if rigs else None
    pictures.scene(line, rig, picture, images)
    if overlays and images and rig:
        for view, image, camera in zip("ab", images, (rig.a, rig.b), strict=True):
            path = overlays / f"overlay_{view}.png"
            color = pictures.VIEW_COLORS[view]
            pictures.overlay(image, line.backbone, camera, path, color=color)


class Results:
    """A folder of results or one `.vtp`: curves, rigs and source pictures by frame.

    Curves are kept, as long as they are not too many; nothing else is once it is given.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    frames : list of int
        Of all frames, failed ones too, in order.
    with_curve : list of int
        Of those that have a curve.
    command : str
        The one that made the folder.
    acquisition : Acquisition or None
        The pictures that the results were made of, where they are still in their place.

    Raises
    ------
    InputError
        Where there is no curve to draw.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._single, self._rows = path, None, {}
        self._lines: dict[int, Centerline] = {}
        folder = path if path.is_dir() else path.parent
        if path.is_dir():
            rows = [row for row in read_table(path) if row["frame"].isdecimal()]
            self._rows = {int(row["frame"]): row for row in rows}
            self.frames = sorted(self._rows)
            self.with_curve = [f for f in self.frames if self._rows[f]["status"] in _WITH_CURVE]
        else:
            self._single = read_vtp(path)
            self.frames = self.with_curve = [self._single.frame]
        if not self.with_curve:
            what = f"has no curve in any of its {len(self.frames)} frames"
            raise InputError(path, what, "give a run with one frame that is ok")
        self._rigs = read_rig(folder / RIG) if (folder / RIG).exists() else ()
        self.command, self.acquisition = source_acquisition(folder, self._rigs)
        self._folder = folder

    def line(self, frame: int) -> Centerline | None:
        """Return the curve of a frame; None where it has none."""
        if self._single is not None:
            return self._single
        if self._rows[frame]["status"] not in _WITH_CURVE:
            return None
        line = self._lines.get(frame)
        if line is None:
            line = replace(read_vtp(centerline_path(self.path, frame)), frame=frame)
            if sum(len(known.points) for known in self._lines.values()) < _MOST_POINTS_KEPT:
                self._lines[frame] = line
        return line

    def rig(self, frame: int) -> StereoRig | None:
        """Where the views stood in a frame, as far as is known."""
        return self._rigs[min(max(frame, 0), len(self._rigs) - 1)] if self._rigs else None

    def images(self, frame: int) -> tuple[Image, Image] | None:
        """Both pictures of a frame; None where they are not to be had."""
        if self.acquisition is None or not 0 <= frame < len(self.acquisition):
            return None
        try:
            images = self.acquisition.read(frame)
        except InputError:  # one torn frame does not end a film
            return None
        rig = self.rig(frame)
        if rig is None:
            return images
        sizes = (rig.a.image_size, rig.b.image_size)
        fit = all(i.shape[:2] == s[::-1] for i, s in zip(images, sizes, strict=True))
        return images if fit else None

    def time(self, frame: int) -> float:
        """Seconds."""
        return float(self._rows[frame]["time_s"]) if self._rows else self._line_time()

    def state(self, frame: int) -> str:
        """What is to be said of a frame that is not ok; else nothing."""
        row: Row = self._rows.get(frame, {"status": "ok", "reason": ""})
        return "" if row["status"] == "ok" else f"{row['status']}: {row['reason']}"

    def segmenter(self) -> Any:
        """What found the device in the run's pictures; they must be there.

        Raises
        ------
        InputError
            Where it was a user's own, and is not to be had any more.
        """
        from ..segmentation import MaskFiles, binary
        from ..segmentation.own import load_segmenter
        from .endoscopy import chosen_segmenter

        if self.command == "masks":
            return binary
        options = json.loads((self._folder / RECORD).read_text(encoding="utf-8"))["options"]
        if self.command == "endoscopy":
            assert self.acquisition is not None
            return chosen_segmenter(options, self.acquisition)
        if options.get("masks"):
            assert self.acquisition is not None
            folder_a, folder_b, _ = options["masks"]
            return MaskFiles(folder_a, folder_b, self.acquisition)
        return load_segmenter(options.get("segmenter") or "xray")

    def rate(self) -> float | None:
        """Frames per second of the run; None where its times do not say."""
        steps = np.diff([self.time(frame) for frame in self.frames])
        steps = steps[steps > 0]
        return float(1 / np.median(steps)) if len(steps) else None

    def _line_time(self) -> float:
        return self._single.time if self._single else 0.0


def source_acquisition(folder: Path, rigs: Sequence[StereoRig]) -> tuple[str, Acquisition | None]:
    """Open the pictures that a folder was made of, where they are still in their place.

    Returns
    -------
    str
        The command that made the folder, as far as it says.
    Acquisition or None
    """
    command = ""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        command = str(record["command"])
        paths = [Path(source["path"]) for source in record["inputs"]]
        return command, _OPENERS[command](paths, tuple(rigs), record["options"])
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        return command, None


def _open_fluoroscopy(
    paths: list[Path], rigs: tuple[StereoRig, ...], options: dict[str, Any]
) -> Acquisition:
    from ..fluoroscopy import read_biplane

    acquisition = read_biplane(paths, dsa=bool(options.get("dsa")))
    # The geometry may have been refined.
    known = len(rigs) in (1, len(acquisition))
    return replace(acquisition, rigs=rigs) if known else acquisition


def _open_masks(
    paths: list[Path], rigs: tuple[StereoRig, ...], options: dict[str, Any]
) -> Acquisition:
    # The record holds all of view a, all of view b, and the rig's own file.
    half = len(paths) // 2

    def read(frame: int) -> tuple[Image, Image]:
        return masks.read_masks(paths[frame], paths[half + frame], rigs[:1]).read(0)

    read(0)
    lenses = read_calibration(paths[-1], image_size=rigs[0].a.image_size).lenses
    return Acquisition(read, rigs, np.arange(half, dtype=float), lenses=lenses)


def _open_endoscopy(
    paths: list[Path], rigs: tuple[StereoRig, ...], options: dict[str, Any]
) -> Acquisition:
    from ..endoscopy import read_stereo

    # The record holds all of the left eye, all of the right one, and the calibration's file.
    *pictures, rig = paths
    half = len(pictures) if options["layout"] else len(pictures) // 2
    return read_stereo(
        pictures[:half],
        pictures[half:] or None,
        rig,
        layout=options["layout"],
        right_first=options["right_first"],
        rectified=options["rectified"],
        check=False,
    )


_OPENERS = {
    "fluoroscopy": _open_fluoroscopy,
    "masks": _open_masks,
    "endoscopy": _open_endoscopy,
}
