"""The conventional self-organizing map on a curve: best units, batch training, ordering.

Section II-A of J. M. Croom, D. C. Rucker, J. M. Romano, R. J. Webster III, "Visual sensing
of continuum robot shape using self-organizing maps", IEEE ICRA 2010, after Kumar et al.
Points and reference vectors may have any dimension: pixels in the stereo map, mm in space.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from .arrays import Floats, Integers


def best_units(points: Floats, references: Floats) -> Integers:
    """Index of the reference vector nearest to each point (the paper's Q_c), (n,).

    Parameters
    ----------
    points : (n, d) array
    references : (k, d) array

    Examples
    --------
    >>> best_units(np.array([[0.9], [0.1]]), np.array([[0.0], [1.0]]))
    array([1, 0])
    """
    return np.asarray(np.argmin(_closeness(points, references), axis=1))


def best_two_units(points: Floats, references: Floats) -> tuple[Integers, Integers]:
    """Indices of the nearest and second nearest reference vectors (Q_c and Q_c'), (n,) each.

    Raises
    ------
    ValueError
        Where there are fewer than two reference vectors.
    """
    if len(references) < 2:
        raise ValueError("references: a second best unit needs at least two reference vectors")
    closeness = _closeness(points, references)
    best = np.argmin(closeness, axis=1)
    closeness[np.arange(len(points)), best] = np.inf
    return best, np.argmin(closeness, axis=1)


def train_epoch(points: Floats, references: Floats, neighborhood: int) -> tuple[Floats, Integers]:
    """One epoch of batch training, equation (2).

    Each reference vector moves to the mean of all points whose best unit is at most
    `neighborhood` places from it in the order. Sums and counts of each unit's own points are
    computed once and added up over the overlapping ranges.

    Parameters
    ----------
    points : (n, d) array
    references : (k, d) array
        In order along the curve.
    neighborhood : int
        The paper's n.

    Returns
    -------
    references : (k, d) array
        One without a point in its whole range stays where it is.
    counts : (k,) array of int
        Points of which each is the best unit, before the move.

    Examples
    --------
    With n = 0 each moves to the mean of its own points:

    >>> points = np.array([[0.0], [2.0], [10.0]])
    >>> train_epoch(points, np.array([[1.5], [9.0]]), neighborhood=0)[0].ravel()
    array([ 1., 10.])
    """
    best = best_units(points, references)
    k = len(references)
    counts = np.bincount(best, minlength=k)
    totals = [np.bincount(best, column, minlength=k) for column in points.T]
    sums = np.column_stack(totals).astype(np.float64)
    own = counts.astype(np.float64)[:, None]
    in_range = _sum_over_range(own, neighborhood)
    means = _sum_over_range(sums, neighborhood) / np.maximum(in_range, 1.0)
    return np.where(in_range > 0, means, references), counts


class Trainer:
    """Points made ready for many epochs: the same as `train_epoch`, at less than half the time.

    The nearest reference vector q to a point p has the largest p·q − |q|²/2, so all distances
    are one matrix product of the points, with a column of ones, and the reference vectors.

    Parameters
    ----------
    points : (n, d) array
    """

    def __init__(self, points: Floats) -> None:
        # About their middle, so that far-away coordinates lose no digits in the difference.
        self._origin = points.mean(axis=0)
        centered = points - self._origin
        self._extended = np.column_stack([centered, np.ones(len(points))])
        self._columns = [np.ascontiguousarray(column) for column in centered.T]

    def epoch(self, references: Floats, neighborhood: int) -> tuple[Floats, Integers]:
        """As `train_epoch`."""
        k, dimensions = references.shape
        centered = references - self._origin
        weights = np.empty((dimensions + 1, k))
        weights[:-1] = centered.T
        weights[-1] = -0.5 * np.einsum("kd,kd->k", centered, centered)
        best = (self._extended @ weights).argmax(axis=1)
        counts = np.bincount(best, minlength=k)
        sums = np.empty((k, dimensions + 1))
        for axis, column in enumerate(self._columns):
            sums[:, axis] = np.bincount(best, column, minlength=k)
        sums[:, -1] = counts
        sums = _range_matrix(k, neighborhood) @ sums
        in_range = sums[:, -1:]
        if in_range.all():
            return sums[:, :-1] / in_range + self._origin, counts
        means = sums[:, :-1] / np.maximum(in_range, 1.0) + self._origin
        return np.where(in_range > 0, means, references), counts


def adjacency_matrix(best: Integers, second: Integers, count: int) -> csr_array[np.float64]:
    """Adjacency matrix A, equation (1): how many points have best unit m and second best n.

    Parameters
    ----------
    best, second : (n,) arrays of int
    count : int
        Number of reference vectors.

    Examples
    --------
    >>> adjacency_matrix(np.array([0, 0, 1]), np.array([1, 1, 0]), 2).toarray()
    array([[0., 2.],
           [1., 0.]])
    """
    votes = np.ones(len(best))
    return csr_array((votes, (best, second)), shape=(count, count))


def order_by_adjacency(adjacency: csr_array[np.float64]) -> Integers:
    """Permutation that gathers the adjacency matrix at its diagonal, (k,).

    Reverse Cuthill–McKee on the symmetric pattern, as Matlab's `symrcm` in the paper.

    Examples
    --------
    A path 0 – 2 – 1 is put in line, from one of its ends or the other:

    >>> path = adjacency_matrix(np.array([0, 2]), np.array([2, 1]), 3)
    >>> [int(unit) for unit in order_by_adjacency(path)] in ([0, 2, 1], [1, 2, 0])
    True
    """
    symmetric = csr_array(adjacency + adjacency.T)
    order = reverse_cuthill_mckee(symmetric, symmetric_mode=True)
    return np.asarray(order, dtype=np.intp)


def topographic_error(best: Integers, second: Integers) -> float:
    """Share of points whose two best units are not neighbors in the order, 0 to 1."""
    return float(np.mean(np.abs(best - second) != 1))


def _closeness(points: Floats, references: Floats) -> Floats:
    """Squared distances but for a term that is the same for all references, (n, k)."""
    # About a common origin, so that far-away coordinates lose no digits in the difference.
    origin = references.mean(axis=0)
    points, references = points - origin, references - origin
    return np.asarray(np.sum(references**2, axis=1) - 2 * points @ references.T)


@lru_cache(maxsize=256)
def _range_matrix(count: int, reach: int) -> Floats:
    """(k, k) matrix of ones from l − reach to l + reach: a product with it sums over ranges."""
    ones = np.ones((count, count))
    matrix = np.tril(np.triu(ones, -reach), reach)
    matrix.setflags(write=False)
    return matrix


def _sum_over_range(values: Floats, reach: int) -> Floats:
    """Sum of (k, m) rows l − reach … l + reach, cut at the ends."""
    total = np.vstack([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    at = np.arange(len(values))
    high = np.minimum(at + reach + 1, len(values))
    return np.asarray(total[high] - total[np.maximum(at - reach, 0)])
