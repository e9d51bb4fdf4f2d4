"""`Backbone`: a curve in space by arc length, and the fits that make one of points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline, make_lsq_spline

from .arc_length import ArcLength
from .arrays import Floats, check_array
from .refine.kernels import kernels
from .vectors import cross, dot, perpendicular, reflected

# Steps of the method that carries frames along, over the whole length, about: two between each
# pair of the 200 points that files hold.
_FRAME_STEPS = 398


@dataclass(frozen=True, eq=False)
class Backbone:
    """A smooth curve in space, called by arc length from base (0) to tip (`length`).

    It holds a B-spline of any parameter; arc length, curvature and torsion are computed
    from it, so every fit (polynomial, spline, interpolation) is the same type.

    Parameters
    ----------
    knots : (m + degree + 1,) array
        Knots of the spline, not decreasing.
    coefficients : (m, 3) array
        Control points, mm.
    degree : int

    Raises
    ------
    ValueError
        Where the arrays do not belong together, are not finite, or the curve has no length.

    Examples
    --------
    >>> line = Backbone.through([[0, 0, 0], [3, 4, 0]])
    >>> round(line.length, 9), line(2.5).round(9)
    (5.0, array([1.5, 2. , 0. ]))
    """

    knots: Floats
    coefficients: Floats
    degree: int

    def __post_init__(self) -> None:
        coefficients = check_array(self.coefficients, "coefficients", (None, 3))
        if self.degree < 1 or len(coefficients) <= self.degree:
            raise ValueError(
                f"backbone: {len(coefficients)} control points cannot carry degree {self.degree}"
            )
        knots = self.knots
        if not isinstance(knots, np.ndarray) or knots.dtype != np.float64 or knots.ndim != 1:
            knots = check_array(knots, "knots", (None,))
        knots = _checked_knots(knots.tobytes(), len(coefficients), self.degree)
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "knots", knots)
        # Of nearly all curves the two ends tell at once that it has one.
        first, last = coefficients[0].tolist(), coefficients[-1].tolist()
        if first == last and (coefficients == coefficients[0]).all():
            raise ValueError("backbone: the curve has no length")

    # ---- ways to make one ------------------------------------------------------------

    @classmethod
    def through(cls, points: Any) -> Backbone:
        """Interpolate (n, 3) points, base to tip, by a cubic spline over chord length.

        Points that repeat their predecessor are passed over.

        Raises
        ------
        ValueError
            Where fewer than two different points are given.
        """
        points = check_array(points, "points", (None, 3))
        points, chord = _by_chord_length(points)
        spline = make_interp_spline(chord, points, k=min(3, len(points) - 1))
        return cls(spline.t, spline.c, int(spline.k))

    @classmethod
    def fit_polynomial(cls, points: Any, degree: int = 6) -> Backbone:
        """Least-squares polynomial over chord length (the paper's parametric curve).

        Parameters
        ----------
        points : (n, 3) array
            Ordered from base to tip, mm.
        degree : int
            Lowered where there are too few points for it.
        """
        return cls.fit_spline(points, segments=1, degree=degree)

    @classmethod
    def fit_spline(cls, points: Any, segments: int, degree: int = 3) -> Backbone:
        """Least-squares B-spline over chord length with equal knot spans.

        Parameters
        ----------
        points : (n, 3) array
            Ordered from base to tip, mm.
        segments : int
            Polynomial pieces; lowered where there are too few points for them.
        degree : int
            Of each piece; lowered where there are too few points for it.
        """
        if segments < 1 or degree < 1:
            raise ValueError("fit: segments and degree must be at least 1")
        points = check_array(points, "points", (None, 3))
        points, chord = _by_chord_length(points)
        degree = min(degree, len(points) - 1)
        segments = max(1, min(segments, len(points) - degree))
        # Inner knots at quantiles of the data keep points in every span.
        inner = np.quantile(chord, np.linspace(0, 1, segments + 1)[1:-1])
        knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
        spline = make_lsq_spline(chord, points, knots, k=degree)
        return cls(spline.t, spline.c, degree)

    def reversed(self) -> Backbone:
        """The same curve from tip to base."""
        return Backbone(-self.knots[::-1], self.coefficients[::-1], self.degree)

    def between(self, start: float, stop: float) -> Backbone:
        """The stretch from arc length `start` to `stop`, mm: the same spline, cut there."""
        spline, cuts, degree = self._spline, self._arc_length.parameter([start, stop]), self.degree
        for cut in cuts:
            missing = degree - np.count_nonzero(spline.t == cut)
            spline = spline.insert_knot(cut, missing) if missing > 0 else spline
        first = np.searchsorted(spline.t, cuts[0], side="right") - degree
        last = np.searchsorted(spline.t, cuts[1])
        knots = np.concatenate([cuts[:1], spline.t[first : last + degree], cuts[1:]])
        return Backbone(knots, spline.c[first - 1 : last], degree)

    def transformed(self, rotation: Any, translation: Any) -> Backbone:
        """The curve after x → R x + t; `rotation` (3, 3), `translation` (3,) in mm."""
        turned = self.coefficients @ np.asarray(rotation, dtype=float).T
        return Backbone(self.knots, turned + np.asarray(translation, dtype=float), self.degree)

    # ---- arc length ------------------------------------------------------------------

    @property
    def length(self) -> float:
        """Arc length from base to tip, mm."""
        return self._arc_length.total

    def arc_lengths(self, count: int) -> Floats:
        """`count` equally spaced arc lengths from 0 to `length`, mm."""
        return np.linspace(0.0, self.length, count)

    def __call__(self, s: Any) -> Floats:
        """Points at arc lengths `s` (mm): (n, 3), or (3,) for one number.

        Raises
        ------
        ValueError
            Where `s` lies outside the curve.
        """
        return np.asarray(self._spline(self._arc_length.parameter(s)))

    def sample(self, count: int) -> Floats:
        """`count` points at equal steps of arc length, (count, 3), mm."""
        return self(self.arc_lengths(count))

    def polyline(self, count: int) -> Floats:
        """`count` points from base to tip, (count, 3), mm, at steps that are equal but for 1 %.

        Much faster than `sample`, which is exact.
        """
        first, last = self.knots[self.degree], self.knots[-self.degree - 1]
        points = np.asarray(self._spline(np.linspace(first, last, 2 * count + 1)))
        found: Floats = kernels().evenly(points, kernels().reach_along(points), count)
        return found

    @property
    def base(self) -> Floats:
        """The proximal end, (3,), mm."""
        if self.knots[0] == self.knots[self.degree]:  # there a spline is its first coefficient
            return np.asarray(self.coefficients[0])
        return np.asarray(self._spline(self.knots[self.degree]))

    @property
    def tip(self) -> Floats:
        """The distal end, (3,), mm."""
        if self.knots[-1] == self.knots[-self.degree - 1]:
            return np.asarray(self.coefficients[-1])
        return np.asarray(self._spline(self.knots[-self.degree - 1]))

    # ---- differential geometry -------------------------------------------------------

    def tangent(self, s: Any) -> Floats:
        """Unit tangents towards the tip, (n, 3) or (3,)."""
        velocity = self._derivative(s, 1)
        return np.asarray(velocity / np.sqrt(dot(velocity, velocity))[..., None])

    def curvature(self, s: Any) -> Floats:
        """Curvature, 1/mm: |r′ × r″| / |r′|³."""
        first, second = self._derivative(s, 1), self._derivative(s, 2)
        bend = cross(first, second)
        return np.asarray(np.sqrt(dot(bend, bend)) / dot(first, first) ** 1.5)

    def torsion(self, s: Any) -> Floats:
        """Torsion, 1/mm: r′·(r″ × r‴) / |r′ × r″|²; zero where the curve is straight."""
        first, second, third = (self._derivative(s, order) for order in (1, 2, 3))
        binormal = cross(first, second)
        strength, twist = dot(binormal, binormal), dot(binormal, third)
        # Below a radius of a kilometre the curve is straight, and its torsion undefined.
        bent = strength > 1e-12 * dot(first, first) ** 3
        return np.asarray(np.where(bent, twist / np.where(bent, strength, 1.0), 0.0))

    def frames(self, s: Any) -> Floats:
        """Rotation-minimizing (parallel transport) frames, (n, 3, 3).

        Rows are the tangent and two normals; the first normal at the base is arbitrary, and
        the others turn no more than the curve does. Double reflection method: W. Wang,
        B. Jüttler, D. Zheng, Y. Liu, ACM Transactions on Graphics 27(1), 2008.

        Parameters
        ----------
        s : (n,) array
            Arc lengths, mm, not decreasing.
        """
        s = np.atleast_1d(np.asarray(s, dtype=float))
        # The method's error falls with the fourth power of the step: take fine ones, in whole
        # numbers from the base to the first place, and from each to the next.
        pieces = np.diff(s, prepend=0.0) / (self.length / _FRAME_STEPS)
        pieces = np.ceil(pieces - 1e-6).astype(int)
        within = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        # Between places they are even in the spline's parameter: that need not be looked for.
        place = self._arc_length.parameter(s)
        before = np.append(self.knots[self.degree], place[:-1])
        steps = np.repeat((place - before) / np.maximum(pieces, 1), pieces)
        fine = np.append(np.repeat(before, pieces) + within * steps, place[-1])
        points, tangents = self._spline(fine), self._spline(fine, nu=1)
        tangents /= np.sqrt(dot(tangents, tangents))[:, None]
        # At each place two normals of its own. Each move turns those of one place against those
        # of the next, and the turns add up: at the base the first of them is taken.
        own = perpendicular(tangents)
        once = reflected(np.stack([tangents[:-1], own[:-1]]), np.diff(points, axis=0))
        moved = reflected(once[1], tangents[1:] - once[0])
        other = cross(tangents, own)
        turns = np.arctan2(dot(moved, other[1:]), dot(moved, own[1:]))
        turned = np.append(0.0, np.cumsum(turns))[:, None]
        normals = np.cos(turned) * own + np.sin(turned) * other
        at = np.cumsum(pieces)
        tangents, normals = tangents[at], normals[at]
        return np.stack([tangents, normals, cross(tangents, normals)], axis=1)

    # ---- the spline ------------------------------------------------------------------

    @cached_property
    def _spline(self) -> BSpline[np.float64]:
        # What BSpline would check was checked when this was made.
        return BSpline.construct_fast(self.knots, self.coefficients, self.degree, extrapolate=False)

    @cached_property
    def _arc_length(self) -> ArcLength:
        return ArcLength(self._spline)

    def _derivative(self, s: Any, order: int) -> Floats:
        parameter = self._arc_length.parameter(s)
        if order > self.degree:
            return np.zeros((*parameter.shape, 3))
        return np.asarray(self._spline(parameter, nu=order))


@lru_cache(maxsize=64)
def _checked_knots(knots: bytes, count: int, degree: int) -> Floats:
    """Knots that may be a spline's: a run's curves share them, and they are looked at once."""
    checked = check_array(np.frombuffer(knots), "knots", (count + degree + 1,))
    if np.any(checked[1:] < checked[:-1]) or checked[degree] >= checked[-degree - 1]:
        raise ValueError("backbone: the knots must not decrease and must span something")
    return checked


def _by_chord_length(points: Floats) -> tuple[Floats, Floats]:
    """Points without repeats, and the parameter from 0 to 1 that grows with their distance."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    fresh = np.concatenate([[True], steps > 1e-12 * max(float(steps.sum()), 1e-300)])
    points = points[fresh]
    if len(points) < 2:
        raise ValueError("points: a curve needs at least two different points")
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return points, chord / chord[-1]
