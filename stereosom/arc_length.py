"""`ArcLength`: where along a spline's parameter a given arc length is reached."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from .arrays import Floats

# Nodes and weights on [-1, 1]; five points integrate the speed of a short span to 1e-12.
_GAUSS_NODES, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(5)
_SPANS_AT_LEAST = 128
# So many sets of arc lengths are remembered: place, tangent and curvature are asked for one by one.
_REMEMBERED = 4


class ArcLength:
    """Arc length along a spline, by a fine table and Gauss's quadrature between its nodes.

    Parameters
    ----------
    spline : BSpline
        Of points (3,), mm.

    Examples
    --------
    A straight way of 5 mm at even speed is half gone at half of the parameter:

    >>> way = BSpline(np.array([0.0, 0, 1, 1]), np.array([[0.0, 0, 0], [3, 4, 0]]), 1)
    >>> ArcLength(way).parameter([2.5]).round(9)
    array([0.5])
    """

    def __init__(self, spline: BSpline[np.float64]) -> None:
        self._spline = spline
        knots, degree = spline.t, spline.k
        start, stop = knots[degree], knots[-degree - 1]
        spans = np.unique(knots[(knots >= start) & (knots <= stop)])
        pieces = -(-_SPANS_AT_LEAST // (len(spans) - 1)) + 1
        inner = np.linspace(spans[:-1], spans[1:], pieces, endpoint=False).T.ravel()
        # The table: parameters, the arc length at each, mm, and their slope over it.
        self._nodes: Floats = np.append(inner, spans[-1])
        steps = self._between(self._nodes[:-1], self._nodes[1:])
        self._reached: Floats = np.concatenate([[0.0], np.cumsum(steps)])
        self._slope: Floats = 1 / np.maximum(self._speed(self._nodes), 1e-300)
        self._asked: list[tuple[Floats, Floats]] = []

    @property
    def total(self) -> float:
        """Of the whole spline, mm."""
        return float(self._reached[-1])

    def parameter(self, s: Any) -> Floats:
        """Spline parameters at arc lengths `s`, mm, of the same shape, by Newton steps.

        Raises
        ------
        ValueError
            Where `s` lies outside the curve.
        """
        s = np.asarray(s, dtype=float)
        slack = 1e-9 * self.total
        if np.any((s < -slack) | (s > self.total + slack)) or not np.isfinite(s).all():
            raise ValueError(f"arc length: must lie between 0 and {self.total:g} mm")
        asked = self._asked
        for lengths, known in asked:
            if np.array_equal(lengths, s):
                return known
        nodes, reached, slope = self._nodes, self._reached, self._slope
        wanted = np.clip(np.atleast_1d(s), 0.0, self.total)
        span = np.clip(np.searchsorted(reached, wanted, side="right") - 1, 0, len(nodes) - 2)
        # Begun by Hermite's cubic through the table; where the curve is smooth, a step or two do.
        step = reached[span + 1] - reached[span]
        share = (wanted - reached[span]) / np.maximum(step, 1e-300)
        parameter = (1 - share) ** 2 * (
            (1 + 2 * share) * nodes[span] + share * step * slope[span]
        ) + share**2 * ((3 - 2 * share) * nodes[span + 1] - (1 - share) * step * slope[span + 1])
        parameter = np.clip(parameter, nodes[span], nodes[span + 1])
        for _ in range(4):
            missing = wanted - reached[span] - self._between(nodes[span], parameter)
            # A speed near zero (a cusp) must not throw the step out of its span.
            speed = np.maximum(self._speed(parameter), 1e-9 * self.total)
            parameter = np.clip(parameter + missing / speed, nodes[span], nodes[span + 1])
            # The next step would be about the square of this one, as shares of the whole.
            if np.abs(missing).max(initial=0.0) < 2e-7 * self.total:
                break
        parameter = np.asarray(parameter.reshape(s.shape))
        # A list of its own, so that another thread may look through the one before.
        self._asked = [(s.copy(), parameter), *asked[: _REMEMBERED - 1]]
        return parameter

    def _speed(self, parameter: Floats) -> Floats:
        velocity = self._spline(parameter, nu=1)
        return np.asarray(np.sqrt(np.einsum("...i,...i", velocity, velocity)))

    def _between(self, start: Floats, stop: Floats) -> Floats:
        """Arc lengths from parameters (n,) to others (n,), mm."""
        half, middle = (stop - start) / 2, (stop + start) / 2
        nodes = middle[:, None] + half[:, None] * _GAUSS_NODES
        return np.asarray(half * (self._speed(nodes.ravel()).reshape(nodes.shape) @ _GAUSS_WEIGHTS))
