"""StereoMIS `.ini`: sections StereoLeft and StereoRight of a da Vinci endoscope."""

from __future__ import annotations

import numpy as np

from .content import Content, numbers
from .model import Calibration, View, assemble, lens_of
from .settings import Settings

SOURCE = "StereoMIS INI"


def read_stereomis(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read `fc_x, fc_y, cc_x, cc_y, kc_0 …, res_x, res_y`; the right one adds `R_0..8, T_0..2`."""
    if contents[0].kind != "ini":
        return None
    sections = {name.lower(): section for name, section in contents[0].tree.items()}
    if not {"stereoleft", "stereoright"} <= set(sections):
        raise ValueError("has no sections StereoLeft and StereoRight")
    right = sections["stereoright"]
    try:
        turn = [right[f"r_{index}"] for index in range(9)]
        moved = [right[f"t_{index}"] for index in range(3)]
        views = [
            _view(sections["stereoleft"], np.eye(3).tolist(), [0, 0, 0]),
            _view(right, turn, moved),
        ]
    except KeyError as missing:
        raise ValueError(f"{missing.args[0]} is missing") from None
    return assemble(
        views[0], views[1], SOURCE, units=settings.units or "mm",
        image_size=settings.image_size,
    )  # fmt: skip


def _view(section: dict[str, str], turn: object, moved: object) -> View:
    fx, fy, cx, cy = (float(numbers(section[name], name, ())) for name in
                      ("fc_x", "fc_y", "cc_x", "cc_y"))  # fmt: skip
    k = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
    count = next((n for n in (14, 12, 8, 5, 4) if f"kc_{n - 1}" in section), 0)
    bends = numbers([section[f"kc_{index}"] for index in range(count)] or [0.0] * 4, "kc")
    size = None
    if "res_x" in section and "res_y" in section:
        width, height = (int(numbers(section[name], name, ())) for name in ("res_x", "res_y"))
        size = (width, height)
    return View(k, numbers(turn, "R", (3, 3)), numbers(moved, "T", (3,)), size, lens_of(k, bends))
