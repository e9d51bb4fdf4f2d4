"""Section III and Table I of the paper, on rendered pictures of the mock-up.

J. M. Croom, D. C. Rucker, J. M. Romano, R. J. Webster III, "Visual sensing of continuum robot
shape using self-organizing maps", IEEE ICRA 2010.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.camera import StereoRig
from stereosom.metrics import closest_on_curve, curve_errors, register_rigid
from stereosom.observation import Observation
from stereosom.options import Prior
from stereosom.reconstruction import HardFrame
from stereosom.stereo_som import StereoSomOptions, stereo_som, train_stereo_map
from stereosom_plugin.segmentation.endoscope.edges import edge_mask

from ..files import write_whole
from . import Progress, mockup

# The paper's Table I: number of Q's -> mean error (mm), its standard deviation, mean time (s).
PAPER = {
    20: (3.14, 0.68, 0.188),
    30: (1.94, 0.42, 0.195),
    40: (1.73, 0.29, 0.232),
    50: (1.53, 0.31, 0.248),
    60: (1.59, 0.27, 0.311),
    70: (1.60, 0.28, 0.365),
    80: (1.60, 0.43, 0.636),
    90: (1.78, 1.00, 0.724),
    100: (1.88, 0.93, 0.993),
}
# D_max is not given in the paper. The first lets the loop end after its first pass, as the
# paper reports of its own; the second is the default here.
MISMATCHES = (0.01, StereoSomOptions().max_mismatch)
POINTS, START_MM, THRESHOLD, POSES = 800, 150.0, 12.0, 20


@dataclass(frozen=True, eq=False)
class Case:
    """One pose: the true curve, both pictures, their edge pixels, and 800 of each."""

    truth: Backbone
    rig: StereoRig
    images: tuple[mockup.Gray, mockup.Gray]
    edges: tuple[Floats, Floats]
    points: tuple[Floats, Floats]


@dataclass(frozen=True, eq=False)
class Run:
    """One reconstruction and how it compares with the truth.

    `error` is the mean over 100 points after rigid registration, `unregistered` without it,
    mm; `backward` counts steps from one reference vector to the next that lead back towards
    the base; `first_pass` says whether the first pass through the loop gave the result;
    `refused` is the method's own word.
    """

    pose: int
    count: int
    max_mismatch: float
    references: Floats
    curve: Backbone
    arc_lengths: Floats
    error: float
    unregistered: float
    seconds: float
    backward: int
    first_pass: bool
    refused: str


def run(
    output: Path,
    *,
    progress: Progress = iter,
    poses: int = POSES,
    counts: Sequence[int] = tuple(PAPER),
    figures: bool = True,
) -> str:
    """Run the experiment; write the tables and figures.

    Parameters
    ----------
    output : path
        A folder; made where it is not there.
    progress : callable
        Wraps the loop over the poses.
    poses : int
    counts : sequence of int
        Numbers of reference vectors.
    figures : bool
        Whether to draw them.

    Returns
    -------
    str
        The paper's Table I beside ours.
    """
    output = Path(output)
    output.mkdir(parents=True, exist_ok=True)
    cases: list[Case] = []
    runs: list[Run] = []
    for number, pose in enumerate(progress(mockup.poses(poses))):
        case = observe(pose, seed=number)
        if not cases:
            reconstruct(case, number, counts[0], MISMATCHES[0])  # the first call is slower
        cases.append(case)
        runs += [reconstruct(case, number, k, most) for most in MISMATCHES for k in counts]
    rows = [summarize([r for r in runs if (r.max_mismatch, r.count) == (most, k)])
            for most in MISMATCHES for k in counts]  # fmt: skip
    write_csv(output / "table1.csv", rows)
    write_csv(output / "table1_poses.csv", map(_pose_row, runs))
    if figures:
        from .table1_figures import draw

        draw(output, cases, runs)
    return table(rows)


# ---- one pose ------------------------------------------------------------------------


def observe(pose: mockup.Pose, seed: int) -> Case:
    """Photograph the mock-up in a pose and draw 800 edge pixels of each view."""
    rig, truth = mockup.overhead_rig(), pose.of(mockup.backbone())
    rng = np.random.default_rng(seed)
    images, edges, points = [], [], []
    for view, camera in enumerate((rig.a, rig.b)):
        images.append(mockup.photograph(truth, mockup.RADIUS, camera, seed=2 * seed + view))
        rows, columns = np.nonzero(edge_mask(images[-1], THRESHOLD))
        edges.append(np.column_stack([columns, rows]).astype(float))
        points.append(edges[-1][rng.choice(len(rows), POINTS, replace=False)])
    return Case(truth, rig, (images[0], images[1]), (edges[0], edges[1]), (points[0], points[1]))


def reconstruct(case: Case, pose: int, count: int, max_mismatch: float) -> Run:
    """Run Algorithm 1 as printed, from a straight line of 150 mm, and measure.

    The time is that of `stereo_som` alone. Where it refuses its own result the paper's
    algorithm would not have: so the error is that of the curve all the same.
    """
    truth, z = case.truth, mockup.AXIS
    options = StereoSomOptions(
        prior=Prior(base=truth.base, direction=z, length=START_MM),
        reference_vectors=count,
        points_per_view=POINTS,
        max_mismatch=max_mismatch,
        reach_ends=False,
    )
    begin, refused = perf_counter(), ""
    try:
        stereo_som(Observation(*case.points, case.rig, kind="edges"), options=options)
    except HardFrame as hard:
        refused = str(hard)
    seconds = perf_counter() - begin
    start = truth.base + np.linspace(0, START_MM, count)[:, None] * z
    references = train_stereo_map(case.rig, case.points, start, options)
    once = StereoSomOptions(max_iterations=1, reference_vectors=count, max_mismatch=max_mismatch)
    first = train_stereo_map(case.rig, case.points, start, once)
    if np.subtract(*np.linalg.norm(references[[0, -1]] - truth.base, axis=1)) > 0:
        references, first = references[::-1], first[::-1]
    curve = Backbone.fit_polynomial(references, options.degree)
    arc_lengths = closest_on_curve(references, truth)[1]
    return Run(
        pose, count, max_mismatch, references, curve, arc_lengths,
        error=registered_error(curve, truth),
        unregistered=curve_errors(curve, truth).mean,
        seconds=seconds,
        backward=int(np.sum(np.diff(arc_lengths) < 0)),
        first_pass=np.array_equal(references, first),
        refused=refused,
    )  # fmt: skip


def registered_error(curve: Backbone, truth: Backbone) -> float:
    """Mean distance of 100 points at equal arc length after rigid registration, mm."""
    ours, true = curve.sample(100), truth.sample(100)
    rotation, translation = register_rigid(ours, true)
    return float(np.linalg.norm(ours @ rotation.T + translation - true, axis=1).mean())


# ---- all poses -----------------------------------------------------------------------


def summarize(runs: Sequence[Run]) -> dict[str, Any]:
    """One row of the table: runs of one number of reference vectors and one D_max."""
    paper = PAPER.get(runs[0].count, (np.nan,) * 3)
    errors = np.array([run.error for run in runs])
    return {
        "max_mismatch": runs[0].max_mismatch,
        "reference_vectors": runs[0].count,
        "poses": len(runs),
        "error_mm": _digits(errors.mean()),
        "error_std_mm": _digits(errors.std(ddof=1)) if len(runs) > 1 else 0.0,
        "error_median_mm": _digits(np.median(errors)),
        "error_unregistered_mm": _digits(np.mean([run.unregistered for run in runs])),
        "time_s": _digits(np.mean([run.seconds for run in runs]), 4),
        "refused_share": _digits(np.mean([bool(run.refused) for run in runs])),
        "misordered_share": _digits(np.mean([run.backward > 0 for run in runs])),
        "first_pass_share": _digits(np.mean([run.first_pass for run in runs])),
        "paper_error_mm": paper[0],
        "paper_error_std_mm": paper[1],
        "paper_time_s": paper[2],
    }


def _pose_row(run: Run) -> dict[str, Any]:
    return {
        "max_mismatch": run.max_mismatch,
        "reference_vectors": run.count,
        "pose": run.pose,
        "error_mm": _digits(run.error),
        "error_unregistered_mm": _digits(run.unregistered),
        "time_s": _digits(run.seconds, 4),
        "backward_steps": run.backward,
        "first_pass": int(run.first_pass),
        "refused": run.refused,
    }


def write_csv(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write rows of equal keys, the keys as the header."""
    rows = list(rows)
    with write_whole(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The paper's table beside ours, in Markdown: one for each D_max."""
    heads = ("Q's", "paper error (mm)", "paper time (s)", "error (mm)", "median",
             "not registered", "time (s)", "first pass", "misordered", "refused")  # fmt: skip
    texts = []
    for most in MISMATCHES:
        lines = [heads, ("--:",) * len(heads)]
        lines += [_cells(row) for row in rows if row["max_mismatch"] == most]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        padded = [map(str.rjust, line, widths) for line in lines]
        texts.append(
            f"D_max = {most:g}:\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in padded)
        )
    return "\n\n".join(texts)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return (
        f"{row['reference_vectors']}",
        f"{row['paper_error_mm']:.2f} ± {row['paper_error_std_mm']:.2f}",
        f"{row['paper_time_s']:.3f}",
        f"{row['error_mm']:.2f} ± {row['error_std_mm']:.2f}",
        f"{row['error_median_mm']:.2f}",
        f"{row['error_unregistered_mm']:.2f}",
        f"{row['time_s']:.3f}",
        f"{row['first_pass_share']:.0%}",
        f"{row['misordered_share']:.0%}",
        f"{row['refused_share']:.0%}",
    )


def _digits(value: Any, digits: int = 3) -> float:
    return round(float(value), digits)
