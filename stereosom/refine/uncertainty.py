"""How sure the fitted curve is: its covariance from what the edges tell, and how they tell it."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from .kernels import kernels
from .look import Look, Tube
from .reference import pieces
from .spline import spline_basis

# Bends that a device has: so many pieces of spline tell what the views leave open. More would
# call bends possible that are not, fewer would smooth over what is not seen.
_PIECES = 16
# Residuals of so many neighboring points of the outline are taken together, to see how much
# less they know than if each were on its own.
_IN_A_ROW = 4


def covariance_along(tube: Tube, looks: tuple[Look, Look], radius_known: bool) -> Floats:
    """Covariance at the samples of a tube's curve, (n, 3, 3), mm².

    It is that of a spline of not many pieces, without any stiffness: what the data do not
    determine must not look sure because the fit is smooth there.
    """
    n = len(tube.curve)
    basis = spline_basis(_PIECES, n)
    matrix = np.zeros((3 * basis.count + 1, 3 * basis.count + 1))
    noise = noise_variance(looks)
    for look in looks:
        # Where an edge runs aslant, one pixel of it is crossed by a row and by a column at once.
        crossings = np.abs(look.normals).sum(axis=1)
        shared = kernels().rounding(
            look.picture, look.normals, look.weight, n, max(n // _PIECES, 1)
        )
        weight = look.weight / crossings * noise / (noise + shared)
        matrix += kernels().assemble(
            basis.values, basis.slopes, basis.first, tube.speed,
            look.pull, look.turn, look.grow, weight, 0.0 * weight,
        )[0]  # fmt: skip
    # No point is farther off than the curve is long: what no view sees has no larger variance.
    matrix[np.diag_indices_from(matrix)] += noise / tube.length**2
    if radius_known:
        matrix[-1, -1] += 1e12
    covariance = noise * np.linalg.inv(matrix)[:-1, :-1]
    return np.asarray(kernels().along(basis.values, basis.first, covariance))


def noise_variance(looks: tuple[Look, Look]) -> float:
    """Variance that the residuals would have if each were on its own, px²."""
    return max(float(np.mean([look.noise * _likeness(look) for look in looks])), 1e-6)


def _likeness(look: Look) -> float:
    """How much more the mean of near residuals varies than if they were independent."""
    sums, single, weights = 0.0, 0.0, 0.0
    for piece in pieces(look.samples)[:2]:
        weight, total = look.weight[piece], look.total[piece]
        rows = len(weight) // _IN_A_ROW
        weight = weight[: rows * _IN_A_ROW].reshape(rows, -1).sum(axis=1)
        total = total[: rows * _IN_A_ROW].reshape(rows, -1).sum(axis=1)
        seen = weight > 0
        sums += float(np.sum(total[seen] ** 2 / weight[seen]))
        single += float(seen.sum())
        weights += float(look.weight[piece].sum())
    variance = float(look.squares.sum()) / max(float(look.weight.sum()), 1e-9)
    if single < 4:
        return 1.0
    return max(1.0, sums / single / max(variance, 1e-12))
