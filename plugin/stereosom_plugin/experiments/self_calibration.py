"""How much of a wrong header self-calibration takes away.

Studies whose geometry is known are given wrong headers: angles off by up to 2°, isocenters by up
to 5 mm in each direction, both distances by up to 1 %, in either plane, drawn at random. The
device is what `segment_xray` finds in the pictures; what a rig is worth is judged by the true
curves alone, which the estimator never sees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom.metrics import closest_on_curve, register_rigid
from stereosom.observation import Observation
from stereosom.reconstruct import track
from stereosom.self_calibration import refine_rig

from ..fluoroscopy import read_biplane
from ..fluoroscopy.geometry import positioner_camera
from ..fluoroscopy.header import read_header
from ..segmentation import observe
from . import Progress
from .tables import markdown, write_csv

ANGLE_DEG, ISOCENTER_MM, DISTANCE = 2.0, 5.0, 0.01
DRAWS = 8


@dataclass(frozen=True, eq=False)
class Study:
    """A run, where its arms stood, and the true curves (n, 3) of its frames, mm."""

    name: str
    folder: Path
    seen: Sequence[Observation]
    truth: Sequence[Floats]


@dataclass(frozen=True)
class Outcome:
    """One wrong header, with and without refinement.

    `epipolar` is the median distance, px, of the true curves' pictures from the epipolar lines
    that a rig draws for them; `found` counts frames with a curve; `shape` and `place` are the
    mean distance from the curves to the true ones, mm, with one rigid registration for the run,
    and without.
    """

    study: str
    draw: int
    refined: bool
    epipolar: float
    found: int
    shape: float
    place: float
    seconds: float


def run(output: Path, *, progress: Progress = iter, draws: int = DRAWS) -> str:
    """Refine wrong headers; write every outcome and the table; return the table."""
    output.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    for study, draw in progress([(s, d) for s in _studies() for d in range(draws)]):
        outcomes += try_header(study, draw)
    write_csv(output / "outcomes.csv", [vars(one) for one in outcomes])
    table = summary(outcomes)
    write_csv(output / "self_calibration.csv", table)
    return markdown(table)


def try_header(study: Study, draw: int) -> list[Outcome]:
    """One wrong header: what comes of it as it is, and refined."""
    wrong = wrong_rig(study.folder, np.random.default_rng(draw))
    believed = [replace(one, rig=wrong) for one in study.seen]
    started = perf_counter()
    refined = refine_rig(believed).rig
    seconds = perf_counter() - started
    return [
        _judge(study, draw, wrong, False, 0.0),
        _judge(study, draw, refined, True, seconds),
    ]


def wrong_rig(folder: Path, random: np.random.Generator) -> StereoRig:
    """The rig of a study's headers with errors drawn evenly within the bounds."""
    cameras = []
    for plane in "ab":
        header = read_header(folder / f"plane_{plane}.dcm")
        angles = [
            float(header.number(f"Positioner{name}Angle") or 0.0) + ANGLE_DEG * share
            for name, share in zip(("Primary", "Secondary"), random.uniform(-1, 1, 2), strict=True)
        ]
        to_detector, to_isocenter = (
            float(header.number(keyword) or 0.0) * (1 + DISTANCE * share)
            for keyword, share in zip(
                ("DistanceSourceToDetector", "DistanceSourceToPatient"),
                random.uniform(-1, 1, 2),
                strict=True,
            )
        )
        row, column = header.numbers("ImagerPixelSpacing")
        size = (header.whole("Columns"), header.whole("Rows"))
        primary, secondary = np.radians(angles)
        camera = positioner_camera(
            primary, secondary, to_detector, to_isocenter, (row, column), size
        )
        moved = np.eye(4)
        moved[:3, 3] = ISOCENTER_MM * random.uniform(-1, 1, 3)
        cameras.append(Camera(camera.projection @ moved, size))
    return StereoRig(cameras[0], cameras[1], "isocenter_lps")


