"""How near the default method comes to what two silhouettes can possibly determine.

Random curves are rendered by VTK and reconstructed, with one quantity varied at a time: rough
edges, the convergence angle, the device's radius, the resolution. Beside every error stands the
Cramér–Rao bound of the same curve before the same cameras (`cramer_rao`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.reconstruct import reconstruct
from stereosom.synthetic import converging_rig

from ..errors import require
from ..files import write_whole
from . import Progress
from .confidence import offsets
from .cramer_rao import cramer_rao_bound
from .devices import Device, random_curve
from .rough_masks import coverage, deviation, observe
from .tables import markdown, write_csv


@dataclass(frozen=True)
class Setting:
    """What is varied; the other quantities stay as they are here.

    `roughness_px` of the edges besides rounding, `convergence_deg` between the views,
    `radius_mm` of the device, `width_px` of a picture four by three.
    """

    roughness_px: float = 0.2
    convergence_deg: float = 60.0
    radius_mm: float = 1.5
    width_px: int = 1024

    def device(self, seed: int) -> Device:
        """The random curve of a seed, 700 mm from two cameras of one field of view."""
        rig = converging_rig(
            self.convergence_deg,
            focal_length=2400 * self.width_px / 1024,
            image_size=(self.width_px, self.width_px * 3 // 4),
        )
        return Device(random_curve(seed), self.radius_mm, rig)


SWEEPS: MappingProxyType[str, Sequence[Any]] = MappingProxyType(
    {
        "roughness_px": (0.0, 0.1, 0.2, 0.4, 0.8, 1.6),
        "convergence_deg": (10, 20, 30, 45, 60, 90),
        "radius_mm": (0.3, 0.6, 1.2, 2.4, 4.8),
        "width_px": (256, 512, 1024, 2048),
    }
)
_LABELS = {
    "roughness_px": "rough edges, standard deviation (px)",
    "convergence_deg": "angle between the views (°)",
    "radius_mm": "radius of the device (mm)",
    "width_px": "width of the pictures (px)",
}


@dataclass(frozen=True)
class Reached:
    """One curve in one setting: errors and bounds, mm; NaN where nothing was found.

    `across` and `across_bound` are root mean squares over the curve, across it, in both
    directions together; `end` and `end_bound` are those of base and tip, in all directions;
    `stated` is the median of the stated standard deviation and `deviation_bound` the bound's.
    """

    varied: str
    value: float
    seed: int
    across: float
    across_bound: float
    end: float
    end_bound: float
    stated: float
    deviation_bound: float
    reason: str


def measure(
    *,
    shapes: int = 8,
    sweeps: Mapping[str, Sequence[Any]] = SWEEPS,
    progress: Progress = iter,
) -> list[Reached]:
    """Reconstruct `shapes` random curves in every setting: values of a `Setting`'s fields."""
    jobs = [
        (name, value, seed) for name in sweeps for value in sweeps[name] for seed in range(shapes)
    ]
    return [_reach(name, value, seed) for name, value, seed in progress(jobs)]


def _reach(varied: str, value: Any, seed: int) -> Reached:
    setting = replace(Setting(), **{varied: value})
    device = setting.device(seed)
    noise = deviation(setting.roughness_px)
    bound = cramer_rao_bound(device.curve, device.radius, device.rig, deviation_px=noise)
    bounds = {
        "across_bound": _rms(bound.rms_across[1:-1]),
        "end_bound": _rms(bound.rms[[0, -1]]),
        "deviation_bound": float(np.median(bound.standard_deviation[1:-1])),
    }
    covered = tuple(
        coverage(device.curve, device.radius, camera) for camera in (device.rig.a, device.rig.b)
    )
    seen = observe((covered[0], covered[1]), device.rig, setting.roughness_px, seed)
    result = reconstruct(seen)
    errors = dict.fromkeys(("across", "end", "stated"), float("nan"))
    if result.ok:
        found = offsets(result, device.curve)
        distance = np.linalg.norm(found.offset, axis=1)
        errors = {
            "across": _rms(distance[1:-1]),
            "end": _rms(distance[[0, -1]]),
            "stated": float(np.median(found.deviation[1:-1])),
        }
    reason = "" if result.ok else result.reason
    return Reached(varied, value, seed, **errors, **bounds, reason=reason)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def summary(reached: Sequence[Reached]) -> list[dict[str, Any]]:
    """Medians over the curves of each setting; `found` counts those that were reconstructed."""
    rows = []
    for varied, value in dict.fromkeys((one.varied, one.value) for one in reached):
        group = [one for one in reached if (one.varied, one.value) == (varied, value)]
        found = [one for one in group if not one.reason]
        row: dict[str, Any] = {"varied": varied, "value": value, "curves": len(group)}
        row["found"] = len(found)
        for name in _MEASURED:
            values = [getattr(one, name) for one in found]
            row[f"{name}_mm"] = round(float(np.median(values)), 4) if values else "n/a"
        rows.append(row)
    return rows


_MEASURED = ("across", "across_bound", "end", "end_bound", "stated", "deviation_bound")


def run(
    output: Path,
    *,
    progress: Progress = iter,
    shapes: int = 8,
    sweeps: Mapping[str, Sequence[Any]] = SWEEPS,
) -> str:
    """Measure, write the tables and the figure, and return the table.

    Parameters
    ----------
    output : Path
    progress : callable
    shapes : int
        Random curves for every setting.
    sweeps : mapping
        Values of each field of `Setting` that is varied.
    """
    output.mkdir(parents=True, exist_ok=True)
    reached = measure(shapes=shapes, sweeps=sweeps, progress=progress)
    table = summary(reached)
    write_csv(output / "limits.csv", table)
    write_csv(output / "limits_runs.csv", [vars(one) for one in reached])
    _draw(output / "limits.png", table)
    return markdown(table)


def _draw(path: Path, table: Sequence[dict[str, Any]]) -> None:
    """Errors and bounds by each quantity, on logarithmic scales."""
    agg = require("matplotlib.backends.backend_agg", "vtk")
    figure = require("matplotlib.figure", "vtk").Figure(
        figsize=(10, 6.6), dpi=160, layout="constrained"
    )
    names = list(dict.fromkeys(row["varied"] for row in table))
    panels = figure.subplots(2, -(-len(names) // 2), squeeze=False, sharey=True).ravel()
    for axes, name in zip(panels, names, strict=False):
        rows = [row for row in table if row["varied"] == name and row["found"]]
        at = [row["value"] for row in rows]
        for measured, style, label in _LINES:
            axes.plot(at, [row[f"{measured}_mm"] for row in rows], label=label, **style)
        scale: Callable[..., Any] = axes.set_xscale
        scale("symlog", linthresh=0.1) if name == "roughness_px" else scale("log")
        axes.set_xticks(at, [f"{value:g}" for value in at])
        axes.minorticks_off()
        axes.set(yscale="log", xlabel=_LABELS[name])
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[:: -(-len(names) // 2)]:
        axes.set_ylabel("mm")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    with write_whole(path) as part:
        agg.FigureCanvasAgg(figure).print_png(part)


_LINES = (
    ("across", {"color": "#0072B2", "marker": "o", "ms": 4}, "across the curve: error (RMS)"),
    ("across_bound", {"color": "#0072B2", "ls": ":"}, "its bound"),
    ("end", {"color": "#D55E00", "marker": "D", "ms": 4}, "base and tip: error (RMS)"),
    ("end_bound", {"color": "#D55E00", "ls": ":"}, "its bound"),
)
