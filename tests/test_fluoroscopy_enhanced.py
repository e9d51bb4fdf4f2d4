"""Enhanced XA: geometry per frame, angles and table about the room, where the isocenter falls.

The expected pixels are worked out by PS3.17 annex Z as it stands there: from the table's
coordinates to the room's, to the positioner's, to the detector.
"""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pydicom
import pytest
from scipy.spatial.transform import Rotation

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane

POINTS = np.array([[0.0, 0, 0], [20, -10, 15], [-12, 25, -8]])
SOURCE_TO_ISOCENTER, SOURCE_TO_DETECTOR, PITCH = 750.0, 1100.0, 0.4
CENTER = np.array([15.5, 11.5])  # of a picture of 32 × 24


@pytest.fixture
def write(enhanced_dicom, dicom_files, tmp_path):
    def write(**described):
        frames = dicom_files.gray_frames(3)
        return enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames, **described)

    return write


def in_positioner(room, primary, secondary, rotation=0.0):
    """Z.2: from the room to the positioner; its y runs from the detector to the source."""
    turned = Rotation.from_euler("z", -primary, degrees=True).apply(room)
    turned = Rotation.from_euler("x", secondary, degrees=True).apply(turned)
    return Rotation.from_euler("y", -rotation, degrees=True).apply(turned)


def on_detector(positioner):
    """Pixels of points in the positioner: columns along x, rows against z."""
    x, y, z = positioner.T
    scale = SOURCE_TO_DETECTOR / (SOURCE_TO_ISOCENTER - y) / PITCH
    return CENTER + np.column_stack([x, -z]) * scale[:, None]


def test_angles_of_both_planes(write):
    acquisition = read_biplane(*write())
    assert acquisition.notes == ()
    assert len(acquisition.rigs) == 1
    for camera, primary in ((acquisition.rigs[0].a, -30), (acquisition.rigs[0].b, 60)):
        expected = on_detector(in_positioner(POINTS, primary, 0))
        np.testing.assert_allclose(camera.project(POINTS), expected, atol=1e-4)  # FL: 7 digits


def test_it_agrees_with_the_classic_object(write, write_pair):
    enhanced, classic = read_biplane(*write()), read_biplane(*write_pair())
    for one, other in zip(
        (enhanced.rigs[0].a, enhanced.rigs[0].b),
        (classic.rigs[0].a, classic.rigs[0].b),
        strict=True,
    ):
        np.testing.assert_allclose(one.project(POINTS), other.project(POINTS), atol=1e-4)


def test_every_frame_has_its_own_angles(write, enhanced_dicom):
    turning = [enhanced_dicom.groups("A", (-30.0 + 5 * i, 10.0 - i)) for i in range(3)]
    acquisition = read_biplane(*write(a=turning))
    assert len(acquisition.rigs) == 3
    for index in range(3):
        expected = on_detector(in_positioner(POINTS, -30 + 5 * index, 10 - index))
        got = acquisition.rig(index).a.project(POINTS)
        np.testing.assert_allclose(got, expected, atol=1e-4)
    assert any("every frame has its own geometry" in note for note in acquisition.notes)


def test_detector_rotation(write, enhanced_dicom):
    turned = [
        enhanced_dicom.groups(
            "A", (-30.0, 20.0), PositionerIsocenterDetectorRotationAngle=12.0,
            PatientOrientation=None,
        )
    ] * 3  # fmt: skip
    camera = read_biplane(*write(a=turned)).rigs[0].a
    expected = on_detector(in_positioner(POINTS, -30, 20, 12))
    np.testing.assert_allclose(camera.project(POINTS), expected, atol=1e-4)


def test_a_moving_table_carries_the_patient(write, enhanced_dicom):
    """Table 10 mm further to the head in each frame: what lies in the patient moves along."""
    steps = [
        enhanced_dicom.groups("A", (-30.0, 0.0), TableZPositionToIsocenter=-200.0 + 10 * i)
        for i in range(3)
    ]
    acquisition = read_biplane(*write(a=steps))
    for index in range(3):
        expected = on_detector(in_positioner(POINTS + np.array([0, 0, 10 * index]), -30, 0))
        got = acquisition.rig(index).a.project(POINTS)
        np.testing.assert_allclose(got, expected, atol=1e-4)


def test_a_tilted_table(write, enhanced_dicom):
    """Head up by 10 degrees in the second frame, about the table's reference point."""
    reference = np.array([0.0, 100, -200])
    tilts = [
        enhanced_dicom.groups("A", (-30.0, 0.0), TableHeadTiltAngle=float(tilt))
        for tilt in (0, 10, 20)
    ]
    acquisition = read_biplane(*write(a=tilts))
    for index, tilt in enumerate((0, 10, 20)):
        # About x, from head (+z) up (-y): a positive rotation, as y × z = x.
        room = Rotation.from_euler("x", tilt, degrees=True).apply(POINTS - reference) + reference
        got = acquisition.rig(index).a.project(POINTS)
        np.testing.assert_allclose(got, on_detector(in_positioner(room, -30, 0)), atol=1e-4)
    assert any("tilted" in note for note in acquisition.notes)


