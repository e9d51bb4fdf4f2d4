"""Counterparts of the paper's Figures 2, 3, 5 and 6, and why the algorithm fails where it fails."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.metrics import closest_on_curve
from stereosom.observation import Observation
from stereosom.som import adjacency_matrix, best_two_units, order_by_adjacency, train_epoch
from stereosom.stereo_som import StereoSomOptions, stereo_som

from ..errors import require
from ..files import write_whole
from . import mockup

if TYPE_CHECKING:
    from .table1 import Case, Run

agg = require("matplotlib.backends.backend_agg", "vtk")
figures = require("matplotlib.figure", "vtk")
matplotlib = require("matplotlib", "vtk")

# The Okabe-Ito palette: told apart with any color vision.
BLUE, ORANGE, GREEN, INK, PALE = "#0072B2", "#D55E00", "#009E73", "#22262b", "#aab1ba"
_STYLE = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}


def draw(output: Path, cases: Sequence[Case], runs: Sequence[Run]) -> None:
    """Write all figures of `stereosom experiment table1`.

    Parameters
    ----------
    output : path
    cases : sequence of Case
        The poses.
    runs : sequence of Run
        All reconstructions of them; figures show those of the largest D_max.
    """
    paper_like = [run for run in runs if run.max_mismatch == max(r.max_mismatch for r in runs)]
    counts = sorted({run.count for run in runs})

    def of_first_pose(count: int) -> Run:
        nearest = min(counts, key=lambda k: abs(k - count))
        return next(run for run in paper_like if (run.pose, run.count) == (0, nearest))

    with matplotlib.rc_context(_STYLE):
        _adjacency(output / "figure2.png", cases[0], of_first_pose(30))
        _edges(output / "figure3.png", cases[0])
        _views(output / "figure5.png", cases[0], of_first_pose(50))
        _curves(output / "figure6.png", cases[0], [of_first_pose(k) for k in (20, 50, 100)])
        worst = max(paper_like, key=lambda run: (run.backward > 0, run.error))
        sound, crowded = of_first_pose(50), of_first_pose(100)
        _why_ordering(output / "why_ordering.png", cases[0], sound, crowded, worst)
        _why_ends(output / "why_ends.png", cases, paper_like, counts)
        _why_depth(output / "why_depth.png")


def _figure(width: float, height: float) -> Any:
    return figures.Figure(figsize=(width, height), dpi=160, layout="constrained")


def _save(figure: Any, path: Path) -> None:
    with write_whole(path) as part:
        agg.FigureCanvasAgg(figure).print_png(part)


# ---- counterparts of the paper's figures ---------------------------------------------


def _adjacency(path: Path, case: Case, run: Run) -> None:
    """Figure 2: the adjacency matrix of shuffled reference vectors, and brought into order."""
    shuffled = np.random.default_rng(0).permutation(run.references)
    views = case.rig.a.project(shuffled), case.rig.b.project(shuffled)
    widest = int(np.argmax([np.ptp(view, axis=0).max() for view in views]))
    units = best_two_units(case.points[widest], views[widest])
    adjacency = adjacency_matrix(*units, len(shuffled))
    order = order_by_adjacency(adjacency)
    before = adjacency.toarray()
    figure = _figure(6.6, 3.4)
    titles = ("shuffled", "after reverse Cuthill–McKee")
    for axes, matrix, title in zip(
        figure.subplots(1, 2), (before, before[np.ix_(order, order)]), titles, strict=True
    ):
        shown = np.where(matrix > 0, matrix, np.nan)
        k = len(matrix)
        picture = axes.imshow(shown, cmap="viridis_r", vmin=0, extent=(0.5, k + 0.5, k + 0.5, 0.5))
        axes.set(title=title, xlabel="second nearest reference vector")
        axes.spines[["top", "right"]].set_visible(True)
    figure.axes[0].set_ylabel("nearest reference vector")
    figure.colorbar(picture, ax=figure.axes, label="data points", shrink=0.85)
    _save(figure, path)


def _edges(path: Path, case: Case) -> None:
    """Figure 3: a camera's picture, and its edges."""
    figure = _figure(7.2, 2.1)
    left, right = figure.subplots(1, 2)
    height, width = case.images[0].shape
    left.imshow(case.images[0], cmap="gray", vmin=0, vmax=255)
    edges = np.ones((height, width))
    x, y = case.edges[0].astype(int).T
    edges[y, x] = 0
    right.imshow(edges, cmap="gray", vmin=0, vmax=1, interpolation="antialiased")
    left.set_title("picture of view a")
    right.set_title(f"its {len(x)} edge pixels")
    low, high = case.edges[0].min(axis=0) - 60, case.edges[0].max(axis=0) + 60
    for axes in (left, right):
        axes.set(xlim=(low[0], high[0]), ylim=(high[1], low[1]), xlabel="x (px)")
        axes.spines[["top", "right"]].set_visible(True)
    left.set_ylabel("y (px)")
    _save(figure, path)


