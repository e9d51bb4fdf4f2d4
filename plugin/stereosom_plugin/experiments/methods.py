"""Every method on the same masks: our yardstick.

The masks are rendered by VTK, flat-ended and without noise; every method is told the true base,
so that none is charged for what nothing in a mask decides. `marker-arcs` gets painted bands.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from stereosom.arrays import Booleans
from stereosom.backbone import Backbone
from stereosom.baselines import marker_arcs
from stereosom.camera import Camera, StereoRig
from stereosom.metrics import closest_on_curve, curve_errors
from stereosom.observation import Observation
from stereosom.options import Options, Prior
from stereosom.reconstruct import METHODS, reconstruct
from stereosom.stereo_som import METHOD as STEREO_SOM
from stereosom.synthetic import converging_rig, growing_helix, painted_bands

from ..errors import require
from ..files import write_whole
from . import Progress, mockup

_BANDS = 16
# Half-way between the tube's gray and the background's; bands are darker than both.
_TUBE, _GROUND = 0, 255


@dataclass(frozen=True, eq=False)
class Family:
    """A kind of device before a kind of rig."""

    name: str
    curve: Backbone
    radius: float
    rig: StereoRig


def families() -> list[Family]:
    """The mock-up at three angles, a thin cannula, and a loop that crosses itself in a view."""
    s = np.linspace(0, 1, 300)[:, None]
    cannula = np.where(s < 0.4, 0, (s - 0.4) ** 2) * [110, 0, 0]
    cannula = cannula + np.where(s < 0.7, 0, (s - 0.7) ** 2) * [-60, 260, 0] + s * [0, 0, 110]
    angle = 2 * np.pi * 1.15 * s
    loop = np.hstack([6 * s * 10, 32 * np.sin(angle), 75 - 50 * np.cos(angle) * (1 - 0.3 * s)])
    helix = growing_helix()
    return [
        Family("mock-up 45°", helix, 3.2, converging_rig(45)),
        Family("mock-up 20°", helix, 3.2, converging_rig(20)),
        Family("mock-up 90°", helix, 3.2, converging_rig(90)),
        Family("cannula 75°", Backbone.through(cannula), 0.6,
               converging_rig(75, distance=650, focal_length=3000, target=(0, 0, 55))),
        Family("loop 70°", Backbone.through(loop), 1.5, converging_rig(70, focal_length=2600)),
    ]  # fmt: skip


@dataclass(frozen=True)
class Run:
    """One method on one pose; errors in mm, empty where nothing was found."""

    family: str
    method: str
    pose: int
    found: bool
    right: bool
    mean: float
    p95: float
    maximum: float
    tip: float
    seconds: float
    points: int
    reason: str


def run(
    output: Path,
    *,
    progress: Progress = iter,
    poses: int = 3,
    only: Sequence[str] | None = None,
    methods: Sequence[str] | None = None,
) -> str:
    """Run every method on every family; write the tables and a figure; return the table.

    Parameters
    ----------
    output : Path
    progress : callable
    poses : int
        Of each family: turned about the base axis, and moved by up to 8 mm.
    only, methods : sequence of str, optional
        Families and methods to keep to.
    """
    output.mkdir(parents=True, exist_ok=True)
    jobs = [
        (family, number, pose)
        for family in families()
        if only is None or family.name in only
        for number, pose in enumerate(mockup.poses(poses, seed=7, reach=8.0))
    ]
    runs = []
    for family, number, pose in progress(jobs):
        # A loop is a loop from some sides only: it is moved, not turned.
        turn = np.eye(3) if family.name.startswith("loop") else pose.rotation
        truth = family.curve.transformed(turn, pose.translation)
        runs += [
            _try(family, method, number, truth, _observe(family, truth, method))
            for method in methods or METHODS
        ]
    _write(output / "methods_runs.csv", [vars(one) for one in runs])
    table = _summarize(runs)
    _write(output / "methods.csv", table)
    _draw(table, output / "methods.png")
    return _as_text(table)


def _observe(family: Family, truth: Backbone, method: str) -> Observation:
    """Masks of the device, or of the bands painted on it."""
    painted = method == marker_arcs.METHOD
    tubes = painted_bands(truth, _BANDS) if painted else [truth]
    masks = []
    for camera in (family.rig.a, family.rig.b):
        mask = np.zeros(camera.image_size[::-1], dtype=bool)
        for tube in tubes:
            mask |= _mask(tube, family.radius, camera)
        masks.append(mask)
    return Observation.from_masks(masks[0], masks[1], family.rig)


def _mask(tube: Backbone, radius: float, camera: Camera) -> Booleans:
    picture = mockup.render_tube(
        tube, radius, camera, gray=_TUBE, background=_GROUND, light=None, oversampling=2
    )
    return np.asarray(picture < (_TUBE + _GROUND) / 2)


def _try(family: Family, method: str, pose: int, truth: Backbone, seen: Observation) -> Run:
    options = Options(prior=Prior(base=truth.base))
    started = perf_counter()
    result = reconstruct(seen, method=method, options=options)
    seconds = perf_counter() - started
    pixels = len(seen.pixels_a) + len(seen.pixels_b)
    points = min(1600, pixels) if method == STEREO_SOM else pixels
    nothing = float("nan")
    errors, right = (nothing,) * 4, False
    if result.backbone is not None:
        found = curve_errors(result.backbone, truth)
        errors = (found.mean, found.p95, found.maximum, found.tip)
        _, at = closest_on_curve(result.backbone.sample(100), truth)
        covers = (at.max() - at.min()) / truth.length
        right = bool(np.diff(at).min() > -0.02 * truth.length and covers > 0.9)
    return Run(family.name, method, pose, result.ok, right, *errors, seconds, points, result.reason)


def _summarize(runs: Sequence[Run]) -> list[dict[str, Any]]:
    table = []
    for family, method in dict.fromkeys((one.family, one.method) for one in runs):
        group = [one for one in runs if (one.family, one.method) == (family, method)]
        found = [one for one in group if one.found]
        row: dict[str, Any] = {"family": family, "method": method, "runs": len(group)}
        row["right_topology"] = round(float(np.mean([one.right for one in group])), 2)
        for name, fold in (("mean", np.mean), ("p95", np.mean), ("maximum", np.max),
                           ("tip", np.mean)):  # fmt: skip
            values = [getattr(one, name) for one in found]
            row[f"{name}_mm"] = round(float(fold(values)), 4) if values else "n/a"
        row["seconds"] = round(float(np.median([one.seconds for one in group])), 4)
        row["points"] = int(np.mean([one.points for one in group]))
        table.append(row)
    return table


def _as_text(table: Sequence[dict[str, Any]]) -> str:
    names = list(table[0])
    lines = ["| " + " | ".join(names) + " |", "|" + " --- |" * len(names)]
    lines += ["| " + " | ".join(str(row[name]) for name in names) + " |" for row in table]
    return "\n".join(lines)


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    with write_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _draw(table: Sequence[dict[str, Any]], path: Path) -> None:
    """Mean error of each method by family, on a logarithmic scale."""
    agg = require("matplotlib.backends.backend_agg", "vtk")
    figure = require("matplotlib.figure", "vtk").Figure(figsize=(10, 4.5), layout="constrained")
    axes = figure.add_subplot()
    names = list(dict.fromkeys(row["family"] for row in table))
    methods = list(dict.fromkeys(row["method"] for row in table))
    for number, method in enumerate(methods):
        rows = {row["family"]: row for row in table if row["method"] == method}
        at = np.arange(len(names)) + (number - len(methods) / 2 + 0.5) * 0.8 / len(methods)
        height = [
            rows[name]["mean_mm"] if rows[name]["mean_mm"] != "n/a" else np.nan for name in names
        ]
        axes.bar(at, height, 0.75 / len(methods), label=method)
    axes.set(yscale="log", ylabel="mean error at equal arc length (mm)")
    axes.set_xticks(np.arange(len(names)), names)
    axes.legend(ncols=4, fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, 1.16))
    axes.spines[["top", "right"]].set_visible(False)
    with write_whole(path) as part:
        agg.FigureCanvasAgg(figure).print_png(part)
