"""A chain of circular arcs through bands that are painted on the device.

M. W. Hannan, I. D. Walker, "Real-time shape estimation for continuum robots using vision",
Robotica 23, 2005; reference 11 of J. M. Croom et al., "Visual sensing of continuum robot shape
using self-organizing maps", IEEE ICRA 2010. There one camera sees a trunk that bends in a
plane; here two views see it bend in space.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from ..arrays import Floats, Integers, check_array
from ..assessment import curve_covariance
from ..backbone import Backbone
from ..camera import StereoRig
from ..observation import Observation
from ..options import Options, check_whole
from ..reconstruction import HardFrame, Reconstruction
from .epipolar_search import epipolar_lines
from .ordering import pieces, shortest_path, triangulated

METHOD = "marker-arcs"

_MOST_PIXELS = 300_000
_MOST_BANDS = 200
# Samples of each arc, when the nearest point of the chain is looked for.
_PER_ARC = 100


@dataclass(frozen=True, eq=False)
class MarkerArcsOptions(Options):
    """Options of the arcs.

    Parameters
    ----------
    arcs : int
        Of the chain; fewer where there are too few bands for them.
    tolerance : float
        How far a band may lie from its partner's epipolar line, px.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    arcs: int = 4
    tolerance: float = 3.0

    def __post_init__(self) -> None:
        check_whole(self.arcs, "arcs", 1, 50)
        if not 0 < self.tolerance < np.inf:
            raise ValueError(f"tolerance: must be a positive number of px, is {self.tolerance!r}")


@dataclass(frozen=True, eq=False)
class ArcChain:
    """Circular arcs in a row, each leaving in the direction in which the one before ends.

    Parameters
    ----------
    base : (3,) array
        Where it begins, mm.
    frame : Rotation
        At the base; its third column is the tangent.
    bends : (m, 2) array
        Of each arc its angle, rad, as a vector in the plane across its beginning: the
        direction is the one it bends to.
    lengths : (m,) array
        mm.
    """

    base: Floats
    frame: Rotation
    bends: Floats
    lengths: Floats

    @property
    def curvatures(self) -> Floats:
        """Curvature of each arc, (m,), 1/mm."""
        return np.asarray(np.linalg.norm(self.bends, axis=1) / self.lengths)

    def sample(self, per_arc: int = _PER_ARC) -> tuple[Floats, Floats]:
        """Points and unit tangents at equal steps of each arc, (m · per_arc + 1, 3) each."""
        share = np.linspace(0, 1, per_arc + 1)
        base, frame = self.base, self.frame
        points, tangents = [base[None]], [frame.apply([[0.0, 0.0, 1.0]])]
        for bend, length in zip(self.bends, self.lengths, strict=True):
            angle = float(np.linalg.norm(bend))
            # sin(ta)/a and (1 − cos ta)/a², both fit for an arc that is straight.
            forward = share * np.sinc(share * angle / np.pi)
            aside = (share * np.sinc(share * angle / (2 * np.pi))) ** 2 / 2
            local = length * np.column_stack([aside * bend[0], aside * bend[1], forward])
            turned = share * np.sinc(share * angle / np.pi)
            local_tangent = np.column_stack(
                [turned * bend[0], turned * bend[1], np.cos(share * angle)]
            )
            points.append(base + frame.apply(local[1:]))
            tangents.append(frame.apply(local_tangent[1:]))
            base = points[-1][-1]
            frame = frame * Rotation.from_rotvec([-bend[1], bend[0], 0.0])
        return np.concatenate(points), np.concatenate(tangents)

    def backbone(self) -> Backbone:
        """The chain as a curve."""
        return Backbone.through(self.sample()[0])


