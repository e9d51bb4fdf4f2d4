"""How sure a fitted curve is, at its samples and by its length."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Integers
from .equations import HELD, View, assemble
from .noise import rounding


def covariance(
    values: Floats,
    slopes: Floats,
    first: Integers,
    speed: Floats,
    outline_a: tuple[Floats, Floats],
    outline_b: tuple[Floats, Floats],
    view_a: View,
    view_b: View,
    together: int,
    noise: float,
    length: float,
    radius_known: bool,
) -> Floats:
    """Covariance at the samples of a curve, (n, 3, 3), mm², where no stiffness holds it.

    Parameters
    ----------
    values, slopes, first
        As of `SplineBasis`, of a spline with as many pieces as the device may have bends.
    speed : (n,) array
        As from `sweep`.
    outline_a, outline_b : tuple of arrays
        picture and normals, as in `Look`.
    view_a, view_b : tuple of arrays
        As of `step`; the totals do not matter.
    together : int
        As of `rounding`.
    noise : float
        Variance of a residual, px².
    length : float
        Of the curve, mm. No point is farther off than that.
    radius_known : bool
    """
    m = values.shape[1]
    matrix = np.zeros((3 * m + 1, 3 * m + 1))
    for (picture, normals), (pull, turn, grow, weight, _) in (
        (outline_a, view_a),
        (outline_b, view_b),
    ):
        # Where an edge runs aslant, one pixel of it is crossed by a row and by a column at once.
        crossings = np.abs(normals).sum(axis=1)
        shared = rounding(picture, normals, weight, len(values), together)
        telling = weight / crossings * noise / (noise + shared)
        matrix += assemble(values, slopes, speed, pull, turn, grow, telling, 0.0 * telling)[0]
    matrix[np.diag_indices_from(matrix)] += noise / length**2
    if radius_known:
        matrix[-1, -1] += HELD
    of_control = noise * np.linalg.inv(matrix)[:-1, :-1]
    half = (values @ of_control.reshape(m, -1)).reshape(len(values), 3, m, 3)
    found = np.einsum("nimj,nm->nij", half, values)
    return np.asarray((found + found.transpose(0, 2, 1)) / 2)


def by_length(
    curve: Floats,
    tangents: Floats,
    covariance: Floats,
    factors: Floats,
    along: Floats,
    start: float,
    stop: float,
    count: int,
) -> Floats:
    """Covariance at equal steps of length, where sliding along the curve is that of its ends.

    Parameters
    ----------
    curve, tangents, covariance : (n, 3), (n, 3) and (n, 3, 3) arrays
        At the samples of a curve; mm, unit vectors, mm².
    factors : (2,) array
        By which the variances at both ends grow.
    along : (2,) array
        Variance along the curve at both ends, mm²; NaN: that of the samples there.
    start, stop : float
        Of the stretch that is wanted, as shares of the curve's length.
    count : int

    Returns
    -------
    (count, 3, 3) array, mm²
    """
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    reach /= reach[-1]
    sliding = np.einsum("nij,nj->ni", covariance, tangents)
    slid = np.sum(sliding * tangents, axis=1)
    known = np.isfinite(along)
    ends = np.where(known, along, factors * slid[[0, -1]])
    # (1 − ttᵀ) C (1 − ttᵀ), and what stands along the tangent t instead.
    held = (1 - reach) * ends[0] + reach * ends[1]
    sliding -= 0.5 * (slid + held)[:, None] * tangents
    beside = sliding[:, :, None] * tangents[:, None, :]
    found = covariance - beside - beside.transpose(0, 2, 1)
    for end in (0, -1):
        if not known[end]:
            found[end] = factors[end] * covariance[end]
    at = np.linspace(start, stop, count)
    place = np.clip(np.searchsorted(reach, at) - 1, 0, len(reach) - 2)
    share = (at - reach[place]) / (reach[place + 1] - reach[place])
    share = np.clip(share, 0, 1)[:, None, None]
    return np.asarray((1 - share) * found[place] + share * found[place + 1])
