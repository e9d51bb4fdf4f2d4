"""A rig that is wrong by a known transform, and what a device seen by the true one says of it.

The pictures are silhouettes drawn with the true rig; the errors are made here, from the
positioner's angles and distances, without the code that corrects them.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom.reconstruction import HardFrame
from stereosom.self_calibration import RigUncertainty, agreement, refine_rig
from stereosom.synthetic import observe, silhouette

SIZE = (512, 512)
SID, SOD = 1100.0, 750.0


def c_arm(primary_deg, secondary_deg=0.0, shift=(0, 0, 0), sid=SID, sod=SOD, roll_deg=0.0):
    """Camera of one C-arm whose isocenter is off by `shift`, mm."""
    a, b, roll = np.radians([primary_deg, secondary_deg, roll_deg])
    to_detector = np.array(
        [
            [np.cos(a), np.sin(a), 0],
            [np.sin(a) * np.sin(b), -np.cos(a) * np.sin(b), -np.cos(b)],
            [np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b), np.sin(b)],
        ]
    )
    turn = [[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]]
    rotation = turn @ to_detector
    focal = [[sid / 0.4, 0, 255.5], [0, sid / 0.4, 255.5], [0, 0, 1]]
    return Camera.from_pose(focal, rotation, [0, 0, sod] - rotation @ np.array(shift), SIZE)


TRUE = StereoRig(c_arm(-30), c_arm(60), "isocenter_lps")
# Right angles, isocenters and distances, wrong as headers are.
WRONG = {
    "angle": StereoRig(c_arm(-30, 1.5), c_arm(60, -1.5), "isocenter_lps"),
    "isocenter": StereoRig(c_arm(-30, shift=(0, 0, 4)), c_arm(60), "isocenter_lps"),
    "distance": StereoRig(c_arm(-30, sid=1.01 * SID), c_arm(60, sod=0.99 * SOD), "isocenter_lps"),
    "all": StereoRig(
        c_arm(-28.5, -1, (3, -2, -4), 0.993 * SID),
        c_arm(58.8, 1.7, (-3, 1, 4), SID, 1.007 * SOD, roll_deg=0.3),
        "isocenter_lps",
    ),
}


def device(phase):
    """A curve with two free ends, bent another way and placed elsewhere at each phase."""
    s = np.linspace(0, 1, 200)
    bend = 0.35 * np.sin(2 * np.pi * phase)
    x = 25 * np.sin(2 * np.pi * (s * 0.8 + phase)) * s + 18 * np.cos(5 * phase)
    y = 30 * np.cos(2 * np.pi * (s * 0.6 - phase)) * s + 15 * np.sin(7 * phase)
    z = 75 * (s - 0.5) - 45 * (0.6 + bend) * np.maximum(s - 0.6, 0) ** 2 * 6
    return Backbone.through(np.column_stack([x, y, z + 20 * np.sin(11 * phase)]))


@cache
def seen(frames=12, rig=TRUE):
    return tuple(
        replace(observe(device(i / frames), 0.8, rig, time=i / 15), index=i) for i in range(frames)
    )


def under(rig, observations=None):
    """The same pixels, with another word about where the views stood."""
    return [replace(one, rig=rig) for one in observations or seen()]


def held_out_error(rig, true=TRUE):
    """Median epipolar distance, px, of points all over the volume that no device has touched."""
    x = np.random.default_rng(5).uniform(-45, 45, (300, 3))
    pixels = [np.column_stack([c.project(x), np.ones(300)]) for c in (true.a, true.b)]
    f = rig.fundamental
    product = np.sum((pixels[1] @ f) * pixels[0], axis=1)
    lines = pixels[0] @ f.T, pixels[1] @ f
    away = [np.abs(product) / np.linalg.norm(line[:, :2], axis=1) for line in lines]
    return float(np.median(away))


def test_a_right_rig_is_left_alone():
    found = refine_rig(seen())
    assert found.epipolar_error_before < 0.6
    assert held_out_error(found.rig) < 0.8
    for change in found.changes:
        assert abs(change.value) < 0.4 * change.deviation_before, change


@pytest.mark.parametrize("kind", WRONG)
def test_a_known_error_is_taken_away(kind):
    wrong = WRONG[kind]
    found = refine_rig(under(wrong))
    assert found.epipolar_error_after < 0.6
    assert held_out_error(found.rig) < max(0.2 * held_out_error(wrong), 1.0)


def test_an_isocenter_shift_along_the_common_axis_is_split_between_the_views():
    """4 mm between the planes, each as likely to be wrong: 2 mm in each, in opposite directions.

    Down in both pictures is toward the feet.
    """
    found = refine_rig(under(WRONG["isocenter"]))
    down = {change.view: change.value for change in found.changes if change.name == "down"}
    assert down["a"] == pytest.approx(2, abs=0.35)
    assert down["b"] == pytest.approx(-2, abs=0.35)


def test_what_both_views_share_is_not_observable_and_not_changed():
    """The whole rig turned, moved and made larger: every epipolar line stays where it was."""
    angle = np.radians(7)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    world = np.vstack([np.column_stack([1.03 * turn, [4, -6, 9]]), [0, 0, 0, 1]])
    moved = StereoRig(
        Camera(TRUE.a.projection @ world, SIZE), Camera(TRUE.b.projection @ world, SIZE)
    )
    found, plain = refine_rig(under(moved)), refine_rig(seen())
    assert found.epipolar_error_before == pytest.approx(plain.epipolar_error_before, abs=1e-6)
    for one, other in zip(found.changes, plain.changes, strict=True):
        assert one.value == pytest.approx(other.value, abs=0.05 * one.deviation_before)


def test_the_correction_has_no_part_in_common_motion():
    """Orthogonal, in the measure of the standard deviations, to moving both views alike."""
    found = refine_rig(under(WRONG["all"]))
    for axis in np.eye(3):
        inner, size = 0.0, 0.0
        for view, camera in (("a", TRUE.a), ("b", TRUE.b)):
            rows = camera.projection[:, :3]
            right, down = (rows[i] - (rows[i] @ camera.axis) * camera.axis for i in (0, 1))
            for name, direction in (("right", right), ("down", down), ("depth", camera.axis)):
                along = direction @ axis / np.linalg.norm(direction)
                (change,) = (c for c in found.changes if (c.view, c.name) == (view, name))
                inner += along * change.value / change.deviation_before**2
                size += abs(along * change.value) / change.deviation_before**2
        assert abs(inner) < 0.15 * size  # the axes are those of the true rig, not of the wrong one


def test_deviations_say_what_the_device_has_determined():
    found = refine_rig(under(WRONG["all"]))
    after = {(c.view, c.name): c.deviation_after / c.deviation_before for c in found.changes}
    assert all(0 < share <= 1 + 1e-9 for share in after.values())
    # Half of the variance of a relative shift is common to both views, and stays.
    assert after["a", "down"] == pytest.approx(np.sqrt(0.5), abs=0.08)
    # Along the line of sight of a view nothing is seen of it in the other at right angles.
    assert after["a", "right"] > 0.9


def test_wrong_matches_do_not_spoil_it():
    """In every third frame the second view has found another wire."""
    frames = list(under(WRONG["all"]))
    for i in range(0, len(frames), 3):
        wire = silhouette(device(0.37 + i), 0.8, TRUE.b)
        row, column = np.nonzero(wire)
        frames[i] = replace(frames[i], pixels_b=np.column_stack([column, row]).astype(float))
    assert held_out_error(refine_rig(frames).rig) < 0.2 * held_out_error(WRONG["all"])


def test_the_correction_of_one_rig_serves_every_position_of_the_arm():
    """Positioners move; their mounting is wrong by the same amount all the way."""
    turns = np.linspace(0, 20, 12)
    true = [StereoRig(c_arm(-30 + t), c_arm(60 + t)) for t in turns]
    said = [StereoRig(c_arm(-30 + t, 1), c_arm(60 + t, -1, (0, 0, 3))) for t in turns]
    frames = [replace(observe(device(i / 12), 0.8, rig), rig=wrong)
              for i, (rig, wrong) in enumerate(zip(true, said, strict=True))]  # fmt: skip
    found = refine_rig(frames)
    for rig, wrong in zip(true, said, strict=True):
        assert held_out_error(found.apply(wrong), rig) < 0.2 * held_out_error(wrong, rig)


def test_an_end_that_is_hidden_by_a_bend_is_not_taken_for_one():
    """The tip turns back and lies before the device itself in view a; view b sees it turn."""
    camera = TRUE.a
    toward = camera.axis
    aside = np.cross(toward, [0, 0, 1])

    def hook(i):
        s = np.linspace(0, np.pi * 0.95, 60)[:, None]
        stem = np.column_stack([np.zeros((60, 2)), np.linspace(-50, 10, 60)])
        bend = [0, 0, 10] + 8 * (np.sin(s) * [0, 0, 1] + (1 - np.cos(s)) * toward)
        moved = 15 * np.sin(i) * aside + 12 * np.cos(2 * i) * toward + [0, 0, 10 * np.sin(3 * i)]
        return Backbone.through(np.vstack([stem[:-1], bend]) + moved)

    frames = [observe(hook(i), 0.8, TRUE) for i in range(10)]
    found = agreement(frames)
    assert found.places >= 10
    assert found.epipolar_error < 2.0  # taking the bend for the tip would make it 20


def test_too_little_to_go_by_is_refused():
    with pytest.raises(HardFrame, match="places"):
        refine_rig(seen()[:1])
    with pytest.raises(HardFrame, match="places"):
        refine_rig([])
    assert np.isnan(agreement([]).epipolar_error)


@pytest.mark.parametrize("angle", [0.0, -1.0, np.nan, np.inf])
def test_absurd_deviations_are_refused(angle):
    with pytest.raises(ValueError, match="positive"):
        RigUncertainty(angle_deg=angle)


def test_nothing_is_changed_that_is_known_for_sure():
    sure = RigUncertainty(1e-6, 1e-6, 1e-6, 1e-9)
    found = refine_rig(under(WRONG["all"]), uncertainty=sure)
    np.testing.assert_allclose(found.rig.a.projection, WRONG["all"].a.projection, atol=1e-2)
    assert found.epipolar_error_after == pytest.approx(found.epipolar_error_before, rel=1e-3)
