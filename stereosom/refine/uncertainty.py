"""How sure the fitted curve is: its covariance from what the edges tell, and how they tell it."""

from __future__ import annotations

from ..arrays import Floats
from .kernels import kernels
from .look import Look, Tube
from .reference import LEAST_NOISE
from .spline import spline_basis

# Bends that a device has: so many pieces of spline tell what the views leave open. More would
# call bends possible that are not, fewer would smooth over what is not seen.
_PIECES = 16
# An edge along a row of pixels is rounded to one side for longer than a piece; so many, at most.
_ROUNDED_PIECES = 3


def covariance_along(tube: Tube, looks: tuple[Look, Look], radius_known: bool) -> Floats:
    """Covariance at the samples of a tube's curve, (n, 3, 3), mm².

    It is that of a spline of not many pieces, without any stiffness: what the data do not
    determine must not look sure because the fit is smooth there.
    """
    n = len(tube.curve)
    basis = spline_basis(_PIECES, n)
    look_a, look_b = looks
    found: Floats = kernels().covariance(
        basis.values, basis.slopes, basis.first, tube.speed,
        (look_a.picture, look_a.normals), (look_b.picture, look_b.normals),
        look_a.equations, look_b.equations,
        max(_ROUNDED_PIECES * n // _PIECES, 1), noise_variance(looks), tube.length, radius_known,
    )  # fmt: skip
    return found


def noise_variance(looks: tuple[Look, Look]) -> float:
    """Variance that the residuals would have if each were on its own, px²."""
    return max((looks[0].noise_variance + looks[1].noise_variance) / 2, LEAST_NOISE)
