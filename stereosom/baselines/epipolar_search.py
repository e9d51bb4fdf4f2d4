"""Every pixel of one view against every pixel of the other, by epipolar geometry.

After S. Lee and T. Poston, who so triangulate the points of a catheter; reference 16 of
J. M. Croom et al., "Visual sensing of continuum robot shape using self-organizing maps", IEEE
ICRA 2010, which calls it accurate, robust, and a search by brute force. That it stays here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Floats, Integers
from ..camera import StereoRig
from ..ends import Ends
from ..observation import Observation
from ..options import Options, check_whole
from ..reconstruction import HardFrame, Reconstruction
from .ordering import (
    begin,
    finish,
    middle_of,
    path_between,
    triangulated,
)

METHOD = "epipolar-search"

# Distances held at once: 32 MB.
_CHUNK = 4_000_000
# Ten seconds of search; a thin device has some 20,000 pixels in each view.
_MOST_PAIRS = 4_000_000_000
# Two pixels that follow each other along a line within this belong to one crossing.
_GAP_PX = 2.0


@dataclass(frozen=True, eq=False)
class EpipolarSearchOptions(Options):
    """Options of the search.

    Parameters
    ----------
    points_per_view : int, optional
        Pixels drawn from each view; None takes all of them, as the method was meant.
    tolerance : float
        How far a partner may lie from its epipolar line, px.
    reference_vectors : int
        Points along the curve to which the fit is made.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    points_per_view: int | None = None
    tolerance: float = 0.5
    reference_vectors: int = 50

    def __post_init__(self) -> None:
        check_whole(self.reference_vectors, "reference_vectors", 3, 1000)
        check_search(self.points_per_view, self.tolerance)


