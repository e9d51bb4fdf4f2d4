import numpy as np
import pytest

from stereosom.backbone import Backbone
from stereosom.metrics import curve_errors, distance_to_curve, register_rigid
from stereosom.synthetic import arc, growing_helix


def test_a_curve_has_no_error_against_itself():
    errors = curve_errors(growing_helix(), growing_helix())
    assert errors.mean == 0
    assert errors.distance == pytest.approx(0, abs=1e-4)


def test_a_shortened_curve_errs_at_its_tip_but_lies_on_the_truth():
    truth = Backbone.through([[0, 0, 0], [100, 0, 0]])
    errors = curve_errors(truth.between(0, 90), truth)
    assert errors.tip == pytest.approx(10)
    assert errors.mean == pytest.approx(5)
    assert errors.distance == pytest.approx(0, abs=1e-9)
    assert errors.length == pytest.approx(-10)


def test_distance_to_a_circle_is_the_difference_of_radii():
    angle = np.radians([10, 45, 80])
    points = np.column_stack([50 - 47 * np.cos(angle), 0 * angle, 47 * np.sin(angle)])
    assert distance_to_curve(points, arc(50, 90)) == pytest.approx([3, 3, 3], abs=1e-4)


def test_registration_finds_the_motion_that_was_made():
    points = growing_helix().sample(40)
    turn, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    rotation, translation = register_rigid(points, points @ turn.T + [5, -3, 8])
    assert rotation == pytest.approx(turn)
    assert translation == pytest.approx([5, -3, 8])


def test_registration_does_not_mirror():
    points = growing_helix().sample(40)
    rotation, _ = register_rigid(points, points * [-1, 1, 1])
    assert np.linalg.det(rotation) == pytest.approx(1)
