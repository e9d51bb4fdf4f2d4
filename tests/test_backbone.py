import numpy as np
import pytest
from scipy.integrate import quad

from stereosom.backbone import Backbone
from stereosom.synthetic import arc, growing_helix


def helix(radius=20.0, pitch=30.0, turns=2.0, points=400):
    angle = np.linspace(0, 2 * np.pi * turns, points)
    height = pitch * angle / (2 * np.pi)
    return Backbone.through(
        np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    )


def test_a_circle_has_its_length_and_curvature():
    circle = arc(radius=50, angle_deg=90)
    s = circle.arc_lengths(50)
    assert circle.length == pytest.approx(50 * np.pi / 2, rel=1e-8)
    assert circle.curvature(s) == pytest.approx(1 / 50, rel=1e-3)
    assert circle.torsion(s) == pytest.approx(0, abs=1e-9)
    assert circle.tangent(0.0) == pytest.approx([0, 0, 1], abs=1e-4)


def test_a_helix_has_its_curvature_and_torsion():
    curve, c = helix(), 30 / (2 * np.pi)
    s = curve.arc_lengths(40)[2:-2]  # a spline's ends know less
    assert curve.length == pytest.approx(2 * np.hypot(2 * np.pi * 20, 30), rel=1e-7)
    assert curve.curvature(s) == pytest.approx(20 / (20**2 + c**2), rel=1e-2)
    assert curve.torsion(s) == pytest.approx(c / (20**2 + c**2), rel=2e-2)


def test_points_are_at_the_arc_length_that_was_asked_for():
    # The parabola y = x²/20 by its control points; its arc length by an outside integrator.
    curve = Backbone([0, 0, 0, 1, 1, 1], [[0, 0, 0], [5, 0, 0], [10, 5, 0]], degree=2)
    for s in (1.0, 4.0, 9.0):
        reached, _ = quad(lambda t: np.hypot(1, 0.1 * t), 0, curve(s)[0])
        assert reached == pytest.approx(s, rel=1e-9)


def test_equal_steps_of_arc_length_are_equal():
    steps = np.linalg.norm(np.diff(growing_helix().sample(2000), axis=0), axis=1)
    assert steps == pytest.approx(steps.mean(), rel=1e-4)


def test_a_polynomial_is_fitted_exactly():
    t = np.linspace(0, 1, 60)[:, None]
    points = t * [10, 0, 40] + t**2 * [0, 15, 0] + t**3 * [5, 5, 5]
    curve = Backbone.fit_polynomial(points, degree=6)
    distance = np.linalg.norm(points - curve.sample(4000)[:, None], axis=2).min(axis=0)
    assert distance.max() < 0.02  # chord length is not t, so the fit is close but not exact


def test_reversing_swaps_base_and_tip_and_keeps_the_shape():
    curve = growing_helix()
    back = curve.reversed()
    assert back.base == pytest.approx(curve.tip)
    assert back.sample(30) == pytest.approx(curve.sample(30)[::-1], abs=1e-9)
    s = curve.arc_lengths(30)
    assert back.torsion(s)[::-1] == pytest.approx(curve.torsion(s), abs=1e-9)


def test_rigid_motion_moves_points_and_keeps_curvature():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    curve, moved = growing_helix(), growing_helix().transformed(turn, [1, 2, 3])
    s = curve.arc_lengths(20)
    assert moved(s) == pytest.approx(curve(s) @ turn.T + [1, 2, 3])
    assert moved.curvature(s) == pytest.approx(curve.curvature(s))


def test_frames_are_orthonormal_and_do_not_twist():
    curve = helix()
    s = curve.arc_lengths(300)
    frames = curve.frames(s)
    assert frames @ frames.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (300, 1, 1)))
    assert np.linalg.det(frames) == pytest.approx(1)
    # Rotation-minimizing: a normal's change has no part along the other normal.
    change = np.gradient(frames[:, 1], s, axis=0)
    assert np.abs(np.sum(change * frames[:, 2], axis=1))[2:-2].max() < 1e-4


def test_frames_survive_arc_lengths_that_differ_by_rounding():
    s = arc().arc_lengths(400)
    assert np.isfinite(arc().frames(np.sort(np.concatenate([s, np.nextafter(s[:-1], 1e9)])))).all()


def test_a_planar_curve_keeps_its_normal():
    frames = arc().frames(arc().arc_lengths(10))
    in_plane = np.abs(frames[:, 1:, 1]).max(axis=1)
    assert in_plane == pytest.approx(np.ones(10))


def test_two_points_make_a_straight_line():
    line = Backbone.through([[0, 0, 0], [0, 0, 0], [0, 0, 8]])  # a repeat is passed over
    assert line.length == pytest.approx(8)
    assert line.curvature([2.0, 4.0]) == pytest.approx([0, 0])
    assert line.tip == pytest.approx([0, 0, 8])


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([[0, 0, 0]], "two different points"),
        ([[1, 2, 3], [1, 2, 3]], "two different points"),
        ([[0, 0], [1, 1]], "must be n×3"),
        ([[0, 0, 0], [1, np.inf, 0]], "not finite"),
    ],
)
def test_what_is_no_curve_is_refused(points, says):
    with pytest.raises(ValueError, match=says):
        Backbone.through(points)


def test_arc_lengths_outside_the_curve_are_refused():
    with pytest.raises(ValueError, match="between 0 and"):
        arc()(arc().length + 1)


@pytest.mark.parametrize(("start", "stop"), [(3.0, 20.0), (0.0, 20.0), (3.0, None), (0.0, None)])
def test_a_stretch_is_the_same_curve(start, stop):
    steps = np.random.default_rng(0).normal((1.2, 0.2, 0.2), 0.5, (60, 3))
    points = np.cumsum(steps, axis=0)
    whole = Backbone.fit_spline(points, segments=12)
    stop = whole.length if stop is None else stop
    stretch = whole.between(start, stop)
    assert stretch.length == pytest.approx(stop - start, rel=1e-9)
    s = np.linspace(0, stop - start, 30)
    assert np.allclose(stretch(s.clip(0, stretch.length)), whole(start + s), atol=1e-7)
    assert len(stretch.coefficients) <= len(whole.coefficients) + 2 * whole.degree
