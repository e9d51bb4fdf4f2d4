"""`rig.json`: the geometry of both views in a file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import numpy as np

from stereosom.camera import Camera, Frame, StereoRig

from .errors import InputError
from .files import write_whole

_MOST_BYTES = 64 << 20
_MEND = "see docs/conventions.md for the layout of a rig.json"


def read_rig(path: str | Path) -> tuple[StereoRig, ...]:
    """Read a `rig.json`: one rig, or one per frame where the geometry moves.

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
        return _rigs(described)
    except ValueError as error:
        why, _, mend = str(error).partition("; ")
        raise InputError(path, why, mend or _MEND) from None


def write_rig(rigs: Sequence[StereoRig], path: str | Path) -> None:
    """Write a `rig.json`; several rigs become a list of matrices, one per frame."""
    cameras = []
    for name in ("a", "b"):
        views: list[Camera] = [getattr(rig, name) for rig in rigs]
        matrices = [view.projection.tolist() for view in views]
        cameras.append(
            {
                "name": name,
                "image_size": list(views[0].image_size),
                "projection": matrices if len(rigs) > 1 else matrices[0],
            }
        )
    described = {"units": "mm", "frame": rigs[0].frame, "cameras": cameras}
    with write_whole(path) as part:
        part.write_text(json.dumps(described, indent=1) + "\n", encoding="utf-8")


def _rigs(described: Any) -> tuple[StereoRig, ...]:
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
    views = [_matrices(camera, name) for camera, name in zip(cameras, "ab", strict=True)]
    (matrices_a, size_a, known_a), (matrices_b, size_b, known_b) = views
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
    return tuple(rigs)


def _matrices(camera: Any, name: str) -> tuple[list[Any], tuple[int, int], bool]:
    """Projection matrices of a camera, its image size, and whether their sign is known."""
    if not isinstance(camera, dict):
        raise ValueError(f"camera {name}: is no object")
    try:
        size = camera["image_size"]
        distortion = np.asarray(camera.get("distortion", 0.0), dtype=float)
        if np.any(distortion != 0):
            raise ValueError(
                "lens distortion is not supported yet; give undistorted masks and leave it out"
            )
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
    except KeyError as missing:
        raise ValueError(f"camera {name}: {missing.args[0]} is missing") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"camera {name}: {error}") from None
    return list(matrices), size, known