def epipolar_search(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct the backbone from all pixel pairs on common epipolar lines.

    Parameters
    ----------
    observation : Observation
    options : EpipolarSearchOptions, optional

    Raises
    ------
    HardFrame
        Where the pixels of this observation do not allow it.

    Examples
    --------
    A quarter circle of radius 60 mm is 94 mm long:

    >>> from stereosom.synthetic import arc, converging_rig, observe
    >>> result = epipolar_search(observe(arc(60, 90), radius=1.0, rig=converging_rig(60)))
    >>> 92 < result.backbone.length < 98
    True
    """
    if not isinstance(options, EpipolarSearchOptions):
        shared = options or Options()
        options = EpipolarSearchOptions(prior=shared.prior, start=shared.start)
    seen, ends = begin(observation, options)
    cloud, path = matched_cloud(seen, ends, options.points_per_view, options.tolerance)
    references = middle_of(cloud, path, options.reference_vectors)
    return finish(seen, references, ends, options, METHOD)


def check_search(points_per_view: int | None, tolerance: float) -> None:
    """Raise ValueError where an option of the search is out of range."""
    if points_per_view is not None:
        check_whole(points_per_view, "points_per_view", 3, 1_000_000)
    if not 0 < tolerance < np.inf:
        raise ValueError(f"tolerance: must be a positive number of px, is {tolerance!r}")


def matched_cloud(
    observation: Observation, ends: Ends, points_per_view: int | None, tolerance: float
) -> tuple[Floats, Floats]:
    """The device as a point cloud, one point for a pixel of view a, and a path through it.

    A pixel whose epipolar line meets the device several times has several candidates in
    space. The false ones line up as well, but the true ones lead from base to tip in the
    shortest way: each pixel keeps the candidate that lies nearest to that path.

    Parameters
    ----------
    observation : Observation
    ends : Ends
        Of the device, between which the path runs.
    points_per_view : int or None
        Pixels drawn from each view; None takes all.
    tolerance : float
        From the epipolar line, px.

    Returns
    -------
    cloud : (n, 3) array, mm
    path : (m, 3) array, mm

    Raises
    ------
    HardFrame
        Where nothing matches, what matches is no curve, or there is too much to search.
    """
    rig = observation.rig
    pixels_a = _drawn(observation.pixels_a, points_per_view)
    pixels_b = _drawn(observation.pixels_b, points_per_view)
    if len(pixels_a) * len(pixels_b) > _MOST_PAIRS:
        raise HardFrame(
            f"{len(pixels_a)} and {len(pixels_b)} device pixels are too many to search in pairs; "
            "draw fewer with points_per_view"
        )
    owner, partners = crossings(rig, pixels_a, pixels_b, tolerance)
    candidates, in_front = triangulated(rig, pixels_a[owner], partners)
    owner = owner[in_front]
    path = path_between(candidates, ends)
    cloud = _nearest_of_each(candidates, owner, path)
    return cloud, path


def match(
    rig: StereoRig, pixels_a: Floats, pixels_b: Floats, tolerance: float
) -> tuple[Integers, Integers]:
    """All pairs of which the pixel in view b lies near the epipolar line of that in view a.

    Parameters
    ----------
    rig : StereoRig
    pixels_a, pixels_b : (n, 2) and (m, 2) array
    tolerance : float
        Largest distance from the line, px.

    Returns
    -------
    in_a, in_b : (p,) arrays of int
        Indices, ordered by the first, then the second. Memory beyond them is bounded.

    Examples
    --------
    Two eyes side by side see a point in the same row:

    >>> from stereosom.camera import Camera
    >>> k, size = [[1000, 0, 320], [0, 1000, 240], [0, 0, 1]], (640, 480)
    >>> left = Camera.from_pose(k, np.eye(3), [0, 0, 0], size)
    >>> right = Camera.from_pose(k, np.eye(3), [-5, 0, 0], size)
    >>> rows = np.array([[0.0, 10.0], [0.0, 20.0]])
    >>> match(StereoRig(left, right), rows[:1], rows, 0.5)
    (array([0]), array([0]))
    """
    lines = epipolar_lines(rig, pixels_a)
    homogeneous = np.vstack([pixels_b.T, np.ones(len(pixels_b))])
    rows = max(1, _CHUNK // max(1, len(pixels_b)))
    found = []
    for first in range(0, len(lines), rows):
        near = np.abs(lines[first : first + rows] @ homogeneous) <= tolerance
        in_a, in_b = np.nonzero(near)
        found.append((in_a + first, in_b))
    return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def epipolar_lines(rig: StereoRig, pixels_a: Floats) -> Floats:
    """Lines in view b of (n, 2) pixels in view a, (n, 3), scaled so that l·(x, y, 1) is in px."""
    lines = np.column_stack([pixels_a, np.ones(len(pixels_a))]) @ rig.fundamental.T
    # The pixel that shows the other camera has no line; nothing lies near one without direction.
    return np.asarray(lines / np.maximum(np.linalg.norm(lines[:, :2], axis=1), 1e-300)[:, None])


def crossings(
    rig: StereoRig, pixels_a: Floats, pixels_b: Floats, tolerance: float
) -> tuple[Integers, Floats]:
    """Where the epipolar line of each pixel in view a crosses the device in view b.

    Returns
    -------
    owner : (c,) array of int
        The pixel in view a.
    middle : (c, 2) array
        The mean of the pixels of one crossing, px.
    """
    in_a, in_b = match(rig, pixels_a, pixels_b, tolerance)
    if len(in_a) == 0:
        raise HardFrame("no pixel of one view lies on an epipolar line of the other")
    lines = epipolar_lines(rig, pixels_a)[in_a]
    along = pixels_b[in_b, 0] * lines[:, 1] - pixels_b[in_b, 1] * lines[:, 0]
    order = np.lexsort([along, in_a])
    in_a, in_b, along = in_a[order], in_b[order], along[order]
    begins = np.concatenate([[True], (np.diff(in_a) > 0) | (np.diff(along) > _GAP_PX)])
    first = np.nonzero(begins)[0]
    count = np.diff(np.append(first, len(in_a)))
    middle = np.add.reduceat(pixels_b[in_b], first, axis=0) / count[:, None]
    return in_a[first], np.asarray(middle)


def _drawn(pixels: Floats, count: int | None) -> Floats:
    """So many random ones of (n, 2) pixels, the same whatever order they came in."""
    pixels = pixels[np.lexsort(pixels.T)]
    if count is None or len(pixels) <= count:
        return np.asarray(pixels)
    return np.asarray(pixels[np.random.default_rng(0).choice(len(pixels), count, replace=False)])


def _nearest_of_each(candidates: Floats, owner: Integers, path: Floats) -> Floats:
    """Of the candidates of each owner the one nearest to the path, (n, 3)."""
    distance = np.asarray(cKDTree(path).query(candidates)[0])
    order = np.lexsort([distance, owner])
    first = np.concatenate([[True], np.diff(owner[order]) > 0])
    kept = order[first]
    # Stray pixels agree with something by chance, far from the path.
    near = distance[kept] <= 4 * max(float(np.median(distance[kept])), 1e-12)
    return np.asarray(candidates[kept[near]])
