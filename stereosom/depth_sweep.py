"""A first curve for eyes that stand close together: how deep the left eye's line lies.

Two eyes that look the same way see the same line, a little shifted. Where the device runs along
the epipolar lines, matching by them says nothing; so the depth along one line is taken for a
polynomial, which leaves no more freedom than the whole of both lines can settle. A device is as
thick as it is: where it looks narrower, it is farther away.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial import legendre
from scipy.spatial import cKDTree

from .arrays import Booleans, Floats
from .camera import StereoRig
from .polygons import in_polygon
from .reconstruction import HardFrame

# Depths that are tried, in baselines, and how many of the best are gone on with.
_NEAREST, _FARTHEST, _TRIED, _GONE_ON = 2.0, 200.0, 96, 3
# Degrees of the polynomial, one after the other, and steps of each.
_DEGREES, _STEPS = (0, 1, 2, 3, 4), 6
# Farther apart than this, as a share of the line's length, lines tell no more, px.
_FAR_SHARE, _FAR_PX = 0.05, 4.0
# Of how little a polynomial's higher terms are taken to matter, as a share of the inverse depth.
_BENDING = 0.15
# A width is known to this, px; where it is this many times the middle one, something lies beside
# the device or before it.
_WIDTH_PX, _SOUND = 0.25, (0.6, 1.6)
# Two ends count as much as this share of the line.
_END_SHARE = 0.05


def sweep_depth(
    rig: StereoRig,
    lines: tuple[Floats, Floats],
    fields: tuple[Floats, Floats],
    widths: Floats | None = None,
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
    widths : (n,) array, optional
        Of the device along its line in view a, px (`widths_along`).

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
    sweep = _Sweep(rig, lines, fields, widths)
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
        self,
        rig: StereoRig,
        lines: tuple[Floats, Floats],
        fields: tuple[Floats, Floats],
        widths: Floats | None,
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
        self.uneven = np.zeros((len(_DEGREES), len(_DEGREES)))
        if widths is not None:
            self.uneven = _uneven(_dense(np.column_stack([lines[0], widths]))[:, 2], length)

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
        apart = 0.0
        for end in (0, -1):
            if (other := self._other_end(end, seen[end])) is not None:
                apart += _END_SHARE * float(np.sum((other - seen[end]) ** 2))
        relative = coefficients / coefficients[0]
        held = relative @ self._held(len(coefficients)) @ relative / len(self.here)
        return float(forth.mean() + back.mean() + apart + held)

    def _held(self, count: int) -> Floats:
        """What is known beforehand of so many coefficients, relative to the first, (n, n), px²."""
        bending = np.full(count, _BENDING**-2)
        bending[0] = 0
        return np.diag(bending) + self.uneven[:count, :count]

    def refined(self, coefficients: Floats) -> Floats:
        """Gauss-Newton's method on the distances across the line, and between the ends."""
        count = len(coefficients)
        basis = legendre.legvander(self.place, count - 1)
        held = self._held(count) / coefficients[0] ** 2
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
            matrix = weighed.T @ (basis * rate[:, None]) + held
            matrix += 1e-9 * np.trace(matrix) * np.eye(count)
            coefficients = coefficients + np.linalg.solve(
                matrix, weighed.T @ gap - held @ coefficients
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


def widths_along(line: Floats, pixels: Floats) -> Floats:
    """How wide a device is in a picture along its middle line, px; not a number where untold.

    Parameters
    ----------
    line : (n, 2) array
        From end to end, px.
    pixels : (m, 2) array
        Of its filled mask.

    Examples
    --------
    >>> x, y = np.meshgrid(np.arange(60.0), np.arange(7.0))
    >>> line = np.array([[0.0, 3.0], [20.0, 3.0], [40.0, 3.0], [59.0, 3.0]])
    >>> widths_along(line, np.column_stack([x.ravel(), y.ravel()]))[1:3].round()
    array([7., 7.])
    """
    even = _dense(line)
    step = float(np.linalg.norm(np.diff(even, axis=0), axis=1).mean())
    held = np.bincount(cKDTree(even).query(pixels)[1], minlength=len(even)).astype(float)
    # Over a stretch about as long as the device is wide; what lies beyond the ends is theirs.
    reach = max(1, round(len(pixels) / len(even) / max(step, 1e-9) ** 2))
    over = np.ones(min(reach, len(even) // 4))
    summed, count = (np.convolve(each, over, mode="same") for each in (held, np.ones(len(held))))
    width = summed / np.maximum(count * step, 1e-9)
    middle, reach = float(np.median(width)), len(over)
    sound = (width > _SOUND[0] * middle) & (width < _SOUND[1] * middle)
    sound[:reach] = sound[len(sound) - reach :] = False
    width = np.where(sound, width, np.nan)
    return np.asarray(np.interp(_reach_of(line), _reach_of(even), width))


def _uneven(widths: Floats, length: float) -> Floats:
    """What a polynomial of inverse depth costs where it is not in proportion to the widths.

    With w of unit length, (I − w wᵀ) takes from the inverse depths what is in proportion, at
    whatever thickness; a matrix for the coefficients, of which the first is one, px².
    """
    known = np.isfinite(widths)
    if known.sum() < len(widths) // 4:
        return np.zeros((len(_DEGREES), len(_DEGREES)))
    basis = legendre.legvander(np.linspace(-1, 1, len(widths)), len(_DEGREES) - 1)[known]
    along = widths[known] / np.linalg.norm(widths[known])
    left = basis - np.outer(along, along @ basis)
    width = float(np.median(widths[known]))
    # Neighbors closer than a width share their pixels.
    independent = min(1.0, length / max(width, 1e-9) / len(widths))
    return np.asarray(left.T @ left * independent * (width / _WIDTH_PX) ** 2)


def _at_border(field: Floats, place: Floats) -> bool:
    """Whether a place lies within a twentieth of the way out of a view's field."""
    middle = field.mean(axis=0)
    return not bool(in_polygon(field, (middle + 1.1 * (place - middle))[None])[0])


def _dense(line: Floats, count: int = 200) -> Floats:
    """A line at even steps; a third column goes along."""
    reach = _reach_of(line[:, :2])
    even = np.linspace(0, reach[-1], count)
    return np.column_stack([np.interp(even, reach, axis) for axis in line.T])


def _reach_of(line: Floats) -> Floats:
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])
