"""MATLAB's stereoParameters, as the struct or the JSON of `toStruct`.

The object itself is a MATLAB class, which no other program can read. In MATLAB,

    s = toStruct(stereoParams); save('stereo.mat', 's', '-v7')

or `fprintf(fopen('stereo.json', 'w'), jsonencode(toStruct(stereoParams)))` says all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stereosom.arrays import Floats

from .content import Content, numbers
from .model import Calibration, View, assemble, lens_of
from .settings import Settings

SOURCE = "MATLAB stereoParameters"
_UNITS = {
    "mm": "mm", "millimeters": "mm", "cm": "cm", "centimeters": "cm", "m": "m", "meters": "m",
    "in": "in", "inches": "in",
}  # fmt: skip


def read_matlab(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read stereoParameters as a struct.

    MATLAB multiplies rows from the left: its IntrinsicMatrix is Kᵀ, and x₂ = x₁ R + t
    (documentation of the Computer Vision Toolbox), so that R is transposed too. Its pixels
    count from one: the principal point moves by one.
    """
    if contents[0].kind not in ("json", "mat"):
        return None
    tree = contents[0].tree
    found = next((part for part in (tree, *tree.values()) if _is_stereo(part)), None)
    if found is None:
        if any(value == "object" for value in tree.values()):
            raise ValueError(
                "holds a MATLAB object, which only MATLAB reads; "
                "save s = toStruct(stereoParams) with -v7 instead"
            )
        return None
    units = _UNITS.get(str(found["CameraParameters1"].get("WorldUnits", "mm")).lower())
    turn = numbers(found["RotationOfCamera2"], "RotationOfCamera2", (3, 3)).T
    moved = numbers(found["TranslationOfCamera2"], "TranslationOfCamera2", (3,))
    a = _view(found["CameraParameters1"], np.eye(3), np.zeros(3))
    b = _view(found["CameraParameters2"], turn, moved)
    return assemble(
        a, b, SOURCE, units=settings.units or units or "mm", image_size=settings.image_size
    )


def _is_stereo(part: Any) -> bool:
    return isinstance(part, dict) and all(
        name in part
        for name in ("CameraParameters1", "CameraParameters2", "RotationOfCamera2",
                     "TranslationOfCamera2")
    ) and all(isinstance(part[f"CameraParameters{n}"], dict) for n in (1, 2))  # fmt: skip


def _view(parameters: dict[str, Any], turn: Floats, moved: Floats) -> View:
    named = "IntrinsicMatrix" if parameters.get("IntrinsicMatrix") is not None else "K"
    if parameters.get(named) is None:
        raise ValueError("a camera has neither IntrinsicMatrix nor K")
    k = numbers(parameters[named], named, (3, 3))
    k = k.T if np.any(k[2, :2] != 0) else k
    k = k - [[0, 0, 1], [0, 0, 1], [0, 0, 0]]
    radial = numbers(parameters.get("RadialDistortion", [0, 0]), "RadialDistortion").ravel()
    bends = numbers(parameters.get("TangentialDistortion", [0, 0]), "TangentialDistortion", (2,))
    if len(radial) not in (2, 3):
        raise ValueError(f"RadialDistortion: must be 2 or 3 numbers, is {len(radial)}")
    size = None
    said = parameters.get("ImageSize")
    if said is not None and np.size(said):
        rows, columns = (int(side) for side in numbers(said, "ImageSize", (2,)))
        size = (columns, rows)
    return View(k, turn, moved, size, lens_of(k, [*radial[:2], *bends, *radial[2:]]))
