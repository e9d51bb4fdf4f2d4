"""`read_calibration`: which format a file has, and who reads it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from .content import Content, read_content
from .matlab import read_matlab
from .mayacam import read_mayacam
from .model import MM_PER, Calibration, checked_size
from .named_matrices import read_named_matrices
from .plausibility import doubts
from .rig_json import calibration_of
from .ros import read_ros
from .rtk import read_rtk
from .settings import Settings
from .stereomis import read_stereomis
from .two_view import read_two_view
from .xmalab import is_xmalab, read_xmalab

# Each takes the file (or the pair) if it is of its format, else returns None.
_READERS = (
    read_mayacam, read_rtk, read_ros, read_stereomis, read_matlab, read_two_view,
    read_named_matrices,
)  # fmt: skip
_MEND = "see docs/calibration.md for what each format needs"


def read_calibration(
    paths: str | Path | Sequence[str | Path],
    *,
    units: str | None = None,
    image_size: tuple[int, int] | None = None,
    rectified: bool = False,
    fisheye: bool = False,
    pixel_spacing: float | None = None,
    pitch: float | None = None,
) -> Calibration:
    """Read a calibration of two views, whatever wrote it.

    Parameters
    ----------
    paths : path or sequence of paths
        One file that holds both views, or one file per view: first view a (left), then view b.
    units : {'mm', 'cm', 'm', 'in'}, optional
        Of the file's translations. Default: what its format prescribes, else mm.
    image_size : (int, int), optional
        Width and height of the pictures, px, for formats that do not say it. Where the file
        says another size, that is an error.
    rectified : bool
        Take the matrices P1 and P2 of rectified pictures, where the file has both.
    fisheye : bool
        Four distortion coefficients are those of OpenCV's fisheye model.
    pixel_spacing : float, optional
        mm on the detector, for RTK.
    pitch : float, optional
        mm between neighboring dots, for a fundamental matrix.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        Where a file is missing, unreadable, hostile, of no known format, or describes no rig.
    """
    files = [Path(paths)] if isinstance(paths, str | Path) else [Path(path) for path in paths]
    if units is not None and units not in MM_PER:
        raise InputError("--units", f"{units!r} are unknown", f"give one of {', '.join(MM_PER)}")
    for name, value in (("--pixel-spacing", pixel_spacing), ("--pitch", pitch)):
        if value is not None and not 0 < value < float("inf"):
            raise InputError(name, f"{value} is no length", "give millimetres")
    if len(files) not in (1, 2):
        raise InputError(
            "calibration", f"{len(files)} files were given", "give one, or one per view"
        )
    settings = Settings(units, image_size, rectified, fisheye, pixel_spacing, pitch)
    what = ", ".join(str(file) for file in files)
    try:
        found = _read(files, settings)
        if image_size is not None:
            for camera in (found.rigs[0].a, found.rigs[0].b):
                checked_size(camera.image_size, image_size)
    except InputError:
        raise
    except (ValueError, ArithmeticError) as error:
        why, _, mend = " ".join(str(error).split()).partition("; ")
        raise InputError(what, why[:300], mend or _MEND) from None
    notes = (*found.notes, *doubts(found, settings))
    return Calibration(found.rigs, found.lenses, found.source, notes)


def _read(files: list[Path], settings: Settings) -> Calibration:
    if len(files) == 1 and is_xmalab(files[0]):
        return read_xmalab(files[0], settings)
    contents = [read_content(file) for file in files]
    if _is_rig_json(contents[0]):
        if len(contents) == 2 or settings.units not in (None, "mm"):
            raise ValueError("is a rig.json, which holds both views in mm; give it alone")
        return calibration_of(contents[0].tree)
    for reader in _READERS:
        found = reader(contents, settings)
        if found is not None:
            return found
    if len({content.kind for content in contents}) > 1:
        raise ValueError("are of different formats; give two files of one calibration")
    raise ValueError("is no calibration that is known")


def _is_rig_json(content: Content) -> bool:
    return content.kind == "json" and "cameras" in content.tree
