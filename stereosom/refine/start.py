"""Where a fit begins that knows nothing: a smooth curve through the middle lines of both masks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..camera import Camera, StereoRig, triangulate
from ..matching import Matching, go_on, match_lines
from ..middle_line import middle_line
from ..middle_line.centering import directions
from ..observation import Observation
from ..reconstruction import HardFrame
from .spline import spline_basis

# Pieces of the spline that is lifted; the fit refines it.
_MOST_PIECES = 40
# Rounds: the depth and the speed along the curve are those of the round before; the stiffness
# is chosen anew so often in each.
_ROUNDS, _CHOICES = 3, 3
# In the first, no point is nearer or farther than so many times the middle one.
_DEPTHS = (0.5, 2.0)
# Beside an error across a middle line, one along it weighs so much: where both views agree on
# an end, and elsewhere, where it only keeps the points from sliding.
_AT_ENDS, _SLIDING = 0.2, 0.003
# Stiffness to begin with, beside what the lines tell; and what holds where they tell nothing.
_STIFF, _FLOOR = 0.1, 1e-10
# Middle lines are off by this at least, px; what is off by more than so many times their noise
# was matched wrongly and counts less.
_LEAST_PX, _ODD = 0.1, 3.0


def first_curve(seen: Observation, pieces: int) -> tuple[Floats, float]:
    """Points (n, 3) along the device, mm, and its radius, mm, from the masks alone.

    Parameters
    ----------
    seen : Observation
        Trimmed to the stretch that both views share.
    pieces : int
        Of the spline that is fitted to the middle lines.

    Raises
    ------
    HardFrame
        Where the masks hold no two lines that match.
    """
    rig = seen.rig
    line_a, line_b = middle_line(seen.pixels_a), middle_line(seen.pixels_b)
    matching, points_b = match_lines(rig, line_a.points, line_b.points)
    lines = (line_a.points, points_b)
    try:
        curve = lift(rig, lines, matching, _real_ends(seen, lines, line_a.width), pieces)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise HardFrame(f"the two views' lines make no curve in space ({error})") from None
    curve = go_on(rig, curve, lines, matching)
    radii = [
        line.width / 2 * float(camera.pixel_size(curve).mean())
        for line, camera in ((line_a, rig.a), (line_b, rig.b))
    ]
    return curve, float(np.mean(radii))


def _real_ends(seen: Observation, lines: tuple[Floats, Floats], width: float) -> tuple[bool, bool]:
    """Whether the device ends where both lines do, and not at the border of a view."""
    inside = [
        seen.distance_to_border(view, line[[0, -1]]) > 1.5 * width + 3
        for view, line in zip(("a", "b"), lines, strict=True)
    ]
    real = inside[0] & inside[1]
    return bool(real[0]), bool(real[1])


def lift(
    rig: StereoRig,
    lines: tuple[Floats, Floats],
    matching: Matching,
    real_ends: tuple[bool, bool],
    pieces: int,
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
    real_ends : (bool, bool)
        Whether the device ends where the lines begin and stop.
    pieces : int
        Of the spline.

    Returns
    -------
    (n, 3) array
        Points along the matched stretch, mm.
    """
    basis = spline_basis(min(pieces, _MOST_PIECES))
    cameras = (rig.a, rig.b)
    places = (lines[0][matching.in_a], lines[1][matching.in_b])
    headings = (directions(lines[0])[matching.in_a], directions(lines[1])[matching.in_b])
    rough = triangulate(rig, *places)
    depths, speed = [], np.zeros(len(rough) - 1)
    for camera, pixels in zip(cameras, places, strict=True):
        depth = camera.depth(rough)
        middle = float(np.median(depth))
        depths.append(np.clip(depth, _DEPTHS[0] * middle, _DEPTHS[1] * middle))
        steps = np.linalg.norm(np.diff(pixels, axis=0), axis=1)
        speed = np.maximum(speed, steps * middle / camera.focal_length)
    along = np.full(len(rough), _SLIDING)
    at_ends = np.zeros(len(rough))
    for end, place in enumerate((0, -1)):
        if real_ends[end] and matching.whole[end]:
            along[place] = at_ends[place] = _AT_ENDS
    across = np.ones(2 * len(rough))
    stiffness = 0.0
    for _ in range(_ROUNDS):
        reach = np.concatenate([[0.0], np.cumsum(speed)])
        values = basis.at(reach / reach[-1])
        rows, wanted = _equations(cameras, places, headings, depths)
        weights = np.concatenate([across, along, at_ends])
        system = _System.of(values, rows, wanted, weights)
        control, stiffness = system.smoothest(basis.roughness, stiffness)
        points = values @ control
        depths = [camera.depth(points) for camera in cameras]
        speed = np.linalg.norm(np.diff(points, axis=0), axis=1)
        off = system.residuals(control)[: len(across)]
        spread = max(1.4826 * float(np.median(np.abs(off))), _LEAST_PX)
        across = 1 / (1 + (off / (_ODD * spread)) ** 2)
    return basis.values @ control


