"""An XMALab project: cameras, and the bead grids that show how image intensifiers distort.

A project is a folder (or the same in a zip, `.xma`) with a `project.xml` that names comma
separated files; J. Knörlein et al., "Validation of XMALab software for marker-based XROMM",
J. Exp. Biol. 219, 2016.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from stereosom.arrays import Floats

from ..errors import InputError, require
from ..lens import IntensifierLens, Lens
from .content import MOST_BYTES, numbers, parse_xml, read_bytes
from .model import Calibration, View, assemble
from .settings import Settings

SOURCE = "XMALab project"
_Read = Callable[[str], bytes]


def is_xmalab(path: Path) -> bool:
    """Whether a path is a project: its folder, its `project.xml`, or its `.xma`."""
    return (path / "project.xml").is_file() or path.name == "project.xml" or _is_zip(path)


def read_xmalab(path: Path, settings: Settings) -> Calibration:
    """Read a project with two calibrated cameras; camera 1 is view a.

    Raises
    ------
    InputError, ValueError
        Where it is broken, or holds no such cameras.
    """
    if _is_zip(path):
        with zipfile.ZipFile(path) as archive:
            return _project(_from_zip(archive, path), settings)
    folder = path if path.is_dir() else path.parent
    return _project(_from_folder(folder), settings)


def _project(read: _Read, settings: Settings) -> Calibration:
    root = parse_xml(read("project.xml").decode("utf-8", "replace"))
    cameras = root.findall("Camera")
    if len(cameras) != 2:
        raise ValueError(f"project.xml: has {len(cameras)} cameras; two views are needed")
    views = [_view(camera, read, settings) for camera in cameras]
    notes = []
    if settings.units is None:
        notes.append("lengths are read as mm; XMALab keeps those of its calibration object")
    if any(len(camera.findall("CalibrationImage")) > 1 for camera in cameras):
        notes.append("of several calibration pictures the first counts")
    return assemble(
        views[0], views[1], SOURCE, units=settings.units or "mm",
        image_size=settings.image_size, frame="world", notes=notes,
    )  # fmt: skip


def _view(camera: Element, read: _Read, settings: Settings) -> View:
    name = camera.get("Name", "camera")[:50]
    picture = camera.find("CalibrationImage")
    if picture is None or "CameraMatrix" not in camera.attrib:
        raise ValueError(f"project.xml: {name} is not calibrated; calibrate it in XMALab")
    turn, moved = (
        _table(_file(picture.find(tag), name), read)
        for tag in ("RotationMatrix", "TranslationVector")
    )
    intrinsics = _table(camera.get("CameraMatrix", ""), read)
    if picture.find("UndistortionParam") is not None or camera.get("isFlipped") == "1":
        raise ValueError(f"project.xml: {name} is flipped or has a lens model, which is not read; "
                         "export MayaCam 2.0")  # fmt: skip
    grid = camera.find("UndistortionGrid")
    lens: Lens | None = None
    if grid is not None and grid.get("isComputed", "1") == "1":
        seen, true = (
            _table(_file(grid.find(tag), name), read)
            for tag in ("GridPointsDistorted", "GridPointsReferences")
        )
        kept = grid.find("GridPointsInlier")
        if kept is not None and seen.shape == true.shape:
            inlier = _table(_file(kept, name), read).ravel() > 0
            if len(inlier) == len(seen):
                seen, true = seen[inlier], true[inlier]
        lens = IntensifierLens.fitted(seen, true)
    size = _picture_size(picture.get("Filename", ""), read) or settings.image_size
    return View(intrinsics, turn, moved, size, lens)


def _file(element: Element | None, name: str) -> str:
    if element is None or "Filename" not in element.attrib:
        raise ValueError(f"project.xml: {name} lacks a file of its calibration")
    return element.attrib["Filename"]


def _table(name: str, read: _Read) -> Floats:
    lines = read(name).decode("utf-8", "replace").split("\n")
    return numbers([line.split(",") for line in lines if line.strip()], PurePosixPath(name).name)


def _picture_size(name: str, read: _Read) -> tuple[int, int] | None:
    """Size of the calibration picture by its header; nothing is decoded."""
    pillow = require("PIL.Image", "fluoroscopy")
    broken = (InputError, OSError, ValueError, SyntaxError, pillow.DecompressionBombError)
    try:
        with pillow.open(io.BytesIO(read(name))) as picture:
            width, height = picture.size
    except broken:
        return None
    return int(width), int(height)


def _inner(name: str) -> PurePosixPath:
    """A file name of the project, which must stay inside it."""
    inner = PurePosixPath(name.replace("\\", "/"))
    if not name or inner.is_absolute() or ".." in inner.parts or ":" in name or "\0" in name:
        raise ValueError(f"project.xml: {name[:60]!r} is no file of the project")
    return inner


def _from_folder(folder: Path) -> _Read:
    return lambda name: read_bytes(folder / _inner(name), 32 * MOST_BYTES)


def _from_zip(archive: zipfile.ZipFile, path: Path) -> _Read:
    names = {member.filename.replace("\\", "/"): member for member in archive.infolist()}

    def read(name: str) -> bytes:
        member = names.get(str(_inner(name)))
        if member is None:
            raise InputError(path, f"has no {name[:60]}", "export the project again")
        try:
            with archive.open(member) as file:
                data = file.read(32 * MOST_BYTES + 1)
        except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, EOFError) as error:
            raise InputError(path, f"is a broken zip ({error})", "export it again") from None
        if len(data) > 32 * MOST_BYTES:
            raise InputError(path, f"{name[:60]} is too large", "give a calibration project")
        return data

    return read


def _is_zip(path: Path) -> bool:
    return path.is_file() and zipfile.is_zipfile(path)
