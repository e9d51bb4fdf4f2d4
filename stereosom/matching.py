"""Which places of two middle lines show one point: epipolar matching along both lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Floats, Integers
from .camera import Camera, StereoRig, triangulate
from .reconstruction import HardFrame

# Costs, px². A step along one line only, and a point of either end that has no partner: one
# that may be hidden, and one that lies beyond the border of the other view.
_ONE_SIDED, _UNMATCHED, _BEYOND = 0.5, 25.0, 0.45

_NEITHER = (False, False)


@dataclass(frozen=True, eq=False)
class Matching:
    """Matched places (m,) of line a and line b, both not decreasing, and the cost, px².

    `lengths` is how many places both lines have.
    """

    in_a: Integers
    in_b: Integers
    cost: float
    lengths: tuple[int, int]

    @property
    def whole(self) -> tuple[bool, bool]:
        """Whether both lines are matched from their first places on, and up to their last."""
        n, m = self.lengths
        return (
            bool(self.in_a[0] == 0 and self.in_b[0] == 0),
            bool(self.in_a[-1] == n - 1 and self.in_b[-1] == m - 1),
        )


def match_monotone(
    height_a: Floats,
    height_b: Floats,
    open_a: tuple[bool, bool] = _NEITHER,
    open_b: tuple[bool, bool] = _NEITHER,
) -> Matching:
    """Match two sequences in order, so that matched values differ least (dynamic programming).

    Ends may stay unmatched, at a price: one view may see farther than the other.

    Parameters
    ----------
    height_a : (n,) array
    height_b : (m,) array
        Epipolar angle along each line, times the focal length, px.
    open_a, open_b : (bool, bool)
        Whether each line begins and stops at the border of its view, so that the other view
        may see the device go on.

    Returns
    -------
    Matching
        The cost is the mean over all places of both lines.

    Notes
    -----
    H. Sakoe, S. Chiba, "Dynamic programming algorithm optimization for spoken word
    recognition", IEEE Transactions on Acoustics, Speech, and Signal Processing 26(1), 1978.

    Examples
    --------
    >>> matching = match_monotone(np.array([0.0, 10, 20]), np.array([0.0, 20, 40]))
    >>> list(zip(matching.in_a.tolist(), matching.in_b.tolist()))
    [(0, 0), (1, 0), (2, 1)]
    """
    n, m = len(height_a), len(height_b)
    difference = (height_a[:, None] - height_b) ** 2
    total = np.empty((n, m))
    # What is left out of one line at an end lies beyond the border of the other's view, or not.
    start_a, stop_a = (_BEYOND if beyond else _UNMATCHED for beyond in open_b)
    start_b, stop_b = (_BEYOND if beyond else _UNMATCHED for beyond in open_a)
    skipped_b = np.arange(m) * start_b
    for i in range(n):
        if i == 0:
            arrive = skipped_b.copy()
        else:
            arrive = total[i - 1] + _ONE_SIDED
            arrive[1:] = np.minimum(arrive[1:], total[i - 1, :-1])
            arrive[0] = min(arrive[0], i * start_a)
        # Going on along b adds up: the best place to have come in, by a running minimum.
        along = np.cumsum(difference[i] + _ONE_SIDED)
        total[i] = np.minimum.accumulate(arrive + difference[i] - along) + along
    last_a = total[:, -1] + np.arange(n)[::-1] * stop_a
    last_b = total[-1] + np.arange(m)[::-1] * stop_b
    i, j = n - 1, m - 1
    if last_a.min() < last_b.min():
        i = int(np.argmin(last_a))
    else:
        j = int(np.argmin(last_b))
    cost = min(float(last_a.min()), float(last_b.min())) / (n + m)
    pairs = [(i, j)]
    while True:
        here = total[i, j] - difference[i, j]
        ways = []
        if i and j:
            ways.append((total[i - 1, j - 1], i - 1, j - 1))
        if i:
            ways.append((total[i - 1, j] + _ONE_SIDED, i - 1, j))
        if j:
            ways.append((total[i, j - 1] + _ONE_SIDED, i, j - 1))
        begun = min(i * start_a if j == 0 else np.inf, j * start_b if i == 0 else np.inf)
        best = min(ways, default=(np.inf, 0, 0))
        if begun <= best[0] or here < best[0] - 1e-6 * (1 + abs(here)):
            break
        _, i, j = best
        pairs.append((i, j))
    in_a, in_b = np.array(pairs[::-1], dtype=np.intp).T
    return Matching(in_a, in_b, cost, (n, m))


def match_lines(
    rig: StereoRig,
    line_a: Floats,
    line_b: Floats,
    open_a: tuple[bool, bool] = _NEITHER,
    open_b: tuple[bool, bool] = _NEITHER,
) -> tuple[Matching, Floats]:
    """Match two middle lines along their epipolar lines.

    Parameters
    ----------
    rig : StereoRig
    line_a, line_b : (n, 2) array
        From end to end, px; line b may run either way.
    open_a, open_b : (bool, bool)
        As of `match_monotone`.

    Returns
    -------
    Matching; (n, 2) array
        Line b the way that line a runs.

    Raises
    ------
    HardFrame
        Where too little of both lines matches.
    """
    focal = (rig.a.focal_length + rig.b.focal_length) / 2
    height_a = rig.epipolar_angle(rig.a, line_a) * focal
    height_b = rig.epipolar_angle(rig.b, line_b) * focal
    found = []
    # Where a device enters both views, its ends at the borders belong together.
    entering = open_a[0] != open_a[1] and open_b[0] != open_b[1]
    for way, turned_b in ((1, open_b), (-1, (open_b[1], open_b[0]))):
        if not entering or open_a == turned_b:
            matching = match_monotone(height_a, height_b[::way], open_a, turned_b)
            found.append((matching.cost, way, matching))
    _, way, matching = min(found, key=lambda one: one[0])
    line_b = line_b[::way]
    if len(np.unique(matching.in_a)) < 8 or len(np.unique(matching.in_b)) < 8:
        raise HardFrame("the two views do not show the same device: their lines do not match")
    return matching, line_b


def space_curve(rig: StereoRig, line_a: Floats, line_b: Floats) -> tuple[Floats, float]:
    """Points in space along two middle lines, in order, and the cost of their matching.

    Parameters
    ----------
    rig : StereoRig
    line_a, line_b : (n, 2) array
        From end to end, px; line b may run either way.

    Returns
    -------
    (m, 3) array, mm; float, px²

    Raises
    ------
    HardFrame
        Where too little of both lines matches.
    """
    matching, line_b = match_lines(rig, line_a, line_b)
    points = triangulate(rig, line_a[matching.in_a], line_b[matching.in_b])
    return go_on(rig, points, (line_a, line_b), matching), matching.cost


def go_on(
    rig: StereoRig,
    points: Floats,
    lines: tuple[Floats, Floats],
    matching: Matching,
    closed: tuple[bool, bool] = (True, True),
) -> Floats:
    """Lengthen a curve (n, 3) through matched lines, straight on, by what one view alone sees.

    Not where it is not `closed`, but goes on beyond the border of a view.
    """
    line_a, line_b = lines
    first_a, last_a = matching.in_a[[0, -1]]
    first_b, last_b = matching.in_b[[0, -1]]
    before = [(rig.a, line_a[:first_a][::-1]), (rig.b, line_b[:first_b][::-1])]
    after = [(rig.a, line_a[last_a + 1 :]), (rig.b, line_b[last_b + 1 :])]
    for camera, pixels in before if closed[0] else []:
        points = _go_on(points[::-1], camera, pixels)[::-1]
    for camera, pixels in after if closed[1] else []:
        points = _go_on(points, camera, pixels)
    return points


def _go_on(points: Floats, camera: Camera, pixels: Floats) -> Floats:
    """Add the points, straight on from the last ones, that one view alone sees as `pixels`."""
    if len(pixels) == 0:
        return points
    tail = points[-min(len(points), 16) :]
    heading = tail[-1] - tail[0]
    norm = float(np.linalg.norm(heading))
    if norm == 0:
        return points
    heading = heading / norm
    rays = camera.rays(pixels)
    cosine = rays @ heading
    sine_squared = 1 - cosine**2
    between = points[-1] - camera.center
    reach = (rays @ between - cosine * (heading @ between)) / np.maximum(sine_squared, 1e-9)
    added = camera.center + reach[:, None] * rays
    # Seen nearly end-on, straight on could be anywhere.
    return np.vstack([points, added[sine_squared > 0.04]])
