"""A chain of circular arcs through bands that are painted on the device.

M. W. Hannan, I. D. Walker, "Real-time shape estimation for continuum robots using vision",
Robotica 23, 2005; reference 11 of J. M. Croom et al., "Visual sensing of continuum robot shape
using self-organizing maps", IEEE ICRA 2010. There one camera sees a trunk that bends in a
plane; here two views see it bend in space.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..arrays import Floats, Integers
from ..assessment import curve_covariance
from ..camera import StereoRig
from ..observation import Observation
from ..options import Options, check_whole
from ..reconstruction import HardFrame, Reconstruction
from .arc_chain import fit_arcs
from .epipolar_search import epipolar_lines
from .ordering import pieces, shortest_path, triangulated

METHOD = "marker-arcs"

_MOST_PIXELS = 300_000
_MOST_BANDS = 200


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
    row = bands[shortest_path(bands, int(first), int(last))]
    if len(row) < 0.8 * len(bands):
        raise HardFrame(
            f"view {view}: {len(bands)} bands do not make one row; only {len(row)} "
            "follow each other"
        )
    return np.asarray(row)


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
