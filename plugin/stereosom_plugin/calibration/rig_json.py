"""`rig.json`: the project's own file of the geometry of both views."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy import linalg

from stereosom.arrays import Floats, check_array
from stereosom.camera import Camera, Frame, StereoRig

from ..errors import InputError
from ..files import write_whole
from ..lens import IntensifierLens, Lens
from .model import Calibration, lens_of, pair_of

SOURCE = "rig.json"
_MOST_BYTES = 64 << 20
_MEND = "see docs/conventions.md for the layout of a rig.json"
_LENS_MODELS = ("radial-tangential", "fisheye", "intensifier")


def read_rig(path: str | Path) -> tuple[StereoRig, ...]:
    """Read the rigs of a `rig.json`: one, or one per frame where the geometry moves.

    Lenses are left aside: `read_calibration` gives them too.

    Returns
    -------
    tuple of StereoRig
        In mm. The sign of a projection is chosen so that the field which both views share
        lies in front of both cameras.

    Raises
    ------
    InputError
        Where the file is missing, no JSON, or describes no rig.
    """
    return read_rig_json(path).rigs


def read_rig_json(path: str | Path) -> Calibration:
    """Read a `rig.json`, rigs and lenses.

    Raises
    ------
    InputError
        As `read_rig`.
    """
    path = Path(path)
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(path, "is too large for a rig.json", "give the right file")
        described = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    except (ValueError, RecursionError) as error:
        raise InputError(path, f"is no JSON ({error})", _MEND) from None
    try:
        return calibration_of(described)
    except ValueError as error:
        why, _, mend = str(error).partition("; ")
        raise InputError(path, why, mend or _MEND) from None


def write_rig(
    rigs: Sequence[StereoRig], path: str | Path, lenses: tuple[Lens, Lens] | None = None
) -> None:
    """Write a `rig.json`; several rigs become a list of matrices, one per frame."""
    cameras = []
    for name, lens in zip("ab", lenses or (None, None), strict=True):
        views: list[Camera] = [getattr(rig, name) for rig in rigs]
        matrices = [view.projection.tolist() for view in views]
        camera = {
            "name": name,
            "image_size": list(views[0].image_size),
            "projection": matrices if len(rigs) > 1 else matrices[0],
        }
        cameras.append(camera | (lens.described() if lens else {}))
    described = {"units": "mm", "frame": rigs[0].frame, "cameras": cameras}
    with write_whole(path) as part:
        part.write_text(json.dumps(described, indent=1) + "\n", encoding="utf-8")


def calibration_of(described: Any) -> Calibration:
    """Make the calibration that a parsed `rig.json` describes, or raise ValueError."""
    if not isinstance(described, dict):
        raise ValueError("is no object with units, frame and cameras")
    if described.get("units", "mm") != "mm":
        raise ValueError(f"units: {described['units']!r} are not mm; convert the geometry to mm")
    frame = described.get("frame", "world")
    if frame not in get_args(Frame):
        raise ValueError(f"frame: {frame!r} is none of {', '.join(get_args(Frame))}")
    cameras = described.get("cameras")
    if not isinstance(cameras, list) or len(cameras) != 2:
        raise ValueError("cameras: must be a list of two")
    views = [_view(camera, name) for camera, name in zip(cameras, "ab", strict=True)]
    (matrices_a, size_a, known_a, lens_a), (matrices_b, size_b, known_b, lens_b) = views
    count = max(len(matrices_a), len(matrices_b))
    if {len(matrices_a), len(matrices_b)} - {1, count}:
        raise ValueError(
            f"cameras: view a has {len(matrices_a)} projections, view b {len(matrices_b)}"
        )
    rigs = []
    for index in range(count):
        matrix_a = matrices_a[min(index, len(matrices_a) - 1)]
        matrix_b = matrices_b[min(index, len(matrices_b) - 1)]
        if known_a and known_b:
            rigs.append(StereoRig(Camera(matrix_a, size_a), Camera(matrix_b, size_b), frame))
        else:
            rigs.append(StereoRig.from_projections(matrix_a, matrix_b, size_a, size_b, frame))
    return Calibration(tuple(rigs), pair_of(lens_a, lens_b), SOURCE)


def _view(camera: Any, name: str) -> tuple[list[Any], tuple[int, int], bool, Lens | None]:
    """Projection matrices of a camera, its image size, whether their sign is known, its lens."""
    if not isinstance(camera, dict):
        raise ValueError(f"camera {name}: is no object")
    try:
        size = camera["image_size"]
        if "projection" in camera:
            matrices = np.asarray(camera["projection"], dtype=float)
            if matrices.ndim == 2:
                matrices = matrices[None]
            if matrices.ndim != 3 or matrices.shape[1:] != (3, 4) or len(matrices) == 0:
                shape = "×".join(str(length) for length in matrices.shape[-2:])
                raise ValueError(f"projection must be 3×4, is {shape}")
            known = False
        else:
            posed = Camera.from_pose(
                camera["intrinsics"], camera["rotation"], camera["translation"], size
            )
            matrices, known = posed.projection[None], True
        Camera(matrices[0], size)
        lens = _lens(camera, matrices[0])
    except KeyError as missing:
        raise ValueError(f"camera {name}: {missing.args[0]} is missing") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"camera {name}: {error}") from None
    return list(matrices), size, known, lens


def _lens(camera: dict[str, Any], matrix: Floats) -> Lens | None:
    if "distortion" not in camera:
        return None
    model = camera.get("distortion_model", _LENS_MODELS[0])
    if model not in _LENS_MODELS:
        raise ValueError(f"distortion_model: {model!r} is none of {', '.join(_LENS_MODELS)}")
    if model == "intensifier":
        low, high = check_array(camera["distortion_box"], "distortion_box", (2, 2))
        return IntensifierLens(low, high, camera["distortion"])
    intrinsics = camera["intrinsics"] if "intrinsics" in camera else _intrinsics(matrix)
    return lens_of(intrinsics, camera["distortion"], fisheye=model == "fisheye")


def _intrinsics(matrix: Floats) -> Floats:
    """K of a projection K [R | t], with a positive diagonal (Hartley and Zisserman, 6.2.4)."""
    upper = linalg.rq(matrix[:, :3])[0]
    upper = upper * np.sign(np.diag(upper))
    return np.asarray(upper / upper[2, 2])