def marker_arcs(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct the backbone, from the first painted band to the last, as a chain of arcs.

    The observation's pixels are those of the bands alone (`kind` "filled"): a connected piece
    is a band, its mean the marker. In each view the bands are put in a row, and both rows are
    matched in order, each band with one near its epipolar line; a band that one view does not
    show is left out. `stereosom.synthetic.painted_bands` draws such devices.

    Parameters
    ----------
    observation : Observation
    options : MarkerArcsOptions, optional

    Raises
    ------
    HardFrame
        Where too few bands are seen or match, or no chain of arcs leads through them.

    Notes
    -----
    The residuals are those of the markers: where nothing is painted, nothing is seen.
    """
    if not isinstance(options, MarkerArcsOptions):
        shared = options or Options()
        options = MarkerArcsOptions(prior=shared.prior, start=shared.start)
    bands_a, bands_b = band_row("a", observation.pixels_a), band_row("b", observation.pixels_b)
    in_a, in_b = match_rows(observation.rig, bands_a, bands_b, options.tolerance)
    points, seen = triangulated(observation.rig, bands_a[in_a], bands_b[in_b])
    if len(points) < 4:
        raise HardFrame(f"{len(points)} bands match between the views; at least 4 are needed")
    points, because = _base_first(points, observation, options)
    curve = fit_arcs(points, options.arcs).backbone()
    residuals = []
    for view, camera, bands in (
        ("a", observation.rig.a, bands_a[in_a][seen]),
        ("b", observation.rig.b, bands_b[in_b][seen]),
    ):
        path = camera.project(curve.sample(1000))
        beside = np.asarray(cKDTree(path).query(bands)[0])
        residual = float(np.sqrt(np.mean(beside**2)))
        if residual > max(3.0, 0.03 * float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())):
            raise HardFrame(
                f"view {view}: no chain of {options.arcs} arcs leads through the bands "
                f"(it lies {residual:.0f} px beside them)"
            )
        residuals.append(residual)
    return Reconstruction(
        index=observation.index,
        time=observation.time,
        status="ok",
        reason=because,
        method=METHOD,
        backbone=curve,
        covariance=curve_covariance(
            curve, observation, (residuals[0], residuals[1]), curve.length / len(points) / 2
        ),
        residuals=(residuals[0], residuals[1]),
        radius=options.prior.radius,
    )


def band_row(view: str, pixels: Floats) -> Floats:
    """Means of the bands that (n, 2) pixels make, in a row along the device, (m, 2), px.

    Raises
    ------
    HardFrame
        Where there are too few bands, or far too many.
    """
    if len(pixels) == 0:
        raise HardFrame(f"view {view}: no device in the picture")
    if len(pixels) > _MOST_PIXELS:
        raise HardFrame(f"view {view}: {len(pixels)} pixels are too many for painted bands")
    piece = pieces(pixels)
    count = np.bincount(piece)
    sums = [np.bincount(piece, column) for column in pixels.T]
    bands = (np.column_stack(sums) / count[:, None])[count >= 0.1 * np.median(count)]
    if not 4 <= len(bands) <= _MOST_BANDS:
        raise HardFrame(
            f"view {view}: the pixels make {len(bands)} separate pieces; painted bands are 4 to "
            f"{_MOST_BANDS}"
        )
    bands = bands[np.lexsort(bands.T)]
    reach = dijkstra(cdist(bands, bands, "sqeuclidean"))
    first, last = np.unravel_index(np.argmax(reach), reach.shape)
    return np.asarray(bands[shortest_path(bands, int(first), int(last))])


def match_rows(
    rig: StereoRig, row_a: Floats, row_b: Floats, tolerance: float
) -> tuple[Integers, Integers]:
    """Match two rows of bands in order, forward or backward, by epipolar distance.

    Parameters
    ----------
    rig : StereoRig
    row_a, row_b : (n, 2) and (m, 2) array
        Bands along the device, px; either row may begin at either end.
    tolerance : float
        Largest distance from the epipolar line, px; a band without a partner costs as much.

    Returns
    -------
    in_a, in_b : (k,) arrays of int
    """
    lines = epipolar_lines(rig, row_a)
    beside = np.abs(lines[:, :2] @ row_b.T + lines[:, 2:])
    forward, cost_forward = _align(beside, tolerance)
    backward, cost_backward = _align(beside[:, ::-1], tolerance)
    if cost_forward <= cost_backward:
        return forward[:, 0], forward[:, 1]
    return backward[:, 0], len(row_b) - 1 - backward[:, 1]


def _align(beside: Floats, skip: float) -> tuple[Integers, float]:
    """Cheapest pairs in rising order, (k, 2), and their cost, by dynamic programming."""
    rows, columns = beside.shape
    cost = np.full((rows + 1, columns + 1), np.inf)
    cost[:, 0], cost[0] = skip * np.arange(rows + 1), skip * np.arange(columns + 1)
    for i in range(rows):
        for j in range(columns):
            pair = beside[i, j] if beside[i, j] <= skip else np.inf
            cost[i + 1, j + 1] = min(
                cost[i, j] + pair, cost[i, j + 1] + skip, cost[i + 1, j] + skip
            )
    pairs = []
    i, j = rows, columns
    while i > 0 and j > 0:
        if cost[i, j] == cost[i - 1, j] + skip:
            i -= 1
        elif cost[i, j] == cost[i, j - 1] + skip:
            j -= 1
        else:
            i, j = i - 1, j - 1
            pairs.append((i, j))
    return np.array(pairs[::-1], dtype=np.intp).reshape(-1, 2), float(cost[rows, columns])


def _base_first(points: Floats, observation: Observation, options: Options) -> tuple[Floats, str]:
    """The markers from base to tip, (n, 3), and how that was decided."""
    if options.start is not None:
        known, because = options.start.base, ""
    elif options.prior.base is not None:
        known, because = options.prior.base, "the base is the end nearest to the given one"
    else:
        rig, ends = observation.rig, points[[0, -1]]
        low = rig.a.project(ends)[:, 1] + rig.b.project(ends)[:, 1]
        known = ends[int(np.argmax(low))]
        because = "nothing tells the base from the tip: the end lower in the pictures was taken"
    first, last = np.linalg.norm(points[[0, -1]] - known, axis=1)
    return (points if first <= last else points[::-1]), because


def fit_arcs(points: Any, arcs: int) -> ArcChain:
    """Least-squares chain of tangent-continuous arcs from the first point to the last.

    Parameters
    ----------
    points : (n, 3) array
        Along the device, mm; at least four.
    arcs : int
        Lowered to what the points determine: 2n + 2 numbers for 3 arcs + 5 unknowns.

    Raises
    ------
    ValueError
        Where there are fewer than four points, or they lie in one place.

    Examples
    --------
    A half circle of radius 10 mm is one arc of curvature 0.1/mm:

    >>> angle = np.linspace(0, np.pi, 9)
    >>> around = 10 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)])
    >>> fit_arcs(around, 1).curvatures.round(3)
    array([0.1])
    """
    points = check_array(points, "points", (None, 3))
    if len(points) < 4:
        raise ValueError(f"points: {len(points)} are too few for arcs; give at least 4")
    arcs = max(1, min(arcs, (2 * len(points) - 3) // 3))
    rough = Backbone.through(points)  # refuses points in one place
    heading = rough.tangent(rough.arc_lengths(arcs + 1))
    across = np.linalg.svd(heading[:1])[2][1]
    frame = Rotation.from_matrix(
        np.column_stack([across, np.cross(heading[0], across), heading[0]])
    )
    bends, turned = np.empty((arcs, 2)), frame
    for arc in range(arcs):
        x, y, z = turned.inv().apply(heading[arc + 1])
        aside = float(np.hypot(x, y))
        bends[arc] = np.arctan2(aside, z) / max(aside, 1e-12) * np.array([x, y])
        turned = turned * Rotation.from_rotvec([-bends[arc, 1], bends[arc, 0], 0.0])

    def chain(unknowns: Floats) -> ArcChain:
        turn = Rotation.from_rotvec([unknowns[3], unknowns[4], 0.0])
        return ArcChain(
            base=points[0] + rough.length * unknowns[:3],
            frame=frame * turn,
            bends=unknowns[5 : 5 + 2 * arcs].reshape(arcs, 2),
            lengths=rough.length / arcs * np.exp(unknowns[5 + 2 * arcs :]),
        )

    def residuals(unknowns: Floats) -> Floats:
        samples, tangents = chain(unknowns).sample()
        nearest = np.asarray(cKDTree(samples).query(points[1:-1])[1])
        offset = points[1:-1] - samples[nearest]
        along = np.sum(offset * tangents[nearest], axis=1, keepdims=True)
        ends = points[[0, -1]] - samples[[0, -1]]
        return np.concatenate([(offset - along * tangents[nearest]).ravel(), ends.ravel()])

    begin = np.concatenate([np.zeros(5), bends.ravel(), np.zeros(arcs)])
    return chain(least_squares(residuals, begin, max_nfev=60).x)
