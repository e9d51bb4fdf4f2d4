"""The normal equations of a spline's control points and a radius, and the step they give."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats, Integers
from ..spline import ORDER
from .outline import owners

# A step may slide along the curve only this weakly; a share of how strongly it is held across.
SLIDING = 0.01
# Holds what nothing else does, so that there is one solution.
FLOOR = 1e-9
# Of a radius that is known: nothing moves it.
HELD = 1e12

# The parts of a view that the equations are made of: pull, turn, grow, weight, total.
View = tuple[Floats, Floats, Floats, Floats, Floats]


def sweep(
    values: Floats, slopes: Floats, first: Integers, control: Floats
) -> tuple[Floats, Floats, Floats]:
    """Points, speed and unit tangents along a spline.

    Parameters
    ----------
    values, slopes, first
        As of `SplineBasis`.
    control : (m, 3) array
        mm.

    Returns
    -------
    curve : (n, 3) array
        mm.
    speed : (n,) array
        Length of the derivative by the parameter, mm.
    tangents : (n, 3) array
    """
    velocity = slopes @ control
    speed = np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)
    return values @ control, speed, velocity / speed[:, None]


def roughness_like(control: Floats, around: Floats, straightest: float) -> Floats:
    """As of `SplineBasis.roughness_like`.

    Parameters
    ----------
    control : (m, 3) array
    around : (m - 2, m - 2) array
        Takes the mean over a stretch around each second difference.
    straightest : float
        No stretch is taken to be straighter than so much of the mean.

    Returns
    -------
    (m, m) array
    """
    differences = np.diff(np.eye(len(control)), 2, axis=0)
    squares = np.sum((differences @ control) ** 2, axis=1)
    mean = float(squares.mean())
    if not mean > 0:
        return np.asarray(differences.T @ differences)
    allowed = np.maximum(around @ squares / mean, straightest)
    return np.asarray(differences.T @ (differences / allowed[:, None]))


def assemble(
    values: Floats,
    slopes: Floats,
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
    values, slopes
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
    rows = moving(values, slopes, speed, pull, turn, grow)
    return rows.T @ (weight[:, None] * rows), rows.T @ total


def moving(
    values: Floats, slopes: Floats, speed: Floats, pull: Floats, turn: Floats, grow: Floats
) -> Floats:
    """How far each of k outline points moves across the outline, (k, 3m + 1), px.

    By each coordinate of the control points, and by the radius; parameters as of `assemble`.
    """
    owner = owners(len(values))
    rows = values[owner][:, :, None] * pull[:, None, :]
    rows = rows + (slopes[owner] / speed[owner, None])[:, :, None] * turn[:, None, :]
    return np.column_stack([rows.reshape(len(owner), -1), grow])


def step(
    values: Floats,
    slopes: Floats,
    first: Integers,
    roughness: Floats,
    control: Floats,
    speed: Floats,
    tangents: Floats,
    view_a: View,
    view_b: View,
    turning: bool,
    stiffness: float,
    noise: float,
    radius_known: bool,
) -> tuple[Floats, float, float, float]:
    """One step of Gauss-Newton, held by the spline's stiffness.

    The stiffness follows from how rough the curve is against how noisy its picture (D. J. C.
    MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992): the roughness is shared
    among as many directions as it, and not the data, determines.

    Parameters
    ----------
    values, slopes, first, roughness
        As of `SplineBasis`.
    control : (m, 3) array
        mm.
    speed, tangents
        As from `sweep`.
    view_a, view_b : tuple of arrays
        pull, turn, grow, weight and total, as in `Look`.
    turning : bool
        Whether flat ends turn with the curve. Seen nearly edge-on, a disc tilted to either side
        looks the same: until the curve is near, its rims alone say how it runs.
    stiffness : float
        px²/mm².
    noise : float
        Variance of a residual, px²: the stiffness is chosen anew with it; zero: it stays.
    radius_known : bool
        Whether the radius stays as it is.

    Returns
    -------
    moved : (m, 3) array
        Shift of the control points, mm.
    grown : float
        Of the radius, mm.
    farthest : float
        Largest shift of the curve across itself, mm; along it, a fifth of its ends'.
    stiffness : float
    """
    m = len(control)
    matrix, side = np.zeros((3 * m + 1, 3 * m + 1)), np.zeros(3 * m + 1)
    for pull, turn, *rest in (view_a, view_b):
        more, sided = assemble(values, slopes, speed, pull, turn if turning else 0 * turn, *rest)
        matrix, side = matrix + more, side + sided
    rough = float(np.sum(control * (roughness @ control)))
    if noise > 0:
        inverse = np.linalg.inv(_held(matrix, roughness, stiffness))[:-1, :-1]
        blocks = sum(inverse[axis::3, axis::3] for axis in range(3))
        undetermined = stiffness * float(np.sum(blocks * roughness))
        directions = max(3.0 * (m - ORDER) - undetermined, 1.0)
        stiffness = float(np.clip(noise * directions / max(rough, 1e-12), 1e-9, 1e6))
    held = _held(matrix, roughness, stiffness)
    side[:-1] -= stiffness * (roughness @ control).ravel()
    rows = (values[:, :, None] * tangents[:, None, :]).reshape(len(tangents), -1)
    sliding = rows.T @ rows
    held[:-1, :-1] += SLIDING * np.trace(matrix[:-1, :-1]) / np.trace(sliding) * sliding
    if radius_known:
        held[-1, -1] += HELD
    solution = np.linalg.solve(held, side)
    moved: Floats = np.asarray(solution[:-1].reshape(-1, 3))
    shift = values @ moved
    along = np.sum(shift * tangents, axis=1)
    along[[0, -1]] *= 0.8
    across = shift - along[:, None] * tangents
    farthest = float(np.sqrt(np.max(np.sum(across**2, axis=1))))
    return moved, float(solution[-1]), farthest, stiffness


def crossed(
    values: Floats,
    slopes: Floats,
    first: Integers,
    speed: Floats,
    view: View,
    moved: Floats,
    grown: float,
) -> float:
    """Largest shift of a view's outline across itself, where edges are, by a step, px.

    Parameters as of `step`, and what it returns.
    """
    rows = moving(values, slopes, speed, *view[:3])[view[3] > 0]
    return float(np.max(np.abs(rows @ np.append(moved, grown)), initial=0.0))


def _held(matrix: Floats, roughness: Floats, stiffness: float) -> Floats:
    """The normal matrix with the spline's stiffness."""
    held = matrix + FLOOR * np.eye(len(matrix))
    for axis in range(3):
        held[axis:-1:3, axis:-1:3] += stiffness * roughness
    return np.asarray(held)