def summary(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Medians of a study's outcomes, headers as they are and refined; the worst in px."""
    rows = []
    for study, refined in sorted({(one.study, one.refined) for one in outcomes}):
        group = [one for one in outcomes if (one.study, one.refined) == (study, refined)]
        found = [one for one in group if one.found]
        row: dict[str, Any] = {"study": study, "header": "refined" if refined else "as stated"}
        row["epipolar_px"] = round(float(np.median([one.epipolar for one in group])), 2)
        row["worst_px"] = round(max(one.epipolar for one in group), 2)
        row["frames_found"] = round(float(np.mean([one.found for one in group])), 1)
        row["shape_mm"] = round(float(np.median([one.shape for one in found])), 2)
        row["place_mm"] = round(float(np.median([one.place for one in found])), 2)
        row["seconds"] = round(float(np.median([one.seconds for one in group])), 2)
        rows.append(row)
    return rows


def _judge(study: Study, draw: int, rig: StereoRig, refined: bool, seconds: float) -> Outcome:
    true = study.seen[0].rig
    results = list(track([replace(one, rig=rig) for one in study.seen]))
    curves = {
        one.index: one.backbone.sample(60)
        for one in results
        if one.status == "ok" and one.backbone is not None
    }
    truths = {index: Backbone.through(study.truth[index]) for index in curves}
    shape = place = float("nan")
    if curves:
        place = _distance(curves, truths)
        for _ in range(6):  # iterated closest points
            source = np.vstack(list(curves.values()))
            target = np.vstack([_nearest(curves[i], truths[i]) for i in curves])
            rotation, translation = register_rigid(source, target)
            curves = {i: points @ rotation.T + translation for i, points in curves.items()}
        shape = _distance(curves, truths)
    error = epipolar_distance(rig, true, np.vstack(study.truth)[::10])
    return Outcome(study.name, draw, refined, error, len(curves), shape, place, seconds)


def epipolar_distance(rig: StereoRig, true: StereoRig, points: Floats) -> float:
    """Median distance, px, of points' true pictures from the epipolar lines of a rig.

    Only points that both true views show count.
    """
    pixels = [camera.project(points) for camera in (true.a, true.b)]
    inside = np.all(
        [
            np.all((seen > 0) & (seen < camera.image_size), axis=1)
            for seen, camera in zip(pixels, (true.a, true.b), strict=True)
        ],
        axis=0,
    )
    in_a, in_b = (np.column_stack([seen, np.ones(len(seen))])[inside] for seen in pixels)
    lines_b, lines_a = in_a @ rig.fundamental.T, in_b @ rig.fundamental
    away = np.abs(np.sum(in_b * lines_b, axis=1))
    each = [away / np.linalg.norm(lines[:, :2], axis=1) for lines in (lines_a, lines_b)]
    return float(np.median(np.mean(each, axis=0)))


def _nearest(points: Floats, curve: Backbone) -> Floats:
    return curve(closest_on_curve(points, curve)[1])


def _distance(curves: dict[int, Floats], truths: dict[int, Backbone]) -> float:
    return float(np.mean([closest_on_curve(curves[i], truths[i])[0].mean() for i in curves]))


def _studies() -> list[Study]:
    """The study that ships, and those of the development data beside a checkout."""
    from ..commands.demo import sample_folder

    with sample_folder() as sample:
        studies = [_study("sample", Path(sample))]
    beside = Path(__file__).resolve().parents[4] / "shared" / "data" / "biplane_xa"
    for name in ("cannula", "guidewire", "cluttered"):
        if (beside / name).is_dir():
            studies.append(_study(name, beside / name))
    return studies


def _study(name: str, folder: Path) -> Study:
    acquisition = read_biplane(folder)
    truth = [
        np.loadtxt(path, delimiter=",", skiprows=1) for path in sorted(folder.glob("truth_*.csv"))
    ]
    return Study(name, folder, list(observe(acquisition)), truth)
