"""`read_calibration`: which format a file has, and who reads it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError
from .model import MM_PER, Calibration
from .rig_json import read_rig_json


def read_calibration(
    paths: str | Path | Sequence[str | Path],
    *,
    units: str | None = None,
    image_size: tuple[int, int] | None = None,
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
    if not files:
        raise InputError("calibration", "no file was given", "give one, or one per view")
    return read_rig_json(files[0])
