"""The uniform cubic B-spline that is fitted: its basis at even steps of the parameter."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import gaussian_filter1d

from ..arrays import Floats, Integers
from ..backbone import Backbone
from .kernels import kernels

DEGREE = 3
# Samples of the curve a piece: fine enough that an outline between two of them is an arc.
SAMPLES_A_PIECE = 6
# How rough a curve is, is told by differences of this order of its control points.
ORDER = 2
# Bends are alike over such a share of a curve (standard deviation); no stretch is taken to be
# straighter than such a share of the mean.
_STRETCH, _STRAIGHTEST = 0.05, 0.12


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
        cᵀ roughness c is the sum of squared second differences of control points c.
    """

    def __init__(self, segments: int, samples: int = 0) -> None:
        inner = np.linspace(0, 1, segments + 1)
        self.knots: Floats = np.concatenate([np.zeros(DEGREE), inner, np.ones(DEGREE)])
        self.count = segments + DEGREE
        self.samples = samples or segments * SAMPLES_A_PIECE + 1
        at = np.linspace(0, 1, self.samples)
        self.values: Floats = self.at(at)
        self.slopes: Floats = BSpline(self.knots, np.eye(self.count), DEGREE)(at, nu=1)
        self.first: Integers = np.minimum((at * segments).astype(np.int64), segments - 1)
        differences = np.diff(np.eye(self.count), ORDER, axis=0)
        self.roughness: Floats = differences.T @ differences
        self._around: Floats = gaussian_filter1d(
            np.eye(self.count - ORDER), _STRETCH * self.count, axis=0, mode="nearest"
        )
        self._from_samples: Floats = np.asarray(np.linalg.pinv(self.values), dtype=np.float64)
        for array in (self.knots, self.values, self.slopes, self.first):
            array.setflags(write=False)

    def at(self, parameter: Floats) -> Floats:
        """Values of the basis, (k, m), at parameters (k,)."""
        return np.asarray(BSpline(self.knots, np.eye(self.count), DEGREE)(parameter))

    def through(self, samples: Floats) -> Floats:
        """Control points (m, 3) of the spline nearest to the samples (n, 3)."""
        return np.asarray(self._from_samples @ samples)

    def control_points(self, polyline: Floats, reach: Floats | None = None) -> Floats:
        """Control points (m, 3) that follow a polyline (k, 3) with even speed.

        Parameters
        ----------
        polyline : (k, 3) array
        reach : (k,) array, optional
            What the speed is measured by: growing along the polyline. Default: its length.
        """
        if reach is None:
            reach = kernels().reach_along(polyline)
        return self.through(kernels().evenly(polyline, reach, self.samples))

    def roughness_like(self, control: Floats) -> Floats:
        """A measure (m, m) like `roughness` that allows bends where a curve has them already.

        Each difference counts as the inverse of what it is on the mean over a stretch around.
        Depth is not seen as well as the picture is: there, too, a device is straight where its
        picture is straight, and bends where that bends.

        Parameters
        ----------
        control : (m, 3) array
            Of a curve near to the one that is sought.
        """
        rough: Floats = kernels().roughness_like(control, self._around, _STRAIGHTEST)
        return rough

    def backbone(self, control: Floats) -> Backbone:
        """The curve of control points (m, 3)."""
        return Backbone(self.knots, control, DEGREE)


@lru_cache(maxsize=16)
def spline_basis(segments: int, samples: int = 0) -> SplineBasis:
    """The basis of so many pieces, made once."""
    return SplineBasis(segments, samples)
