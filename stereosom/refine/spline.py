"""The uniform cubic B-spline that is fitted: its basis at even steps of the parameter."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline

from ..arrays import Floats, Integers
from ..backbone import Backbone

DEGREE = 3
# Samples of the curve a piece: fine enough that an outline between two of them is an arc.
_SAMPLES_A_PIECE = 6


class SplineBasis:
    """The basis of a clamped cubic spline of `segments` pieces, at even steps of its parameter.

    Parameters
    ----------
    segments : int
    samples : int, optional
        Number of steps and one. Default: six a piece.

    Attributes
    ----------
    knots : (m + 4,) array
    count, samples : int
        Of control points m, and of samples n.
    values, slopes : (n, m) arrays
        Basis and its derivative at even steps of the parameter from 0 to 1.
    first : (n,) array
        Of the basis only four in a row are not zero: where they begin.
    roughness : (m, m) array
        cᵀ roughness c is the sum of squared third differences of control points c.
    """

    def __init__(self, segments: int, samples: int = 0) -> None:
        inner = np.linspace(0, 1, segments + 1)
        self.knots: Floats = np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])
        self.count = segments + DEGREE
        self.samples = samples or segments * _SAMPLES_A_PIECE + 1
        at = np.linspace(0, 1, self.samples)
        self.values: Floats = self.at(at)
        self.slopes: Floats = BSpline(self.knots, np.eye(self.count), DEGREE)(at, nu=1)
        self.first: Integers = np.minimum((at * segments).astype(np.int64), segments - 1)
        third = np.diff(np.eye(self.count), 3, axis=0)
        self.roughness: Floats = third.T @ third
        self._from_samples: Floats = np.asarray(np.linalg.pinv(self.values), dtype=np.float64)
        for array in (self.knots, self.values, self.slopes, self.first):
            array.setflags(write=False)

    def at(self, parameter: Floats) -> Floats:
        """Values of the basis, (k, m), at parameters (k,)."""
        return np.asarray(BSpline(self.knots, np.eye(self.count), DEGREE)(parameter))

    def through(self, samples: Floats) -> Floats:
        """Control points (m, 3) of the spline nearest to the samples (n, 3)."""
        return np.asarray(self._from_samples @ samples)

    def control_points(self, polyline: Floats) -> Floats:
        """Control points (m, 3) that follow a polyline (k, 3) with even speed."""
        steps = np.sqrt(np.sum((polyline[1:] - polyline[:-1]) ** 2, axis=1))
        reach = np.concatenate([[0.0], np.cumsum(steps)])
        even = reach[-1] / (self.samples - 1) * np.arange(self.samples)
        return self.through(np.column_stack([np.interp(even, reach, axis) for axis in polyline.T]))

    def backbone(self, control: Floats) -> Backbone:
        """The curve of control points (m, 3)."""
        return Backbone(self.knots, control, DEGREE)


@lru_cache(maxsize=16)
def spline_basis(segments: int, samples: int = 0) -> SplineBasis:
    """The basis of so many pieces, made once."""
    return SplineBasis(segments, samples)