def _views(path: Path, case: Case, run: Run) -> None:
    """Figure 5: data points and projected reference vectors in both views."""
    figure = _figure(6.0, 5.4)
    for axes, view, camera, points in zip(
        figure.subplots(2, 1, sharex=True, sharey=True),
        "ab",
        (case.rig.a, case.rig.b),
        case.points,
        strict=True,
    ):
        axes.plot(*points.T, ".", ms=2.5, color=PALE, label="data point")
        axes.plot(
            *camera.project(run.references).T, "o", ms=4, mfc="none", mec=BLUE,
            label="reference vector, projected",
        )  # fmt: skip
        ends = camera.project(case.truth([0.0, case.truth.length]))
        axes.plot(*ends.T, "x", ms=6, color=ORANGE, label="true end of the backbone")
        axes.set(title=f"view {view}", aspect="equal", ylabel="y (px)")
    axes.invert_yaxis()  # both: they share it
    axes.set_xlabel("x (px)")
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    _save(figure, path)


def _curves(path: Path, case: Case, runs: Sequence[Run]) -> None:
    """Figure 6: reference vectors, fitted curve and truth in space."""
    figure = figures.Figure(figsize=(9.6, 3.3), dpi=160)
    figure.subplots_adjust(left=0.0, right=0.98, bottom=0.1, top=0.92, wspace=0.02)
    base = case.truth.base
    for place, run in enumerate(runs, 1):
        axes = figure.add_subplot(1, len(runs), place, projection="3d")
        # The base axis z is drawn level, x, up to the cameras, is drawn up.
        for points, style in (
            (case.truth.sample(200), {"color": ORANGE, "lw": 1.6, "label": "truth"}),
            (run.curve.sample(200), {"color": BLUE, "lw": 1.2, "label": "fitted polynomial"}),
            (
                run.references,
                {"color": INK, "marker": "o", "ms": 2.4, "ls": "", "label": "reference vector"},
            ),
        ):
            x, y, z = (points - base).T
            axes.plot(z, y, x, **style)
        axes.set_title(f"{run.count} reference vectors: {run.error:.2f} mm", loc="center", y=1.0)
        axes.set(xlabel="z (mm)", ylabel="y (mm)", zlabel="x (mm)")
        axes.set_aspect("equal")
        axes.view_init(elev=28, azim=-58)
        axes.tick_params(labelsize=7, pad=-2)
        axes.locator_params(nbins=4)
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.labelpad = -3
            axis.pane.set_alpha(0.35)
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=3)
    _save(figure, path)


# ---- why it fails where it fails -----------------------------------------------------


def _why_ordering(path: Path, case: Case, sound: Run, crowded: Run, worst: Run) -> None:
    """Two edges: many reference vectors alternate between them, and the order breaks.

    `sound` and `crowded` are of `case`; `worst` may be of any pose.
    """
    figure = _figure(9.2, 3.3)
    axes = figure.subplots(1, 3)
    center = case.rig.a.project(case.truth([0.45 * case.truth.length]))[0]
    for panel, run in zip(axes, (sound, crowded), strict=False):
        references = case.rig.a.project(run.references)
        panel.plot(*case.points[0].T, ".", ms=4, color=ORANGE, label="data point")
        panel.plot(
            *references.T, "-o", ms=4, lw=1, color=BLUE, mfc="white", label="reference vectors"
        )
        panel.set(
            xlim=center[0] + np.array([-45, 45]), ylim=center[1] + np.array([45, -45]),
            aspect="equal", xlabel="x (px)",
            title=f"{run.count}: {run.backward} steps lead backward",
        )  # fmt: skip
    axes[0].set_ylabel("y (px), view a")
    axes[0].legend(loc="upper right", handlelength=1.2, borderaxespad=0)
    for run, style in (
        (sound, {"color": PALE, "lw": 2}),
        (worst, {"color": BLUE, "lw": 0.8, "marker": "o", "ms": 2.5}),
    ):
        share = np.linspace(0, 1, len(run.references))
        label = f"{run.count}: error {run.error:.1f} mm"
        axes[2].plot(share, run.arc_lengths, label=label, **style)
    axes[2].set(
        xlabel="place in the order (share)", ylabel="true arc length (mm)",
        title="the order, in the worst run",
    )  # fmt: skip
    axes[2].legend(loc="best")
    _save(figure, path)


def _why_ends(
    path: Path, cases: Sequence[Case], runs: Sequence[Run], counts: Sequence[int]
) -> None:
    """Outermost reference vectors stop short of the ends, in proportion to their spacing."""
    figure = _figure(5.6, 3.4)
    axes = figure.subplots()
    length = cases[0].truth.length
    for name, color, marker in (("base", BLUE, "o"), ("tip", ORANGE, "D")):
        per_count = [
            [
                run.arc_lengths.min() if name == "base" else length - run.arc_lengths.max()
                for run in runs
                if run.count == k
            ]
            for k in counts
        ]
        axes.errorbar(
            counts, [np.mean(values) for values in per_count],
            [np.std(values) for values in per_count],
            fmt=marker, ms=5, color=color, capsize=2, label=f"{name}, mean ± std over the poses",
        )  # fmt: skip
    dense = range(min(counts), max(counts) + 1, 2)
    axes.plot(dense, [length / k for k in dense], ":", color=PALE, label="one spacing, length / k")
    for cap, style, name in (
        (0.0, "--", "evenly filled"),
        (mockup.RADIUS, "-", "with the edges of flat ends"),
    ):
        expected = [end_shrinkage(k, length, cap) for k in dense]
        axes.plot(dense, expected, style, color=INK, lw=1, label=f"eq. (2) on a line, {name}")
    axes.set(
        xlabel="reference vectors", ylabel="outermost one to the true end (mm)", ylim=(0, None)
    )
    axes.legend()
    _save(figure, path)


