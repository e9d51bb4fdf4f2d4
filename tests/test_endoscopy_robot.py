"""A real concentric-tube robot before two cameras: scaled by the dots, one device in both eyes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

import stereosom
from stereosom import Prior
from stereosom.options import Options
from stereosom_plugin import segmentation
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.calibration import read_calibration
from stereosom_plugin.cli import main
from stereosom_plugin.output import read_table
from stereosom_plugin.segmentation.endoscope import segmenter

# Read off the pictures by eye, px (x, y): the robot's base and tip, left and right.
BASE, TIP = ((511.0, 62.0), (704.0, 59.0)), ((780.0, 485.0), (1079.0, 604.0))


@pytest.fixture(scope="module")
def robot(shared_data):
    """Masks of both eyes, what they show, and the rig in mm."""
    imread = pytest.importorskip("skimage.io").imread
    pytest.importorskip("cv2")
    folder = shared_data / "concentric_tube_robot_stereo"
    names = ("left_0", "right_0", "background_left", "background_right")
    left_0, right_0, left, right = (imread(folder / f"{name}.png")[..., :3] for name in names)
    found = read_calibration(folder / "calibration.json", image_size=(1280, 720), pitch=18.2)
    acquisition = Acquisition(
        lambda _: (left_0, right_0), found.rigs[:1], np.zeros(1), lenses=found.lenses
    )
    masks = []
    seen = next(
        segmentation.observe(
            acquisition,
            segmenter(background=(left, right)),
            show=lambda _, __, mask_a, mask_b: masks.extend([mask_a, mask_b]),
        )
    )
    return masks, seen, found


def by_opencv(found, places):
    """A place read off both pictures, in space, by another program, mm."""
    cv2 = pytest.importorskip("cv2")
    rig, pixels = found.rigs[0], [np.array(place)[:, None] for place in places]
    point = cv2.triangulatePoints(rig.a.projection, rig.b.projection, *pixels)
    return (point[:3] / point[3])[:, 0]


def test_both_masks_reach_from_the_base_to_the_tip(robot):
    masks, _, _ = robot
    for view, mask in enumerate(masks):
        rows, columns = np.nonzero(mask)
        for place, within in ((BASE[view], 25), (TIP[view], 12)):
            gap = np.hypot(columns - place[0], rows - place[1]).min()
            assert gap < within, (view, place, gap)


def test_its_length_comes_with_its_uncertainty(robot):
    _, seen, found = robot
    base, tip = by_opencv(found, BASE), by_opencv(found, TIP)
    chord = np.linalg.norm(tip - base)
    assert chord == pytest.approx(323, abs=10)
    result = stereosom.reconstruct(seen, options=Options(prior=Prior(base=base)))
    assert result.ok, result.reason
    curve = result.backbone
    assert max(result.residuals) < 0.6
    # Longer than from end to end, by less than a third.
    assert chord < curve.length < 1.33 * chord
    assert np.linalg.norm(curve.base - base) < 5
    assert np.linalg.norm(curve.tip - tip) < 10
    # The body is known to a millimetre. At the tip, which bends towards one camera along an
    # epipolar plane, the result says how little it knows.
    body, at_tip = result.standard_deviation_at(np.array([0.5, 1.0]) * curve.length)
    assert body < 1
    assert at_tip > 5
    assert np.linalg.norm(curve.tip - tip) < 2 * at_tip


def test_the_dots_tell_that_the_fundamental_matrix_is_that_of_the_pixels_as_seen(robot):
    """Undistorted by coefficients that the matrix knows nothing of, base and tip, far from the
    dots, lie 20 and 30 px off their epipolar lines."""
    _, _, found = robot
    assert found.lenses is None
    assert any("as seen" in note for note in found.notes)
    for left, right in (BASE, TIP):
        line = found.rigs[0].fundamental @ np.append(left, 1)
        assert abs(line @ np.append(right, 1)) / np.hypot(*line[:2]) < 8


def test_it_goes_through_the_command_line_without_blame(shared_data, tmp_path, capsys):
    folder = shared_data / "concentric_tube_robot_stereo"
    rig = str(tmp_path / "rig.json")
    asked = ["--pitch", "18.2", "--image-size", "1280x720"]
    assert main(["rig", str(folder / "calibration.json"), *asked, "--output", rig]) == 0
    call = [str(folder / f"{side}_0.png") for side in ("left", "right")]
    behind = [str(folder / f"background_{side}.png") for side in ("left", "right")]
    out = tmp_path / "out"
    call += ["--rig", rig, "--background", *behind, "--output", str(out)]
    assert main(["endoscopy", *call]) == 0
    # Seen 104° apart, the scene has no places that can be matched, and that is said of none.
    assert "hardly agree" not in capsys.readouterr().err
    (row,) = read_table(out)
    assert 340 < float(row["length_mm"]) < 420
    assert float(row["sigma_mm"]) < 30


def test_its_middle_is_where_other_programs_find_it(robot):
    """Points of the left middle line, matched on their epipolar lines to the right mask alone."""
    _, seen, found = robot
    result = stereosom.reconstruct(seen, options=Options(prior=Prior(base=by_opencv(found, BASE))))
    cv2 = pytest.importorskip("cv2")
    rig = found.rigs[0]
    points = result.backbone(np.linspace(0.25, 0.7, 10) * result.backbone.length)
    gaps = []
    for pixel in rig.a.project(points):
        near = seen.pixels_a[np.linalg.norm(seen.pixels_a - pixel, axis=1) < 4]
        if len(near) < 10:  # a gap in the mask
            continue
        middle = near.mean(axis=0)
        line = rig.fundamental @ np.append(middle, 1)
        off = np.abs(seen.pixels_b @ line[:2] + line[2]) / np.hypot(*line[:2])
        partners = seen.pixels_b[off < 1]
        if len(partners) == 0:  # a gap in the other
            continue
        other = partners.mean(axis=0)
        point = cv2.triangulatePoints(
            rig.a.projection, rig.b.projection, middle[:, None], other[:, None]
        )
        gaps.append(KDTree(result.backbone.sample(2000)).query((point[:3] / point[3])[:, 0])[0])
    assert len(gaps) >= 5
    assert np.median(gaps) < 1.5
