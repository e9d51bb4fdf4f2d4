import numpy as np
import pytest

from stereosom.assessment import assess, curve_covariance
from stereosom.backbone import Backbone
from stereosom.observation import Observation
from stereosom.reconstruction import HardFrame, Reconstruction
from stereosom.synthetic import arc, converging_rig, observe

RIG = converging_rig(90)
VERTICAL = Backbone.through([[0, 0, 30], [0, 0, 120]])


def assessed(curve, seen):
    return assess(curve, seen, end_deviation=0.5, method="test")


def test_a_curve_in_the_middle_of_the_device_has_no_residual():
    result = assessed(VERTICAL, observe(VERTICAL, 2.0, RIG))
    assert result.residuals == pytest.approx((0, 0), abs=0.1)
    assert result.radius == pytest.approx(2.0, rel=0.08)


def test_a_curve_beside_the_device_has_its_offset_as_residual():
    # 1 mm towards +y, seen at 45°, from 700 mm with 2400 px: sin 45° · 2400 / 700 = 2.42 px
    beside = VERTICAL.transformed(np.eye(3), [0, 1, 0])
    result = assessed(beside, observe(VERTICAL, 2.0, RIG))
    assert result.residuals == pytest.approx((2.42, 2.42), abs=0.1)


def test_covariance_of_two_orthogonal_views_is_the_pixel_error_in_millimetres():
    # Across a vertical line both orthogonal views measure σ px of 700/2400 mm each.
    covariance = curve_covariance(VERTICAL, observe(VERTICAL, 2.0, RIG), (3.0, 3.0), 0.0)
    middle = covariance[100]
    assert np.sqrt(np.diag(middle))[:2] == pytest.approx(3.0 * 700 / 2400, rel=0.01)
    assert middle[2, 2] == pytest.approx(0, abs=1e-6)


def test_a_narrow_angle_leaves_depth_weak():
    rig = converging_rig(10)
    covariance = curve_covariance(VERTICAL, observe(VERTICAL, 2.0, rig), (1.0, 1.0), 0.0)[100]
    across, depth = np.sqrt(covariance[1, 1]), np.sqrt(covariance[0, 0])
    assert depth / across == pytest.approx(1 / np.tan(np.radians(5)), rel=0.02)


def test_a_stretch_in_an_epipolar_plane_is_not_determined():
    # Both cameras stand at z = 75: a device that runs at this height has no depth.
    flat = Backbone.through([[0, -40, 75], [10, 0, 75], [0, 40, 75]])
    result = assessed(flat, observe(flat, 1.0, RIG))
    assert not result.determined_at(flat.arc_lengths(20)).any()
    upright = assessed(VERTICAL, observe(VERTICAL, 1.0, RIG))
    assert upright.determined_at(VERTICAL.arc_lengths(20)).all()


def test_at_its_ends_the_deviation_counts_along_the_curve_too():
    s = np.array([0.0, 45.0, 90.0])
    deviation = assessed(VERTICAL, observe(VERTICAL, 2.0, RIG)).standard_deviation_at(s)
    assert deviation[[0, 2]] == pytest.approx(0.5)
    assert deviation[1] < 0.2


@pytest.mark.parametrize(
    ("curve", "says"),
    [
        (VERTICAL.transformed(np.eye(3), [0, 30, 0]), "no curve was found that follows"),
        (VERTICAL.between(0, 20), "belong to no part of the curve"),
        (VERTICAL.transformed(np.eye(3), [5000, 0, 0]), "behind the camera"),
    ],
)
def test_a_curve_that_is_another_one_is_refused(curve, says):
    with pytest.raises(HardFrame, match=says):
        assessed(curve, observe(VERTICAL, 2.0, RIG))


def test_edge_pixels_tell_no_radius():
    seen = observe(VERTICAL, 2.0, RIG)
    edges = Observation(seen.pixels_a, seen.pixels_b, RIG, kind="edges")
    assert assessed(VERTICAL, edges).radius is None


@pytest.mark.parametrize(
    "change",
    [
        {"status": "ok"},
        {"status": "failed"},
        {"status": "failed", "reason": "x", "backbone": arc()},
        {"status": "lovely", "reason": "x"},
    ],
)
def test_a_result_that_contradicts_itself_is_refused(change):
    with pytest.raises(ValueError):
        Reconstruction(index=0, time=0.0, **change)


def test_the_deviation_across_is_that_of_the_covariance_without_the_way_along():
    curve, rng = arc(), np.random.default_rng(3)
    root = rng.normal(size=(40, 3, 3))
    covariance = root @ root.transpose(0, 2, 1)
    result = Reconstruction(
        0, 0.0, "ok", backbone=curve, covariance=covariance, residuals=(1.0, 1.0)
    )
    s = curve.arc_lengths(40)
    tangent = curve.tangent(s)
    across = np.eye(3) - tangent[:, :, None] * tangent[:, None, :]
    largest = np.linalg.eigvalsh(across @ covariance @ across)[:, -1]
    expected = np.sqrt(np.append(largest[:-1], np.linalg.eigvalsh(covariance[-1])[-1]))
    assert result.standard_deviation_at(s[1:]) == pytest.approx(expected[1:], rel=1e-9)
