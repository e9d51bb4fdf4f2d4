"""MayaCam 2.0 text, one file per camera: what XMALab and Autoscoper exchange."""

from __future__ import annotations

import numpy as np

from stereosom.arrays import Floats

from .content import Content, numbers
from .model import Calibration, View, assemble, lens_of
from .settings import Settings
from .size import ordered_size

SOURCE = "MayaCam 2.0"
_BLOCKS = ("image size", "camera matrix", "rotation", "translation", "undistortion")


def read_mayacam(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read a pair: plane A, then plane B.

    x ~ K (R X + t), X in the axes and units of the calibration object. XMALab writes width,
    height; elsewhere the reverse is found. Some files drop the 0 that begins the second row of
    K. An `undistortion` block holds OpenCV's coefficients in OpenCV's order.
    """
    if not all(content.kind == "text" for content in contents):
        return None
    if len(contents) != 2:
        raise ValueError("is one camera's MayaCam text; give both files")
    read = [_view(content, settings) for content in contents]
    (a, notes_a), (b, notes_b) = read
    notes = dict.fromkeys((*notes_a, *notes_b))
    return assemble(
        a, b, SOURCE, units=settings.units or "mm", image_size=settings.image_size,
        frame="world", notes=tuple(notes),
    )  # fmt: skip


def _view(content: Content, settings: Settings) -> tuple[View, tuple[str, ...]]:
    blocks = _blocks(content.tree)
    missing = [name for name in _BLOCKS[:4] if name not in blocks]
    if missing:
        raise ValueError(f"{content.path.name}: has no block {missing[0]!r}")
    rows = blocks["camera matrix"]
    if len(rows) == 3 and len(rows[1]) == 2:
        rows = [rows[0], ["0", *rows[1]], rows[2]]
    k = numbers(rows, "camera matrix", (3, 3))
    size, notes = ordered_size(_flat(blocks["image size"], "image size", 2), [k],
                               settings.image_size)  # fmt: skip
    bends = _flat(blocks["undistortion"], "undistortion") if "undistortion" in blocks else [0.0] * 4
    view = View(
        k,
        numbers(blocks["rotation"], "rotation", (3, 3)),
        _flat(blocks["translation"], "translation", 3),
        size,
        lens_of(k, bends),
    )
    return view, notes


def _blocks(text: str) -> dict[str, list[list[str]]]:
    blocks: dict[str, list[list[str]]] = {}
    rows: list[list[str]] | None = None
    for line in text.splitlines():
        name = line.strip().lower().rstrip(":")
        if name in _BLOCKS:
            rows = blocks.setdefault(name, [])
        elif name and rows is not None:
            cells = [cell.strip() for cell in (line.split(",") if "," in line else line.split())]
            # An empty first cell is the 0 that was dropped, an empty last one a loose comma.
            rows.append([cell or "0" for cell in (cells[:-1] if cells[-1] == "" else cells)])
    return blocks


def _flat(rows: list[list[str]], name: str, count: int | None = None) -> Floats:
    values = numbers([cell for row in rows for cell in row], name)
    if count is not None and len(values) != count:
        raise ValueError(f"{name}: must be {count} numbers, is {len(values)}")
    return np.asarray(values)
