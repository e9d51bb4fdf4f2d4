import numpy as np
import pytest

from stereosom.som import (
    Trainer,
    adjacency_matrix,
    best_two_units,
    best_units,
    order_by_adjacency,
    topographic_error,
    train_epoch,
)


def literal_epoch(points, references, n):
    """Equation (2) of the paper, word for word: the reference for the fast one."""
    k = len(references)
    distance = np.linalg.norm(points[:, None] - references, axis=2)
    own = [points[distance.argmin(axis=1) == j] for j in range(k)]
    moved = references.copy()
    for unit in range(k):
        near = [own[j] for j in range(max(0, unit - n), min(k, unit + n + 1)) if len(own[j])]
        total = sum(len(group) for group in near)
        if total:
            moved[unit] = sum(len(group) * group.mean(axis=0) for group in near) / total
    return moved, np.array([len(group) for group in own])


@pytest.mark.parametrize("n", [0, 1, 3])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_an_epoch_is_equation_2(n, dimensions):
    rng = np.random.default_rng(1)
    points, references = rng.normal(size=(300, dimensions)), rng.normal(size=(40, dimensions))
    expected, expected_counts = literal_epoch(points, references, n)
    for moved, counts in (train_epoch(points, references, n), Trainer(points).epoch(references, n)):
        assert moved == pytest.approx(expected)
        assert (counts == expected_counts).all()


def test_best_units_are_the_nearest_even_far_from_the_origin():
    rng = np.random.default_rng(2)
    points, references = rng.normal(size=(200, 2)) + 1e7, rng.normal(size=(30, 2)) + 1e7
    order = np.linalg.norm(points[:, None] - references, axis=2).argsort(axis=1)
    best, second = best_two_units(points, references)
    assert (best_units(points, references) == order[:, 0]).all()
    assert (best == order[:, 0]).all()
    assert (second == order[:, 1]).all()


def test_adjacency_of_an_ordered_line_lies_beside_the_diagonal():
    points = np.linspace(0, 10, 500)[:, None]
    best, second = best_two_units(points, np.linspace(0.5, 9.5, 10)[:, None])
    matrix = adjacency_matrix(best, second, 10).toarray()
    assert matrix.sum() == 500
    assert matrix[np.abs(np.subtract.outer(np.arange(10), np.arange(10))) != 1].sum() == 0
    assert topographic_error(best, second) == 0


def test_reverse_cuthill_mckee_puts_a_shuffled_line_in_order():
    places, points = np.linspace(0.5, 9.5, 30), np.linspace(0, 10, 2000)[:, None]
    shuffled = np.random.default_rng(3).permutation(places)[:, None]
    best, second = best_two_units(points, shuffled)
    ordered = shuffled[order_by_adjacency(adjacency_matrix(best, second, 30))].ravel()
    assert ordered.tolist() in (sorted(places), sorted(places, reverse=True))


def test_one_reference_vector_has_no_second_best():
    with pytest.raises(ValueError, match="at least two"):
        best_two_units(np.zeros((3, 2)), np.zeros((1, 2)))
