"""Centerlines against the truth: `stereosom evaluate`."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stereosom.arrays import check_array
from stereosom.backbone import Backbone
from stereosom.camera import StereoRig
from stereosom.metrics import closest_on_curve, curve_errors

from .calibration.rig_json import read_rig_json
from .centerline import read_vtp
from .errors import InputError
from .lens import Lens
from .output import RIG, centerline_path, read_table


@dataclass(frozen=True)
class FrameErrors:
    """Errors of one frame, mm.

    `distance`: mean distance of the curve to the true one. `mean`, `p95`, `maximum`: at equal
    shares of arc length of the stretch that both views see. `covered`: share of that stretch
    which the curve covers; zero where the curve runs the wrong way.
    """

    frame: int
    distance: float
    mean: float
    p95: float
    maximum: float
    base: float
    tip: float
    covered: float


def evaluate(path: str | Path, truth: str | Path) -> list[FrameErrors]:
    """Compare an output folder, or one `.vtp`, with the truth.

    Parameters
    ----------
    path : path
        A folder that stereosom has written, or a `.vtp`.
    truth : path
        A `.csv` or `.vtp`, or a folder of `truth_NNN.csv` numbered by frame.

    Raises
    ------
    InputError
        Where there is nothing to compare.
    """
    path, truth = Path(path), Path(truth)
    rigs: Sequence[StereoRig] = ()
    lenses = None
    if path.is_dir():
        rows = read_table(path)
        frames = [int(row["frame"]) for row in rows if row["status"] in ("ok", "predicted")]
        files = {frame: centerline_path(path, frame) for frame in frames}
        seen_by = read_rig_json(path / RIG)
        rigs, lenses = seen_by.rigs, seen_by.lenses
    else:
        files = {read_vtp(path).frame: path}
    truths = _truth_files(truth, list(files))
    errors = []
    for frame, file in files.items():
        if frame in truths:
            rig = rigs[frame if len(rigs) > 1 else 0] if rigs else None
            found = read_vtp(file).backbone
            true = read_truth(truths[frame])
            errors.append(compare(found, true, rig, lenses=lenses, frame=frame))
    if not errors:
        raise InputError(truth, f"has no truth for any frame of {path}", "give truth_NNN.csv files")
    return errors


def compare(
    found: Backbone,
    truth: Backbone,
    rig: StereoRig | None = None,
    *,
    lenses: tuple[Lens, Lens] | None = None,
    frame: int = 0,
) -> FrameErrors:
    """Compare a curve with the true one, over the stretch that both views of the rig see."""
    start, stop = visible_stretch(truth, rig, lenses) if rig else (0.0, truth.length)
    errors = curve_errors(found, truth.between(start, stop))
    distance, at = closest_on_curve(found.sample(200), truth)
    shared = min(at[-1], stop) - max(at[0], start)
    return FrameErrors(
        frame=frame,
        distance=float(distance.mean()),
        mean=errors.mean,
        p95=errors.p95,
        maximum=errors.maximum,
        base=errors.base,
        tip=errors.tip,
        covered=max(0.0, float(shared / (stop - start))),
    )


def visible_stretch(
    curve: Backbone, rig: StereoRig, lenses: tuple[Lens, Lens] | None = None
) -> tuple[float, float]:
    """First and last arc length of the longest stretch that lies inside both pictures, mm.

    The pictures are those that the lenses show, where there are any.

    Raises
    ------
    InputError
        Where nothing does.
    """
    s = curve.arc_lengths(2000)
    points = curve(s)
    inside = np.ones(len(s), dtype=bool)
    for number, camera in enumerate((rig.a, rig.b)):
        pixels = camera.project(points)
        if lenses:
            pixels = lenses[number].distort_where_defined(pixels)
        size = np.asarray(camera.image_size)
        inside &= np.all((pixels >= -0.5) & (pixels <= size - 0.5), axis=1)
        inside &= camera.depth(points) > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
    runs = edges.reshape(-1, 2)
    if len(runs) == 0 or np.ptp(runs, axis=1).max() < 2:
        raise InputError(
            "truth", "lies in no place that both views see", "give the truth in the rig's frame"
        )
    first, beyond = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return float(s[first]), float(s[beyond - 1])


def read_truth(path: str | Path) -> Backbone:
    """Read a true curve: a `.vtp`, or a `.csv` with columns x, y, z in mm from base to tip."""
    path = Path(path)
    if path.suffix.lower() == ".vtp":
        return read_vtp(path).backbone
    try:
        with open(path, encoding="utf-8", newline="") as file:
            header, *rows = list(csv.reader(file)) or [[]]
        names = [re.sub(r"[\s_\[(].*$", "", name.strip().lower()) for name in header]
        columns = [names.index(axis) for axis in "xyz"]
        points = [[float(row[column]) for column in columns] for row in rows if row]
        return Backbone.through(check_array(points, "truth", (None, 3)))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    except (ValueError, IndexError) as error:
        raise InputError(
            path, f"is no curve ({error})", "give a header line and columns x, y, z in mm"
        ) from None


def _truth_files(truth: Path, frames: list[int]) -> dict[int, Path]:
    if truth.is_dir():
        numbered = {
            int(match[1]): file
            for file in truth.iterdir()
            if (match := re.fullmatch(r"truth_(\d+)\.csv", file.name))
        }
        if not numbered:
            raise InputError(truth, "holds no truth_NNN.csv", "give a folder of them, or one file")
        return numbered
    if not truth.exists():
        raise InputError(truth, "no such file or folder", "check the path")
    if len(frames) != 1:
        raise InputError(
            truth, f"is one curve for {len(frames)} frames", "give a folder of truth_NNN.csv"
        )
    return {frames[0]: truth}
