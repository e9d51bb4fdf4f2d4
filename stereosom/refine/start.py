"""Where a fit begins that knows nothing: a smooth curve through the middle lines of both masks."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from ..backbone import Backbone
from ..camera import Camera, StereoRig, triangulate
from ..depth_sweep import sweep_depth, widths_along
from ..matching import Matching, go_on, match_lines, space_curve
from ..middle_line import MiddleLine, middle_line
from ..middle_line.centering import directions
from ..observation import Observation, View
from ..reconstruction import HardFrame
from .spline import ORDER, SplineBasis, spline_basis

# Points of the curve that matched places make.
_SAMPLES = 200
# Points to a piece of the spline that is lifted, and pieces at least and at most.
_POINTS_A_PIECE, _PIECES = 5, (20, 40)
# Rounds of Gauss-Newton, and how often the stiffness is chosen anew in each.
_ROUNDS, _CHOICES = 2, 2
# In the first, no point is taken to be nearer or farther than so many times the middle one.
_DEPTHS = (0.5, 2.0)
# Beside an error across a middle line, one along it weighs so much: where both views agree on
# an end, and elsewhere, where it only keeps the points from sliding.
_AT_ENDS, _SLIDING = 0.5, 0.001
# Stiffness to begin with, beside what the lines tell; and what holds where they tell nothing.
_STIFF, _FLOOR = 0.1, 1e-10
# A line that ends so near to the border of its view, in widths and px, ends because of it.
_BORDER_WIDTHS, _BORDER_PX = 0.5, 2.0
# Middle lines are off by this at least, px.
_LEAST_PX = 0.1


def first_curve(seen: Observation) -> tuple[Floats, float]:
    """Points (n, 3) along the device, mm, and its radius, mm, from the masks alone.

    Parameters
    ----------
    seen : Observation
        Trimmed to the stretch that both views share.

    Raises
    ------
    HardFrame
        Where the masks hold no two lines that match.
    """
    rig = seen.rig
    line_a, line_b = middle_line(seen.pixels_a), middle_line(seen.pixels_b)
    open_a, open_b = _at_border(seen, "a", line_a), _at_border(seen, "b", line_b)
    matching, points_b = match_lines(rig, line_a.points, line_b.points, open_a, open_b)
    if not np.array_equal(points_b, line_b.points):
        open_b = open_b[::-1]
    lines = (line_a.points, points_b)
    closed = (not (open_a[0] or open_b[0]), not (open_a[1] or open_b[1]))
    try:
        telling = (line_a.independent, line_b.independent)
        curve = lift(rig, lines, matching, closed, telling)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise HardFrame(f"the two views' lines make no curve in space ({error})") from None
    curve = go_on(rig, curve, lines, matching, closed)
    radius = _radius(rig, curve, (line_a.width, line_b.width))
    return _without_last(curve, radius), radius


def matched_curve(seen: Observation) -> tuple[Floats, float]:
    """As `first_curve`, straight through the matched places: good where the views are far apart.

    The middle lines' ends, which lean to a corner of the masks, are left out. What a point is
    beside the middle makes no difference to what is fitted from there.
    """
    rig = seen.rig
    line_a, line_b = (
        middle_line(pixels, centered=False) for pixels in (seen.pixels_a, seen.pixels_b)
    )
    points, _ = space_curve(rig, line_a.points[1:-1], line_b.points[1:-1])
    radius = _radius(rig, points, (line_a.width, line_b.width))
    try:
        return Backbone.fit_spline(points, _PIECES[0]).polyline(_SAMPLES), radius
    except (ValueError, np.linalg.LinAlgError) as error:
        raise HardFrame(f"the two views' lines make no curve in space ({error})") from None


def _radius(rig: StereoRig, curve: Floats, widths: tuple[float, float]) -> float:
    """Of a device along a curve (n, 3), by its widths in both views, px, mm."""
    radii = [
        width / 2 * float(camera.pixel_size(curve).mean())
        for width, camera in zip(widths, (rig.a, rig.b), strict=True)
    ]
    return float(np.mean(radii))


def swept_curve(seen: Observation) -> Floats:
    """Points (n, 3) along the line that view a sees, by a sweep over its depth, mm.

    Raises
    ------
    HardFrame
        Where no depth makes the lines meet.
    """
    assert seen.field_of_view is not None
    lines = middle_line(seen.pixels_a).points, middle_line(seen.pixels_b).points
    widths = widths_along(lines[0], seen.pixels_a)
    return sweep_depth(seen.rig, lines, seen.field_of_view, widths)


def _without_last(curve: Floats, length: float) -> Floats:
    """A curve (n, 3) without so much of it at either end, where a skeleton leans to a corner."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    inner = (reach >= length) & (reach <= reach[-1] - length)
    return curve[inner] if np.count_nonzero(inner) > len(curve) // 2 else curve


def _at_border(seen: Observation, view: View, line: MiddleLine) -> tuple[bool, bool]:
    """Whether a middle line begins, and stops, at the border of its view."""
    near = seen.at_border(view, line.points[[0, -1]], _BORDER_WIDTHS * line.width + _BORDER_PX)
    return bool(near[0]), bool(near[1])


