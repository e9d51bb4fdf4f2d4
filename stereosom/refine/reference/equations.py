"""The normal equations of a spline's control points and a radius."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Integers
from .outline import owners


def assemble(
    values: Floats,
    slopes: Floats,
    first: Integers,
    speed: Floats,
    pull: Floats,
    turn: Floats,
    grow: Floats,
    weight: Floats,
    total: Floats,
) -> tuple[Floats, Floats]:
    """Normal equations for the shifts of the m control points and of the radius.

    Parameters
    ----------
    values, slopes, first
        As of `SplineBasis`.
    speed : (n,) array
        Length of the curve's derivative by its parameter at the samples, mm.
    pull, turn, grow
        As from `outline`.
    weight, total : (k,) arrays
        Sum of the weights of the edge points that belong to each point of the outline, and of
        their residuals times weight.

    Returns
    -------
    (3m + 1, 3m + 1) array, (3m + 1,) array
        Coordinates of each control point together; the radius last.
    """
    owner = owners(len(values))
    rows = values[owner][:, :, None] * pull[:, None, :]
    rows = rows + (slopes[owner] / speed[owner, None])[:, :, None] * turn[:, None, :]
    rows = np.column_stack([rows.reshape(len(owner), -1), grow])
    return rows.T @ (weight[:, None] * rows), rows.T @ total


def sliding(values: Floats, first: Integers, tangents: Floats) -> Floats:
    """Normal matrix (3m, 3m) of shifts of the samples along the curve.

    Parameters
    ----------
    values, first
        As of `SplineBasis`.
    tangents : (n, 3) array
    """
    rows = (values[:, :, None] * tangents[:, None, :]).reshape(len(tangents), -1)
    return np.asarray(rows.T @ rows)


def along(values: Floats, first: Integers, covariance: Floats) -> Floats:
    """Covariance (n, 3, 3) of the samples, from that of the control points, (3m, 3m).

    Parameters
    ----------
    values, first
        As of `SplineBasis`.
    covariance : (3m, 3m) array
    """
    n, m = values.shape
    half = (values @ covariance.reshape(m, -1)).reshape(n, 3, m, 3)
    found = np.einsum("nimj,nm->nij", half, values)
    return np.asarray((found + found.transpose(0, 2, 1)) / 2)