def _equations(
    cameras: tuple[Camera, Camera],
    places: tuple[Floats, Floats],
    headings: tuple[Floats, Floats],
    depths: list[Floats],
) -> tuple[Floats, Floats]:
    """Linear equations that matched pixels set for n points in space, px.

    In a picture, (P₁₂ − x P₃) X over the depth of X is how far X lies from a pixel x: exactly
    linear, but for the depth, which need not be exact.

    Returns
    -------
    rows : (4, n, 3) array
        Across line a, across line b, along both, and along a more than along b.
    wanted : (4, n) array
    """
    rows, wanted = [], []
    for camera, pixels, heading, depth in zip(cameras, places, headings, depths, strict=True):
        off = camera.projection[:2] - pixels[:, :, None] * camera.projection[2]
        off /= depth[:, None, None]
        for direction in (np.column_stack([-heading[:, 1], heading[:, 0]]), heading):
            row = np.einsum("ni,nij->nj", direction, off)
            rows.append(row[:, :3])
            wanted.append(-row[:, 3])
    across_a, along_a, across_b, along_b = range(4)
    mixed = [
        np.stack([of[across_a], of[across_b],
                  (of[along_a] + of[along_b]) / 2, (of[along_a] - of[along_b]) / 2])
        for of in (rows, wanted)
    ]  # fmt: skip
    return mixed[0], mixed[1]


@dataclass(frozen=True, eq=False)
class _System:
    """Weighted linear equations for the control points (m, 3) of a spline."""

    rows: Floats
    wanted: Floats
    weights: Floats

    @classmethod
    def of(cls, values: Floats, rows: Floats, wanted: Floats, weights: Floats) -> _System:
        """Equations `rows` (4, n, 3) for the points `values` (n, m) times the control points."""
        told = weights > 0
        at = np.tile(np.arange(len(values)), len(rows))[told]
        of_points = rows.reshape(-1, 3)[told]
        whole = (values[at][:, :, None] * of_points[:, None, :]).reshape(len(at), -1)
        return cls(whole, wanted.ravel()[told], weights[told])

    def residuals(self, control: Floats) -> Floats:
        """What is left of each equation, px."""
        return self.wanted - self.rows @ control.ravel()

    def smoothest(self, roughness: Floats, stiffness: float) -> tuple[Floats, float]:
        """The control points, and the stiffness that the evidence chooses, from another one.

        D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992, as in `fit`.
        """
        weighted = self.rows * self.weights[:, None]
        matrix, side = weighted.T @ self.rows, weighted.T @ self.wanted
        stiff = np.kron(roughness, np.eye(3))
        stiffness = stiffness or _STIFF * float(np.trace(matrix) / np.trace(stiff))
        floor = _FLOOR * float(np.trace(matrix)) / len(matrix) * np.eye(len(matrix))
        bends = 3 * (len(roughness) - 3)
        for _ in range(_CHOICES):
            inverse = np.linalg.inv(matrix + stiffness * stiff + floor)
            solution = inverse @ side
            left = self.wanted - self.rows @ solution
            determined = bends - stiffness * float(np.sum(inverse * stiff))
            count = max(float(self.weights.sum()) - determined, 1.0)
            noise = max(float(self.weights @ left**2) / count, _LEAST_PX**2)
            rough = max(float(solution @ stiff @ solution), 1e-12)
            stiffness = noise * max(determined, 1.0) / rough
        return np.asarray(solution.reshape(-1, 3)), stiffness
