"""How far a curve lies from the true one, with and without rigid registration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from .arrays import Floats, check_array
from .backbone import Backbone


@dataclass(frozen=True)
class CurveErrors:
    """Errors of a curve against the truth, mm.

    `mean`, `p95` and `maximum` compare points at equal shares of arc length, so that errors
    at the ends count in full; `distance` is the mean distance from the curve to the nearest
    point of the truth; `tip` and `base` compare the ends; `length` is the difference in length.
    """

    mean: float
    p95: float
    maximum: float
    distance: float
    base: float
    tip: float
    length: float


def curve_errors(backbone: Backbone, truth: Backbone, count: int = 100) -> CurveErrors:
    """Compare a curve with the true one.

    Parameters
    ----------
    backbone, truth : Backbone
    count : int
        Points at equal steps of arc length.

    Examples
    --------
    >>> truth = Backbone.through([[0, 0, 0], [10, 0, 0]])
    >>> beside = Backbone.through([[0, 1, 0], [10, 1, 0]])
    >>> errors = curve_errors(beside, truth)
    >>> round(errors.mean, 6), round(errors.distance, 6), round(errors.tip, 6)
    (1.0, 1.0, 1.0)
    """
    ours, true = backbone.sample(count), truth.sample(count)
    error = np.linalg.norm(ours - true, axis=1)
    return CurveErrors(
        mean=float(error.mean()),
        p95=float(np.percentile(error, 95)),
        maximum=float(error.max()),
        distance=float(distance_to_curve(ours, truth).mean()),
        base=float(error[0]),
        tip=float(error[-1]),
        length=backbone.length - truth.length,
    )


def distance_to_curve(points: Any, curve: Backbone) -> Floats:
    """Distance of (n, 3) points to the nearest point of a curve, (n,), mm."""
    return closest_on_curve(points, curve)[0]


def closest_on_curve(points: Any, curve: Backbone) -> tuple[Floats, Floats]:
    """Distance of (n, 3) points to a curve, and the arc length where each is nearest, mm.

    Parameters
    ----------
    points : (n, 3) array
    curve : Backbone

    Returns
    -------
    distance, arc_length : (n,) arrays, mm
        To 2000 chords of the curve, so right to a curvature's 1e-7 of its length.

    Examples
    --------
    >>> line = Backbone.through([[0, 0, 0], [10, 0, 0]])
    >>> distance, at = closest_on_curve([[4, 3, 0], [12, 0, 0]], line)
    >>> distance.round(6), at.round(6)
    (array([3., 2.]), array([ 4., 10.]))
    """
    points = check_array(points, "points", (None, 3))
    s = curve.arc_lengths(2000)
    samples = curve(s)
    _, nearest = cKDTree(samples).query(points)
    distance, at = np.full(len(points), np.inf), np.zeros(len(points))
    # The nearest sample is at most half a step away; the chords beside it hold the foot.
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, len(samples) - 2)):
        side = samples[first + 1] - samples[first]
        share = np.sum((points - samples[first]) * side, axis=1) / np.sum(side**2, axis=1)
        share = np.clip(share, 0, 1)
        foot = samples[first] + share[:, None] * side
        away = np.linalg.norm(points - foot, axis=1)
        nearer = away < distance
        distance = np.where(nearer, away, distance)
        at = np.where(nearer, s[first] + share * (s[first + 1] - s[first]), at)
    return distance, at


def register_rigid(source: Any, target: Any) -> tuple[Floats, Floats]:
    """Rotation R (3, 3) and translation t (3,) for which R source + t is nearest to target.

    Parameters
    ----------
    source, target : (n, 3) array
        Corresponding points, mm.

    Notes
    -----
    W. Kabsch, Acta Crystallographica A32, 1976.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> rotation, translation = register_rigid(square, square + [0, 0, 2])
    >>> translation.round(9)
    array([0., 0., 2.])
    """
    source = check_array(source, "source", (None, 3))
    target = check_array(target, "target", (len(source), 3))
    centre_s, centre_t = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((source - centre_s).T @ (target - centre_t))
    proper = np.diag([1, 1, np.sign(np.linalg.det(vt.T @ u.T))])
    rotation = np.asarray(vt.T @ proper @ u.T)
    return rotation, centre_t - rotation @ centre_s
