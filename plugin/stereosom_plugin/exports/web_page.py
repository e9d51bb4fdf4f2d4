"""A page that shows a run in any browser: one file, no network, no library."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from stereosom.arrays import Floats

from ..centerline import Centerline
from ..errors import InputError
from ..files import write_whole
from .samples import UNITS, check_color, sampled, value_range

_MOST_POINTS = 80
_MOST_BYTES = 64 << 20


def write_web_page(
    lines: Sequence[Centerline], path: str | Path, *, color_by: str | None = None
) -> None:
    """Write a page with the tubes of a run: turn, enlarge, play, color, read values.

    The page forbids itself every connection. Positions are rounded to a micrometre, other
    values to six digits.

    Parameters
    ----------
    lines : sequence of Centerline
        In order of time.
    path : path
    color_by : str, optional
        Point array that colors the tube at first. Default: curvature, where known.

    Raises
    ------
    InputError
        Where an array is missing or not finite, the run is too long for a page, or the file
        cannot be written.
    """
    color_by = check_color(lines, color_by)
    samples = [sampled(line, _MOST_POINTS) for line in lines]
    colors = [name for name in UNITS if all(name in sample.arrays for sample in samples)]
    run = {
        "colorBy": color_by or "",
        "colors": {
            name: _legend(name, [sample.arrays[name] for sample in samples]) for name in colors
        },
        "frames": [
            {
                "frame": line.frame,
                "time": line.time,
                "method": " ".join(_texts(line, "Method")),
                "points": [[round(float(x), 3) for x in point] for point in sample.points],
                "s": _digits(sample.s),
                "radius": _digits(sample.radius),
                "radiusKnown": "Radius" in sample.arrays,
                "arrays": {
                    name: _digits(sample.arrays[name])
                    for name in {*colors, "StandardDeviation"} & set(sample.arrays)
                },
            }
            for line, sample in zip(lines, samples, strict=True)
        ],
    }
    # Text in a file may hold anything; as JSON without "<" it cannot end the element it is in.
    data = json.dumps(run, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    if len(data) > _MOST_BYTES:
        raise InputError(path, "would be larger than 64 MiB", "choose a frame with --frame N")
    page = resources.files(__package__).joinpath("viewer.html").read_text("utf-8")
    page = page.replace("TITLE", html.escape(Path(path).stem), 1).replace("RUN_DATA", data, 1)
    with write_whole(path) as part:
        part.write_text(page, encoding="utf-8")


def _legend(name: str, values: Sequence[Floats]) -> dict[str, Any]:
    least, most = (float(find(np.concatenate(values))) for find in (np.min, np.max))
    return {"unit": UNITS[name], "range": value_range(values), "least": least, "most": most}


def _digits(values: Floats) -> list[float]:
    return [float(f"{value:.6g}") for value in values]


def _texts(line: Centerline, name: str) -> tuple[str, ...]:
    values: Any = line.field.get(name, ())
    return values if isinstance(values, tuple) else ()
