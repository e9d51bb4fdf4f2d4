"""A first curve for eyes that stand close together: how deep the left eye's line lies.

Two eyes that look the same way see the same line, a little shifted. Where the device runs along
the epipolar lines, matching by them says nothing; so the depth along one line is taken for a
polynomial, which leaves no more freedom than the whole of both lines can settle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.spatial import cKDTree

from .arrays import Booleans, Floats
from .camera import StereoRig
from .entering import in_polygon
from .reconstruction import HardFrame

# Depths that are tried, in baselines, and how many of the best are gone on with.
_NEAREST, _FARTHEST, _TRIED, _GONE_ON = 2.0, 200.0, 96, 3
# Degrees of the polynomial, one after the other, and steps of each.
_DEGREES, _STEPS = (0, 1, 2, 3, 4), 6
# Farther apart than this, as a share of the line's length, lines tell no more, px.
_FAR_SHARE, _FAR_PX = 0.05, 4.0
# Of how little a polynomial's higher terms are taken to matter, as a share of the inverse depth.
_BENDING = 0.15
# Two ends count as much as this share of the line.
_END_SHARE = 0.05


def sweep_depth(
    rig: StereoRig,
    lines: tuple[Floats, Floats],
    fields: tuple[Floats, Floats],
) -> Floats:
    """Points in space along the line that view a sees.

    Parameters
    ----------
    rig : StereoRig
    lines : pair of (n, 2) arrays
        The device's middle line in each view, px; either may run either way.
    fields : pair of (m, 2) arrays
        Corners of the convex region that each view sees. What lies beyond the other's is not
        expected there.

    Returns
    -------
    (n, 3) array, mm

    Raises
    ------
    HardFrame
        Where no depth makes the lines meet.

    Notes
    -----
    R. T. Collins, "A space-sweep approach to true multi-image matching", CVPR 1996; here the
    planes bend.
    """
    sweep = _Sweep(rig, lines, fields)
    baseline = rig.baseline
    inverse = np.linspace(1 / (_FARTHEST * baseline), 1 / (_NEAREST * baseline), _TRIED)
    costs = [sweep.cost(np.array([depth])) for depth in inverse]
    best, least = np.empty(0), np.inf
    for k in np.argsort(costs)[:_GONE_ON]:
        found = np.array([inverse[k]])
        for degree in _DEGREES:
            found = sweep.refined(np.append(found, np.zeros(degree + 1 - len(found))))
        if (cost := sweep.cost(found)) < least:
            best, least = found, cost
    if not np.isfinite(least):
        raise HardFrame("the two views do not show the same device: their lines do not match")
    return sweep.points(best)


class _Sweep:
    def __init__(
        self, rig: StereoRig, lines: tuple[Floats, Floats], fields: tuple[Floats, Floats]
    ) -> None:
        self.rig, self.fields = rig, fields
        self.here, self.there = (_dense(line) for line in lines)
        self.tree = cKDTree(self.there)
        tangent = np.gradient(self.there, axis=0)
        tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-9)
        self.normals = np.column_stack([-tangent[:, 1], tangent[:, 0]])
        rays = rig.a.rays(self.here)
        self.rays = rays / (rays @ rig.a.axis)[:, None]
        self.place = np.linspace(-1, 1, len(self.here))
        length = np.linalg.norm(np.diff(self.here, axis=0), axis=1).sum()
        self.far = max(_FAR_SHARE * length, _FAR_PX)

    def points(self, coefficients: Floats) -> Floats:
        """In space, for a polynomial of inverse depth, 1/mm."""
        inverse = legendre.legval(self.place, coefficients)
        most = 1 / (0.5 * _NEAREST * self.rig.baseline)
        inverse = np.clip(inverse, most / 1e4, most)
        return np.asarray(self.rig.a.center + self.rays / inverse[:, None])

    def cost(self, coefficients: Floats) -> float:
        """Mean squared distance between the line in view b and what is expected there, px²."""
        points = self.points(coefficients)
        if self.rig.b.depth(points).min() <= 0:
            return float(np.inf)
        seen = self.rig.b.project(points)
        inside = in_polygon(self.fields[1], seen)
        if inside.sum() < 8:
            return float(np.inf)
        forth = np.minimum(self.tree.query(seen[inside])[0], self.far) ** 2
        back, nearest = cKDTree(seen).query(self.there)
        # What view b alone sees, beyond an end that view a's border makes, is no fault.
        ends = np.isin(nearest, [0, len(seen) - 1]) & self._cut_off(nearest)
        back = np.where(ends, 0.0, np.minimum(back, self.far)) ** 2
        return float(forth.mean() + back.mean())

    def refined(self, coefficients: Floats) -> Floats:
        """Gauss-Newton's method on the distances across the line, and between the ends."""
        count = len(coefficients)
        basis = legendre.legvander(self.place, count - 1)
        held = np.zeros(count)
        held[1:] = 1 / (_BENDING * abs(coefficients[0])) ** 2
        best, least = coefficients, self.cost(coefficients)
        for _ in range(_STEPS):
            points = self.points(coefficients)
            seen = self.rig.b.project(points)
            distance, nearest = self.tree.query(seen)
            # How the picture moves with the inverse depth.
            slope = (
                -(points - self.rig.a.center)
                * ((points - self.rig.a.center) @ self.rig.a.axis)[:, None]
            )
            moves = np.einsum("nij,nj->ni", self.rig.b.jacobian(points), slope)
            normal = self.normals[nearest]
            weight = (in_polygon(self.fields[1], seen) & (distance < self.far)).astype(float)
            gap = np.einsum("ni,ni->n", normal, self.there[nearest] - seen)
            rate = np.einsum("ni,ni->n", normal, moves)
            for end in (0, -1):  # an end is a place along the line, too
                other = self._other_end(end, seen[end])
                if other is not None:
                    along = moves[end] / max(float(np.linalg.norm(moves[end])), 1e-12)
                    gap[end], rate[end] = along @ (other - seen[end]), along @ moves[end]
                    weight[end] = _END_SHARE * len(seen)
            weighed = basis * (weight * rate)[:, None]
            matrix = weighed.T @ (basis * rate[:, None]) + np.diag(held)
            matrix += 1e-9 * np.trace(matrix) * np.eye(count)
            coefficients = coefficients + np.linalg.solve(
                matrix, weighed.T @ gap - held * coefficients
            )
            if (cost := self.cost(coefficients)) < least:
                best, least = coefficients, cost
        return best

    def _other_end(self, end: int, seen: Floats) -> Floats | None:
        """The end of view b's line that is near to one of view a's, where both are ends."""
        ends = self.there[[0, -1]]
        nearest = ends[int(np.argmin(np.linalg.norm(ends - seen, axis=1)))]
        if np.linalg.norm(nearest - seen) > 2 * self.far:
            return None
        if _at_border(self.fields[0], self.here[end]) or _at_border(self.fields[1], nearest):
            return None
        return np.asarray(nearest)

    def _cut_off(self, nearest: Any) -> Booleans:
        """Whether the end of view a's line, its first or another, is one that its border makes."""
        first, last = (_at_border(self.fields[0], self.here[end]) for end in (0, -1))
        return np.asarray(np.where(nearest == 0, first, last))


def _at_border(field: Floats, place: Floats) -> bool:
    """Whether a place lies within a twentieth of the way out of a view's field."""
    middle = field.mean(axis=0)
    return not bool(in_polygon(field, (middle + 1.1 * (place - middle))[None])[0])


def _dense(line: Floats, count: int = 200) -> Floats:
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    even = np.linspace(0, reach[-1], count)
    return np.column_stack([np.interp(even, reach, axis) for axis in line.T])
