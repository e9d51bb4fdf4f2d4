"""Is the truth where the result says that it is, and does the result say no more than it must?

Rendered devices of several kinds, their edges roughened by several amplitudes of noise, are
reconstructed, and 100 true points of each are looked for in the stated regions. From a script:

>>> from stereosom_plugin.experiments import coverage
>>> from stereosom_plugin.experiments.tables import markdown
>>> print(markdown(coverage.summary(coverage.measure(count=4))))  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.stats import chi2

from stereosom.arrays import Booleans, Floats
from stereosom.reconstruct import reconstruct
from stereosom.reconstruction import Reconstruction

from ..errors import require
from ..files import write_whole
from . import Progress
from .confidence import Offsets, offsets
from .cramer_rao import Bound, cramer_rao_bound
from .devices import FAMILIES
from .rough_masks import coverage, deviation, observe
from .tables import markdown, write_csv

ROUGHNESS = (0.0, 0.2, 0.4, 0.8)
"""Standard deviations of the edges, px, beside their rounding to pixels."""

LEVELS = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99])
_ALL = "all"


@dataclass(frozen=True, eq=False)
class Simulation:
    """One device, seen once. Where it was not reconstructed, `found` is None."""

    family: str
    seed: int
    roughness: float
    seconds: float
    result: Reconstruction
    bound: Bound
    found: Offsets | None


def measure(
    count: int = 24,
    *,
    families: Sequence[str] | None = None,
    roughness: Sequence[float] = ROUGHNESS,
    seed: int = 0,
    progress: Progress = iter,
) -> list[Simulation]:
    """Simulate and reconstruct.

    Parameters
    ----------
    count : int
        Simulations of each family. Each shape is rendered once and seen with every roughness.
    families : sequence of str, optional
        Names in `devices.FAMILIES`. Default: all.
    roughness : sequence of float
        Standard deviations of the edges, px.
    seed : int
        Of the first shape; the next ones follow.
    """
    shapes = range(seed, seed + -(-count // len(roughness)))
    jobs = [(name, number) for name in families or FAMILIES for number in shapes]
    simulations: list[Simulation] = []
    for name, number in progress(jobs):
        device = FAMILIES[name](number)
        views = (device.rig.a, device.rig.b)
        covered = [coverage(device.curve, device.radius, camera) for camera in views]
        unit = cramer_rao_bound(device.curve, device.radius, device.rig, deviation_px=1.0)
        for amplitude in roughness[: count - len(roughness) * (number - seed)]:
            seen = observe((covered[0], covered[1]), device.rig, amplitude, seed=number)
            started = perf_counter()
            result = reconstruct(seen)
            seconds = perf_counter() - started
            found = offsets(result, device.curve) if result.ok else None
            bound = unit.scaled(deviation(amplitude))
            simulations.append(Simulation(name, number, amplitude, seconds, result, bound, found))
    return simulations


# ---- what it comes to ----------------------------------------------------------------


def summary(simulations: Sequence[Simulation]) -> list[dict[str, Any]]:
    """A row for each family, each roughness, and all together.

    `inside`: share of the true points between the ends that lie in their 95 % regions (χ², two
    degrees of freedom); `or_open`: in them, or flagged as not determined; `ends`: share of true
    bases and tips in theirs (three). `open`: share flagged. `needed`: what the stated standard
    deviations would have to be multiplied by for half of the points inside to lie in their 50 %
    regions. `sd_to_bound`: median ratio of the stated standard deviation to the Cramér–Rao
    bound's; `ends_sd_to_bound`: at base and tip. `across_mm`: median distance across;
    `error_to_bound`: its RMS beside the bound's, the median over simulations.
    """
    rows = [_row(name, group) for name, group in _groups(simulations)]
    rows.append(_row(_ALL, simulations))
    return rows


def _groups(simulations: Sequence[Simulation]) -> list[tuple[str, list[Simulation]]]:
    names = list(dict.fromkeys(one.family for one in simulations))
    amplitudes = sorted({one.roughness for one in simulations})
    by_family = [(name, [one for one in simulations if one.family == name]) for name in names]
    return by_family + [
        (f"edges ± {value:g} px", [one for one in simulations if one.roughness == value])
        for value in amplitudes
    ]


def _row(name: str, group: Sequence[Simulation]) -> dict[str, Any]:
    row: dict[str, Any] = {"group": name, "runs": len(group)}
    found = [(one.found, one.bound) for one in group if one.found is not None]
    row["found"] = len(found)
    if not found:
        return row | dict.fromkeys(_FIGURES, "n/a")
    inside = _joined(found, lambda one: one.level <= 0.95)
    determined = _joined(found, lambda one: one.determined)
    ends = _joined(found, lambda one: one.ends)
    squared = np.concatenate([one.squared for one, _ in found])
    ratio = np.concatenate([one.deviation / bound.standard_deviation for one, bound in found])
    across = np.linalg.norm(np.concatenate([one.offset for one, _ in found]), axis=1)
    figures = (
        np.mean(inside[~ends]),
        np.mean(inside[~ends] | ~determined[~ends]),
        np.mean(inside[ends]),
        np.mean(~determined),
        np.sqrt(np.median(squared[~ends]) / chi2.ppf(0.5, 2)),
        np.median(ratio[~ends]),
        np.median(ratio[ends]),
        np.median(across[~ends]),
        np.median([_reached(one, bound) for one, bound in found]),
    )
    return row | {key: round(float(value), 3) for key, value in zip(_FIGURES, figures, strict=True)}


_FIGURES = (
    "inside", "or_open", "ends", "open", "needed", "sd_to_bound", "ends_sd_to_bound", "across_mm",
    "error_to_bound",
)  # fmt: skip


def _joined(found: Sequence[tuple[Offsets, Bound]], of: Callable[[Offsets], Booleans]) -> Booleans:
    return np.concatenate([of(one) for one, _ in found])


def _reached(one: Offsets, bound: Bound) -> float:
    inner = ~one.ends
    reached = np.mean(np.sum(one.offset[inner] ** 2, axis=1))
    return float(np.sqrt(reached / np.mean(bound.rms_across[inner] ** 2)))


def curves(simulations: Sequence[Simulation]) -> list[dict[str, Any]]:
    """Share of true points in the stated regions by nominal level: a row for each family."""
    rows = []
    families = [pair for pair in _groups(simulations) if not pair[0].startswith("edges")]
    for name, group in [*families, (_ALL, simulations)]:
        found = [one.found for one in group if one.found is not None]
        for part, ends in (("inside", False), ("ends", True)):
            level = np.concatenate([np.array([])] + [one.level[one.ends == ends] for one in found])
            shares = np.mean(level[:, None] <= LEVELS, axis=0) if len(level) else LEVELS * np.nan
            rows += [
                {"family": name, "part": part, "level": nominal, "share": round(float(share), 4)}
                for nominal, share in zip(LEVELS, shares, strict=True)
            ]
    return rows


# ---- the experiment ------------------------------------------------------------------


def run(
    output: Path,
    *,
    progress: Progress = iter,
    count: int = 40,
    families: Sequence[str] | None = None,
) -> str:
    """Simulate, write the tables and the figure, and return the table.

    Parameters
    ----------
    output : Path
    progress : callable
    count : int
        Simulations of each family.
    families : sequence of str, optional
        Names in `devices.FAMILIES`. Default: all.
    """
    output.mkdir(parents=True, exist_ok=True)
    simulations = measure(count, families=families, progress=progress)
    table = summary(simulations)
    write_csv(output / "coverage.csv", table)
    shares = curves(simulations)
    write_csv(output / "coverage_levels.csv", shares)
    write_csv(output / "coverage_runs.csv", [_run_row(one) for one in simulations])
    _draw(output / "coverage.png", shares, simulations)
    return markdown(table)


def _run_row(one: Simulation) -> dict[str, Any]:
    row = _row(one.family, [one])
    row = {"family": one.family, "seed": one.seed, "roughness_px": one.roughness} | row
    del row["group"], row["runs"], row["found"]
    reason = "" if one.result.ok else one.result.reason
    return row | {"status": one.result.status, "reason": reason}


def _draw(path: Path, shares: Sequence[dict[str, Any]], simulations: Sequence[Simulation]) -> None:
    """Nominal level against share, inside and at the ends; stated deviation beside the bound."""
    agg = require("matplotlib.backends.backend_agg", "vtk")
    figure = require("matplotlib.figure", "vtk").Figure(
        figsize=(11, 4.2), dpi=160, layout="constrained"
    )
    inside, ends, sharp = figure.subplots(1, 3)
    names = list(dict.fromkeys(row["family"] for row in shares))
    for axes, part, title in (
        (inside, "inside", "across the curve, between the ends"),
        (ends, "ends", "base and tip"),
    ):
        axes.plot([0, 1], [0, 1], ":", color="0.6", lw=1)
        for name in names:
            rows = [row for row in shares if (row["family"], row["part"]) == (name, part)]
            style = {"color": "black", "lw": 2.2} if name == _ALL else {"lw": 1.1, "marker": "."}
            axes.plot(
                [row["level"] for row in rows], [row["share"] for row in rows], label=name, **style
            )
        # Wanted of the 95 % regions.
        axes.errorbar(0.95, 0.94, 0.04, color="black", lw=1.5, capsize=4, zorder=5)
        axes.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", title=title)
        axes.set(xlabel="nominal level", ylabel="share of true points in the stated region")
    handles, labels = inside.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=len(labels), frameon=False, fontsize=8
    )
    found = [(one.family, _ratio(one.found, one.bound)) for one in simulations if one.found]
    kinds = [name for name in names if name != _ALL]
    ratios = [
        np.concatenate([np.array([])] + [ratio for family, ratio in found if family == name])
        for name in kinds
    ]
    sharp.boxplot(
        ratios, orientation="horizontal", whis=(5, 95), showfliers=False, tick_labels=kinds
    )
    sharp.axvline(1, color="0.6", ls=":", lw=1)
    sharp.axvline(2, color="0.3", ls="--", lw=1)
    sharp.set(xscale="log", xlabel="stated standard deviation / bound", title="sharpness")
    sharp.set_xticks([0.25, 0.5, 1, 2, 4, 8], ["¼", "½", "1", "2", "4", "8"])
    sharp.minorticks_off()
    sharp.invert_yaxis()
    for axes in (inside, ends, sharp):
        axes.spines[["top", "right"]].set_visible(False)
    with write_whole(path) as part_file:
        agg.FigureCanvasAgg(figure).print_png(part_file)


def _ratio(one: Offsets, bound: Bound) -> Floats:
    return np.asarray((one.deviation / bound.standard_deviation)[~one.ends])