def end_shrinkage(count: int, length: float, cap: float = 0.0, neighborhood: int = 1) -> float:
    """How far batch training, trained out, leaves the outermost unit from a line's end, mm.

    Parameters
    ----------
    count : int
        Reference vectors on an evenly filled straight line.
    length : float
        Of the line, mm.
    cap : float
        So many mm of the line have as many points as stand at each end besides. A tube's two
        edges are 2 px per pixel along it, and its flat end is 2 r wide: half of that is r.
    neighborhood : int
        The paper's n.
    """
    step = length / 4000
    ends = np.repeat([0.0, length], round(cap / step))
    points = np.concatenate([np.arange(step / 2, length, step), ends])[:, None]
    references = np.linspace(0, length, count)[:, None]
    for _ in range(100):
        references, _ = train_epoch(points, references, neighborhood)
    return float(references[0, 0])


def _why_depth(path: Path) -> None:
    """A stretch in an epipolar plane has no depth, and the result says so."""
    rig = mockup.overhead_rig()
    truth, radius = epipolar_curve(), 1.5
    masks = [
        mockup.render_tube(truth, radius, camera, gray=0, background=255) < 128
        for camera in (rig.a, rig.b)
    ]
    seen = Observation.from_masks(masks[0], masks[1], rig)
    result = stereo_som(seen, options=StereoSomOptions(degree=14, points_per_view=4000))
    curve = result.backbone
    assert curve is not None  # a method returns one or raises
    s = curve.arc_lengths(300)
    error, _ = closest_on_curve(curve(s), truth)
    angle = epipolar_angle_deg(curve, s, rig.a.center, rig.b.center - rig.a.center)
    figure = _figure(8.2, 3.5)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.7))
    for view, color, mask in zip("ab", (BLUE, ORANGE), masks, strict=True):
        left.contourf(mask, levels=[0.5, 1], colors=[color], alpha=0.5)
        left.plot([], [], lw=5, color=color, alpha=0.5, label=f"view {view}")
    flat = rig.a.project(truth.sample(400))
    left.set(
        aspect="equal", xlim=(flat[:, 0].min() - 60, flat[:, 0].max() + 60), ylim=(620, 150),
        xlabel="x (px)", ylabel="y (px)", title="both masks",
    )  # fmt: skip
    left.legend(loc="best")
    right.fill_between(
        s, 0, 1, where=angle < 10, transform=right.get_xaxis_transform(), color=PALE, alpha=0.35,
        lw=0, label="within 10° of an epipolar plane",
    )  # fmt: skip
    right.plot(s, result.standard_deviation_at(s), color=ORANGE, label="stated standard deviation")
    right.plot(s, error, color=BLUE, label="distance to the true curve")
    right.set(xlabel="arc length (mm)", ylabel="mm", yscale="log", title="along the result")
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    _save(figure, path)


def epipolar_curve() -> Backbone:
    """A curve that runs along the baseline of `mockup.overhead_rig` for some 40 mm, mm.

    It leaves level along z, turns across the picture (y, the direction of the baseline), bulges
    there towards the cameras, which neither of them can see, and turns back.
    """
    share = np.linspace(0, 1, 5)[:, None]
    across = (1 - share) * [0, -32, 75] + share * [0, 32, 75]
    across[1:4, 0] = [14, 18, 14]
    corners = np.vstack([[0, -32, 10], [0, -32, 43], across, [0, 32, 107], [0, 32, 140]])
    return Backbone.through(Backbone.through(_polyline(corners)).sample(200))


def _polyline(corners: Floats) -> Floats:
    """Points along a polyline with its corners rounded, (n, 3), mm."""
    share = np.linspace(0, len(corners) - 1, 301)
    sharp = np.column_stack([np.interp(share, np.arange(len(corners)), axis) for axis in corners.T])
    return np.asarray(gaussian_filter1d(sharp, sigma=15, axis=0, mode="nearest"))


def epipolar_angle_deg(curve: Backbone, s: Floats, center: Floats, baseline: Floats) -> Floats:
    """Angle between the curve and the epipolar plane through it, at arc lengths s, (n,)."""
    normal = np.cross(curve(s) - center, baseline)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    sine = np.abs(np.sum(curve.tangent(s) * normal, axis=1))
    return np.asarray(np.degrees(np.arcsin(np.clip(sine, 0, 1))))