def test_a_patient_who_lies_feet_first(write, enhanced_dicom):
    """The room's angles are about the table: the patient's left is then the table's right."""
    with pytest.raises(InputError, match="flipped or turned"):
        read_biplane(*write(PatientPosition="FFS"))  # but the pictures are said to show L, F
    lying = [
        [enhanced_dicom.groups(letter, angles, PatientOrientation=["R", "H"])] * 3
        for letter, angles in (("A", (-30.0, 0.0)), ("B", (60.0, 0.0)))
    ]
    acquisition = read_biplane(*write(a=lying[0], b=lying[1], PatientPosition="FFS"))
    room = POINTS * [-1, 1, -1]
    expected = on_detector(in_positioner(room, -30, 0))
    np.testing.assert_allclose(acquisition.rigs[0].a.project(POINTS), expected, atol=1e-4)


def test_angles_about_the_patient_alone(write, enhanced_dicom):
    alone = enhanced_dicom.groups("A", (-30.0, 15.0))
    del alone["IsocenterReferenceSystemSequence"]
    camera = read_biplane(*write(a=[alone] * 3)).rigs[0].a
    expected = on_detector(in_positioner(POINTS, -30, 15))
    np.testing.assert_allclose(camera.project(POINTS), expected, atol=1e-4)


def test_a_table_that_moves_without_its_place_about_the_isocenter_is_noted(write, enhanced_dicom):
    moving = []
    for position in (0.0, 10.0, 20.0):
        moving.append(
            enhanced_dicom.groups("A", (-30.0, 0.0), TableTopLongitudinalPosition=position)
        )
        del moving[-1]["IsocenterReferenceSystemSequence"]
    acquisition = read_biplane(*write(a=moving))
    assert any("the table moves" in note for note in acquisition.notes)


def test_angles_that_contradict_each_other_are_noted(write, enhanced_dicom):
    groups = enhanced_dicom.groups("A", (-30.0, 0.0), PositionerPrimaryAngle=-40.0)
    acquisition = read_biplane(*write(a=[groups] * 3))
    assert any("10.0 degrees apart" in note for note in acquisition.notes)


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
@pytest.mark.parametrize("flip", ["NO", "YES"])
def test_the_isocenter_falls_where_the_detector_says(write, enhanced_dicom, turn, flip):
    """It falls on element (row 27, column 41) of half a pixel; the field begins at (4, 6).

    Expected by turning a picture in which that pixel alone is bright.
    """
    groups = enhanced_dicom.groups(
        "A", (-30.0, 0.0), FieldOfViewOrigin=[4.0, 6.0], FieldOfViewRotation=str(turn),
        FieldOfViewHorizontalFlip=flip, PatientOrientation=None,
    )  # fmt: skip
    both = {"a": [groups] * 3, "b": [enhanced_dicom.groups("B", (60.0, 0.0))] * 3}
    acquisition = read_biplane(*write(**both, PositionOfIsocenterProjection=[26.5, 40.5]))
    before = np.zeros((24, 32) if turn % 180 == 0 else (32, 24))
    before[11, 17] = 1  # elements 22.5 and 34.5 of the field: between the two that make 11 and 17
    picture = np.rot90(before, -turn // 90)
    picture = np.fliplr(picture) if flip == "YES" else picture
    row, column = np.argwhere(picture)[0]
    isocenter = acquisition.rigs[0].a.project([[0, 0, 0]])[0]
    np.testing.assert_allclose(isocenter, [column, row], atol=1e-4)


def test_an_isocenter_that_cannot_be_placed_is_noted(write):
    acquisition = read_biplane(
        *write(PositionOfIsocenterProjection=[20.0, 30.0], DetectorElementSpacing=None)
    )
    assert any("taken to fall on the picture's center" in note for note in acquisition.notes)
    with pytest.raises(InputError, match="far outside"):
        read_biplane(*write(PositionOfIsocenterProjection=[2000.0, 30.0]))


def test_times_come_with_the_frames(write):
    acquisition = read_biplane(*write(steps_ms=(40.0, 40.0), b_starts_ms=12.5))
    np.testing.assert_allclose(acquisition.times, [0, 0.04, 0.08], atol=1e-6)
    assert any("12.5 ms after plane A" in note for note in acquisition.notes)


def test_frames_without_all_their_groups_are_refused(write):
    paths = write()
    dataset = pydicom.dcmread(paths[0])
    del dataset.PerFrameFunctionalGroupsSequence[1]
    dataset.save_as(paths[0])
    with pytest.raises(InputError, match="holds 2 items for 3 frames"):
        read_biplane(*paths)


@pytest.mark.interop
def test_written_objects_keep_to_the_standard(write, enhanced_dicom):
    """What these tests read is what a device would write (dicom3tools)."""
    program = shutil.which("dciodvfy")
    if program is None:
        pytest.skip("dciodvfy (dicom3tools) is not installed")
    turning = [enhanced_dicom.groups("A", (-30.0 + 5 * i, 10.0)) for i in range(3)]
    for path in write(a=turning):
        found = subprocess.run([program, path], capture_output=True, text=True)
        assert "Error" not in found.stderr + found.stdout
