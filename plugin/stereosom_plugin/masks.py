"""Pairs of mask pictures (PNG, TIFF, ...) and a rig -> Acquisition."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from stereosom.camera import StereoRig

from .acquisition import Acquisition, Image
from .errors import InputError, require
from .lens import Lens

_SUFFIXES = {".png", ".tif", ".tiff", ".bmp", ".pgm"}


def read_masks(
    a: str | Path,
    b: str | Path,
    rigs: tuple[StereoRig, ...],
    *,
    rate_hz: float | None = None,
    lenses: tuple[Lens, Lens] | None = None,
) -> Acquisition:
    """Read two pictures, or two folders of pictures that are paired in order of their names.

    Parameters
    ----------
    a, b : path
        Two files or two folders.
    rigs : tuple of StereoRig
        One for all frames, or one per frame.
    rate_hz : float, optional
        Frames per second; pictures carry no times. Default: one.
    lenses : pair of Lens, optional
        How both views distort. Default: not at all.

    Raises
    ------
    InputError
        Where files are missing, do not pair, are no pictures, or have another size than the
        rig says.
    """
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InputError("--rate", f"{rate_hz:g} is no frame rate", "give frames per second")
    files_a, files_b = _pictures(Path(a)), _pictures(Path(b))
    if len(files_a) != len(files_b):
        raise InputError(
            f"{a}, {b}",
            f"hold {len(files_a)} and {len(files_b)} pictures, which do not pair",
            "give both views the same frames",
        )
    if len(rigs) not in (1, len(files_a)):
        raise InputError(
            "rig",
            f"has {len(rigs)} projections for {len(files_a)} frames",
            "give one, or one per frame",
        )
    for file, camera in ((files_a[0], rigs[0].a), (files_b[0], rigs[0].b)):
        _check_size(file, camera.image_size)

    def read(index: int) -> tuple[Image, Image]:
        rig = rigs[index if len(rigs) > 1 else 0]
        return (
            read_picture(files_a[index], rig.a.image_size),
            read_picture(files_b[index], rig.b.image_size),
        )

    guessed = rate_hz is None and len(files_a) > 1
    return Acquisition(
        read,
        rigs,
        np.arange(len(files_a)) / (rate_hz or 1.0),
        sources=(*files_a, *files_b),
        notes=("no --rate was given: one frame per second is assumed",) if guessed else (),
        lenses=lenses,
    )


def read_picture(path: Path, size: tuple[int, int]) -> Image:
    """Read a picture of the given (width, height) as gray values, (rows, columns)."""
    _check_size(path, size)
    pillow = require("PIL.Image", "fluoroscopy")
    try:
        with pillow.open(path) as picture:
            # Modes with alpha or color become gray; 16-bit and float pictures stay what they are.
            gray = picture if picture.mode[0] in "1LIF" else picture.convert("L")
            image = np.asarray(gray)
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(path, f"cannot be read ({error})", "give a whole picture") from None
    return image if image.ndim == 2 else image[..., 0]


def _check_size(path: Path, size: tuple[int, int]) -> None:
    """Refuse a picture of another size by its header, before anything is decoded."""
    pillow = require("PIL.Image", "fluoroscopy")
    try:
        with pillow.open(path) as picture:
            found = picture.size
    except FileNotFoundError:
        raise InputError(path, "no such file", "check the path") from None
    except (OSError, SyntaxError, ValueError, pillow.DecompressionBombError) as error:
        raise InputError(path, f"is no picture ({error})", "give a PNG or TIFF mask") from None
    if found != tuple(size):
        raise InputError(
            path,
            f"is {found[0]}×{found[1]} pixels, the rig's picture is {size[0]}×{size[1]}",
            "give the mask and the rig of the same picture",
        )


def _pictures(path: Path) -> list[Path]:
    if not path.exists():
        raise InputError(path, "no such file or folder", "check the path")
    if not path.is_dir():
        return [path]
    found = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES)
    if not found:
        raise InputError(path, "holds no pictures", f"give one of {', '.join(sorted(_SUFFIXES))}")
    return found
