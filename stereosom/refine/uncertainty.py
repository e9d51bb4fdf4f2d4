"""How sure the fitted curve is: its covariance from what the edges tell, and how they tell it."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from .kernels import kernels
from .look import Look, Tube
from .reference import pieces
from .spline import SplineBasis

# Bends that a device has: so many pieces of spline tell what the views leave open. More would
# call bends possible that are not, fewer would smooth over what is not seen.
_PIECES = 16
# Residuals of so many neighboring points of the outline are taken together, to see how much
# less they know than if each were on its own.
_IN_A_ROW = 4


def control_covariance(
    basis: SplineBasis, tube: Tube, looks: tuple[Look, Look], radius_known: bool
) -> Floats:
    """Covariance of the control points, (3m, 3m), mm², coordinates of each together.

    It is that of a spline of fewer pieces without any stiffness: what the data do not
    determine must not look sure because the fit is smooth there.
    """
    n = basis.count
    matrix = np.zeros((3 * n + 1, 3 * n + 1))
    noise = noise_variance(looks)
    for look in looks:
        # Where an edge runs aslant, one pixel of it is crossed by a row and by a column at once.
        crossings = np.abs(look.normals).sum(axis=1)
        shared = kernels().rounding(
            look.picture, look.normals, look.weight, look.samples, look.samples // _PIECES
        )
        weight = look.weight / crossings * noise / (noise + shared)
        added, _ = kernels().assemble(
            basis.values, basis.slopes, basis.first, tube.speed,
            look.pull, look.turn, look.grow, weight, 0.0 * weight,
        )  # fmt: skip
        matrix += added
    coarse = basis.from_coarser(_PIECES)
    lift = np.zeros((3 * n + 1, 3 * coarse.shape[1] + 1))
    for axis in range(3):
        lift[axis:-1:3, axis:-1:3] = coarse
    lift[-1, -1] = 1.0
    held = lift.T @ matrix @ lift
    # No point is farther off than the curve is long: what no view sees has no larger variance.
    length = float(np.linalg.norm(np.diff(tube.curve, axis=0), axis=1).sum())
    held += noise / length**2 * np.eye(len(held))
    if radius_known:
        held[-1, -1] += 1e12
    covariance = lift @ np.linalg.inv(held) @ lift.T
    covariance = noise * covariance[:-1, :-1]
    return np.asarray((covariance + covariance.T) / 2)


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
