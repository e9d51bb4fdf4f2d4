"""From points in space without order to a curve from base to tip, for every baseline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from ..arrays import Booleans, Floats, Integers
from ..assessment import assess
from ..backbone import Backbone
from ..camera import StereoRig, triangulate
from ..ends import Ends, oriented_ends, reach_ends, trim_to_shared_stretch
from ..observation import Observation
from ..options import Options
from ..reconstruction import HardFrame, Reconstruction
from ..som import Trainer

# No picture of a thin device fills as much as a third of a megapixel.
_MOST_PIXELS = 300_000
# All pairs of this many points are linked, which costs a few megabytes.
_PATH_POINTS = 800
# A path that leaps over this share of its length joins what does not belong together.
_LONGEST_LEAP = 0.3
# A curve lies no farther beside the device than this share of the device's extent, RMS.
_FARTHEST = 0.02


def begin(observation: Observation, options: Options) -> tuple[Observation, Ends]:
    """Leave specks out, trim to the stretch that both views share, find its ends, base first.

    Raises
    ------
    HardFrame
        Where a view shows no device, or too little to have two ends.
    """
    for view, pixels in (("a", observation.pixels_a), ("b", observation.pixels_b)):
        if len(pixels) == 0:
            raise HardFrame(f"view {view}: no device in the picture")
        if len(pixels) > _MOST_PIXELS:
            raise HardFrame(f"view {view}: {len(pixels)} pixels are too many for a thin device")
    clean = replace(
        observation,
        pixels_a=without_specks(observation.pixels_a),
        pixels_b=without_specks(observation.pixels_b),
    )
    seen = trim_to_shared_stretch(clean)
    # Evenly spread pixels stay linked where a draw by rows falls into pieces.
    sparse = replace(
        seen,
        pixels_a=thinned(seen.pixels_a, _PATH_POINTS),
        pixels_b=thinned(seen.pixels_b, _PATH_POINTS),
    )
    return seen, oriented_ends(sparse, options)


def pieces(pixels: Floats) -> Integers:
    """Which connected piece each of (n, 2) pixels belongs to, (n,), numbered from zero.

    Pixels are connected within 2 px, so that one missing between them does not part them.

    Examples
    --------
    >>> pieces(np.array([[0.0, 0.0], [1.0, 1.0], [9.0, 9.0]]))
    array([0, 0, 1], dtype=int32)
    """
    pairs = cKDTree(pixels).query_pairs(2.0, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(pixels), len(pixels)))
    return np.asarray(connected_components(links, directed=False)[1])


def without_specks(pixels: Floats) -> Floats:
    """The (n, 2) pixels but for pieces of less than a twentieth of the largest one's pixels."""
    piece = pieces(pixels)
    count = np.bincount(piece)
    return np.asarray(pixels[count[piece] >= 0.05 * count.max()])


def finish(
    observation: Observation, references: Floats, ends: Ends, options: Options, method: str
) -> Reconstruction:
    """Reach for the ends of the masks, fit a spline of six pieces, and assess it.

    Parameters
    ----------
    observation : Observation
    references : (k, 3) array
        Along the device, from either end, mm.
    ends : Ends
        Tell which end is the base.
    options : Options
    method : str

    Raises
    ------
    HardFrame
        Where the curve does not follow the device.
    """
    if len(references) < 3:
        raise HardFrame("fewer than three points along the device were found")
    first, last = np.linalg.norm(references[[0, -1]] - ends.base, axis=1)
    references = reach_ends(observation, references if first <= last else references[::-1])
    curve = Backbone.fit_spline(references, segments=6)
    result = assess(
        curve,
        observation,
        end_deviation=curve.length / (len(references) - 1),
        method=method,
        reason=ends.because,
        radius=options.prior.radius,
    )
    assert result.residuals is not None
    for view, residual, pixels in zip(
        "ab", result.residuals, (observation.pixels_a, observation.pixels_b), strict=True
    ):
        # A path that winds through noise is long enough to hide its residual in its length.
        if residual > max(3.0, _FARTHEST * float(np.linalg.norm(np.ptp(pixels, axis=0)))):
            raise HardFrame(
                f"view {view}: no curve was found that follows the device "
                f"(it lies {residual:.0f} px beside it)"
            )
    return result


