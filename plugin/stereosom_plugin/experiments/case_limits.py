"""Cases with known truth, one by one: what was reached, beside what can be reached.

    python -m stereosom_plugin.experiments.case_limits FOLDER [CASE ...]

prints a row for each folder of `a.png`, `b.png`, `rig.json`, `case.json` (`radius_mm`) and
`truth.csv` inside FOLDER.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from stereosom.observation import Observation
from stereosom.reconstruct import reconstruct

from ..calibration import read_rig
from ..evaluation import compare, read_truth, visible_stretch
from ..masks import read_masks
from ..segmentation import binary
from .confidence import offsets
from .cramer_rao import cramer_rao_bound

_TITLES = (
    "bound", "worst", "no-width", "base", "tip", "|", "mean", "distance", "across", "base",
    "tip", "|", "sd", "sd/bound", "inside", "base", "tip", "open", "s",
)  # fmt: skip


def report(folder: Path, only: Sequence[str] = ()) -> Iterator[str]:
    """Lines of a table, in mm.

    Of the bound: its median and largest standard deviation inside, the largest without apparent
    width, at the base, at the tip. Of the result: mean at equal arc length, mean distance,
    median offset across, of base, of tip. Of what it states: median deviation, its median ratio
    to the bound, share of the true points inside their 95 % regions, levels (χ²) of base and tip,
    share of points not determined, seconds.
    """
    yield f"{'case':>12}" + "".join(f"{one:>{3 if one == '|' else 9}}" for one in _TITLES)
    for case in sorted(folder.iterdir()):
        if (case / "truth.csv").exists() and (not only or case.name in only):
            yield _row(case)


def _row(case: Path) -> str:
    rigs = read_rig(case / "rig.json")
    rig, truth = rigs[0], read_truth(case / "truth.csv")
    radius = float(json.loads((case / "case.json").read_text(encoding="utf-8"))["radius_mm"])
    stretch = visible_stretch(truth, rig)
    inner = slice(1, -1)
    bound = cramer_rao_bound(truth, radius, rig, stretch=stretch)
    no_width = cramer_rao_bound(truth, radius, rig, stretch=stretch, width_seen=False)
    limit = bound.standard_deviation
    numbers = [
        np.median(limit[inner]),
        limit[inner].max(),
        no_width.standard_deviation[inner].max(),
    ]
    line = f"{case.name:>12}" + _cells(*numbers, limit[0], limit[-1]) + "  |"
    images = read_masks(case / "a.png", case / "b.png", rigs).read(0)
    seen = Observation.from_masks(binary(images[0]), binary(images[1]), rig)
    started = perf_counter()
    result = reconstruct(seen)
    seconds = perf_counter() - started
    if not result.ok:
        return f"{line} {result.status}: {result.reason}"
    found = offsets(result, truth, stretch=stretch)
    curve = found.result.backbone
    assert curve is not None  # it is ok
    errors = compare(curve, truth, rig)
    across = np.median(np.linalg.norm(found.offset[inner], axis=1))
    line += _cells(errors.mean, errors.distance, across, errors.base, errors.tip) + "  |"
    sharpness = np.median(found.deviation[inner] / limit[inner])
    share = np.mean(found.level[inner] <= 0.95)
    line += _cells(np.median(found.deviation[inner]), sharpness, share)
    line += _cells(found.level[0], found.level[-1], np.mean(~found.determined), seconds)
    return line + ("  turned" if found.turned else "")


def _cells(*numbers: Any) -> str:
    return "".join(f"{number:9.3f}" for number in numbers)


if __name__ == "__main__":
    for text in report(Path(sys.argv[1]), sys.argv[2:]):
        print(text, flush=True)