def lift(
    rig: StereoRig,
    lines: tuple[Floats, Floats],
    matching: Matching,
    closed: tuple[bool, bool],
    telling: tuple[float, float] = (1.0, 1.0),
) -> Floats:
    """The smooth curve in space whose pictures lie on two matched lines.

    A pair of matched places says where the curve runs across each line, and nothing along it:
    where both lines run along an epipolar plane, depth comes from the neighbors, and from the
    ends. How smooth the curve is follows from the lines themselves (see `fit`).

    Parameters
    ----------
    rig : StereoRig
    lines : pair of (n, 2) arrays
        From end to end, the same way, px.
    matching : Matching
    closed : (bool, bool)
        Whether the device ends where the lines begin and stop.
    telling : (float, float)
        What a place of either line tells, beside one that errs on its own.

    Returns
    -------
    (n, 3) array
        Points along the matched stretch, mm.
    """
    basis = spline_basis(int(np.clip(len(lines[0]) / _POINTS_A_PIECE, *_PIECES)))
    cameras = (rig.a, rig.b)
    places = (lines[0][matching.in_a], lines[1][matching.in_b])
    headings = (directions(lines[0])[matching.in_a], directions(lines[1])[matching.in_b])
    points = _about(rig, places)
    # Even steps along the pictures: in space, depths that are off would count as length.
    steps = [
        np.linalg.norm(np.diff(pixels, axis=0), axis=1) * float(camera.pixel_size(points).mean())
        for camera, pixels in zip(cameras, places, strict=True)
    ]
    reach = np.concatenate([[0.0], np.cumsum(np.maximum(*steps))])
    values = basis.at(reach / reach[-1])
    along = np.full(len(points), _SLIDING)
    at_ends = np.zeros(len(points))
    for end, place in enumerate((0, -1)):
        if closed[end] and matching.whole[end]:
            along[place] = at_ends[place] = _AT_ENDS
    across = np.repeat(telling, len(points))
    weights = np.concatenate([across, along, at_ends])
    stiffness = 0.0
    for _ in range(_ROUNDS):
        rows, wanted = _equations(cameras, places, headings, points)
        control, stiffness = _smoothest(basis, values, rows, wanted, weights, stiffness)
        points = values @ control
    return basis.values @ control


def _about(rig: StereoRig, places: tuple[Floats, Floats]) -> Floats:
    """Points (n, 3) where matched places lie, but none very much nearer or farther than most."""
    rays = rig.a.rays(places[0])
    per_depth = rays / (rays @ rig.a.axis)[:, None]
    depth = rig.a.depth(triangulate(rig, *places))
    middle = float(np.median(depth))
    depth = np.clip(depth, _DEPTHS[0] * middle, _DEPTHS[1] * middle)
    return np.asarray(rig.a.center + depth[:, None] * per_depth)


def _equations(
    cameras: tuple[Camera, Camera],
    places: tuple[Floats, Floats],
    headings: tuple[Floats, Floats],
    points: Floats,
) -> tuple[Floats, Floats]:
    """Linear equations that matched places set for the n points in space near `points`, px.

    Returns
    -------
    rows : (4, n, 3) array
        Across line a, across line b, along both, and along a more than along b.
    wanted : (4, n) array
    """
    rows, wanted = [], []
    for camera, pixels, heading in zip(cameras, places, headings, strict=True):
        jacobian, off = camera.jacobian(points), pixels - camera.project(points)
        for direction in (np.column_stack([-heading[:, 1], heading[:, 0]]), heading):
            row = np.einsum("ni,nij->nj", direction, jacobian)
            rows.append(row)
            wanted.append(np.sum(direction * off, axis=1) + np.sum(row * points, axis=1))
    across_a, along_a, across_b, along_b = range(4)
    left, right = (
        np.stack([of[across_a], of[across_b],
                  (of[along_a] + of[along_b]) / 2, (of[along_a] - of[along_b]) / 2])
        for of in (rows, wanted)
    )  # fmt: skip
    return left, right


def _smoothest(
    basis: SplineBasis,
    values: Floats,
    rows: Floats,
    wanted: Floats,
    weights: Floats,
    stiffness: float,
) -> tuple[Floats, float]:
    """Control points (m, 3) of a spline, as stiff as the evidence says, and how stiff that is.

    D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992, as in `fit`.

    Parameters
    ----------
    basis : SplineBasis
    values : (n, m) array
        Of the basis, at the n points that `rows` and `wanted` are about.
    rows, wanted
        As from `_equations`.
    weights : (4n,) array
    stiffness : float
        To begin with; zero: stiff.
    """
    told = weights > 0
    at = np.tile(np.arange(len(values)), len(rows))[told]
    whole = values[at][:, :, None] * rows.reshape(-1, 3)[told][:, None, :]
    whole = whole.reshape(len(at), -1)
    wanted, weights = wanted.ravel()[told], weights[told]
    weighted = whole * weights[:, None]
    matrix, side = weighted.T @ whole, weighted.T @ wanted
    stiff = np.kron(basis.roughness, np.eye(3))
    stiffness = stiffness or _STIFF * float(np.trace(matrix) / np.trace(stiff))
    floor = _FLOOR * float(np.trace(matrix)) / len(matrix) * np.eye(len(matrix))
    for _ in range(_CHOICES):
        inverse = np.linalg.inv(matrix + stiffness * stiff + floor)
        solution = inverse @ side
        left = wanted - whole @ solution
        determined = 3 * (basis.count - ORDER) - stiffness * float(np.sum(inverse * stiff))
        count = max(float(weights.sum()) - determined, 1.0)
        noise = max(float(weights @ left**2) / count, _LEAST_PX**2)
        rough = max(float(solution @ stiff @ solution), 1e-12)
        stiffness = noise * max(determined, 1.0) / rough
    return np.asarray(solution.reshape(-1, 3)), stiffness