def thinned(points: Floats, at_most: int) -> Floats:
    """At most so many of (n, d) points, evenly spread: one in each cell of a grid.

    The result does not depend on the order of the points.

    Examples
    --------
    Of 0 to 7, in four cells of length 2.19:

    >>> thinned(np.arange(8.0)[:, None], 4).ravel()
    array([0., 3., 5., 7.])
    """
    points = points[np.lexsort(points.T)]
    cell = float(np.ptp(points, axis=0).max()) / at_most or 1.0
    while len(points) > at_most:
        cells = np.floor((points - points.min(axis=0)) / cell)
        _, first = np.unique(cells, axis=0, return_index=True)
        if len(first) <= at_most:
            return np.asarray(points[np.sort(first)])
        cell *= 1.25
    return points


def shortest_path(points: Floats, start: int, stop: int) -> Integers:
    """Indices along the path of small steps between two of (n, d) points.

    All pairs are linked, at the square of their distance: of two ways the one of smaller
    steps is the cheaper, so that the path follows a curve instead of cutting across.

    Examples
    --------
    Around a half circle, not through it:

    >>> angle = np.linspace(0, np.pi, 7)
    >>> around = np.column_stack([np.cos(angle), np.sin(angle)])
    >>> [int(i) for i in shortest_path(around, 0, 6)]
    [0, 1, 2, 3, 4, 5, 6]
    """
    # The matrix's zeros are no links: points that coincide are told apart by a trifle.
    cost = cdist(points, points, "sqeuclidean")
    cost += 1e-12 * max(float(cost.max()), 1e-300)
    _, before = dijkstra(cost, indices=[start], return_predecessors=True)
    path = [stop]
    while path[-1] != start:
        path.append(int(before[0, path[-1]]))
    return np.array(path[::-1], dtype=np.intp)


def path_between(points: Floats, ends: Ends) -> Floats:
    """The path through a cloud (n, 3) from base to tip, at equal steps, (200, 3), mm.

    Raises
    ------
    HardFrame
        Where the cloud lies in one place, or falls into pieces.
    """
    if len(points) < 3:
        raise HardFrame(f"the views agree on {len(points)} points in front of both cameras")
    drawn = thinned(points, _PATH_POINTS)
    if len(drawn) < 3 or not np.ptp(drawn, axis=0).any():
        raise HardFrame("the points that both views agree on lie in one place")
    start, stop = np.asarray(cKDTree(drawn).query(np.stack([ends.base, ends.tip]))[1])
    if start == stop:
        raise HardFrame("both ends of the device lie in one place")
    path = drawn[shortest_path(drawn, int(start), int(stop))]
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    if len(path) < 4 or steps.max() > _LONGEST_LEAP * steps.sum():
        raise HardFrame("the points that both views agree on fall into separate pieces")
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    at = np.linspace(0.0, reach[-1], 200)
    return np.column_stack([np.interp(at, reach, column) for column in path.T])


def middle_of(points: Floats, path: Floats, count: int, epochs: int = 5) -> Floats:
    """Draw a path into the middle of its points by batch training, (k, 3), in the path's order.

    Parameters
    ----------
    points : (n, 3) array
        Of the device, mm.
    path : (m, 3) array
        Equal steps along it.
    count : int
        Of reference vectors; those without a point leave, so that k ≤ `count`.
    epochs : int
    """
    references = path[np.linspace(0, len(path) - 1, count).astype(int)]
    trainer = Trainer(points)
    for _ in range(epochs):
        references, counts = trainer.epoch(references, neighborhood=1)
        references = references[counts > 0]
    return np.asarray(references)


def triangulated(rig: StereoRig, pixels_a: Floats, pixels_b: Floats) -> tuple[Floats, Booleans]:
    """Triangulate what can be seen: points in front of both cameras, and which pairs they are.

    Parameters
    ----------
    rig : StereoRig
    pixels_a, pixels_b : (n, 2) array
        Pairs.

    Returns
    -------
    points : (m, 3) array, mm
    seen : (n,) array of bool
        False where the rays are parallel or meet behind a camera.
    """
    sine = np.linalg.norm(np.cross(rig.a.rays(pixels_a), rig.b.rays(pixels_b)), axis=1)
    seen = sine > 1e-6
    points = triangulate(rig, pixels_a[seen], pixels_b[seen])
    in_front = (rig.a.depth(points) > 0) & (rig.b.depth(points) > 0)
    seen[seen] = in_front
    return points[in_front], seen
