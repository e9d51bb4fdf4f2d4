"""Runs that are no pair of files: series of single frames, and one file with both planes."""

from __future__ import annotations

import numpy as np
import pydicom
import pytest

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane


def grays(acquisition):
    """The gray of each pair's pictures, which are of one gray each."""
    return [(int(pair.image_a[0, 0]), int(pair.image_b[0, 0])) for pair in acquisition]


def test_series_of_single_frames(dicom_files, tmp_path):
    paths = dicom_files.write_series(tmp_path)
    for given in ([tmp_path], [paths]):
        acquisition = read_biplane(*given)
        assert grays(acquisition) == [(100, 200), (101, 201), (102, 202), (103, 203)]
        np.testing.assert_allclose(acquisition.times, [0, 0.1, 0.2, 0.3])
        assert acquisition.notes == ()
        assert len(acquisition.rigs) == 1
        assert len(acquisition.sources) == 8
    frames_a, _ = acquisition.source_frames
    assert [frame.path.name[-5] for frame in frames_a] == list("0123")
    assert {frame.number for frame in frames_a} == {0}


def test_a_folder_for_each_plane(dicom_files, tmp_path):
    for path in dicom_files.write_series(tmp_path):
        (tmp_path / path.name[0]).mkdir(exist_ok=True)
        path.rename(tmp_path / path.name[0] / path.name)
    assert len(read_biplane(tmp_path / "B", tmp_path / "A")) == 4
    with pytest.raises(InputError, match="one plane only"):
        read_biplane(tmp_path / "A", tmp_path / "A")


def test_series_are_paired_by_the_clock(dicom_files, tmp_path):
    dicom_files.write_series(tmp_path, b_later=0.21)
    acquisition = read_biplane(tmp_path)
    assert grays(acquisition) == [(102, 200), (103, 201)]
    assert any("starts 0.210 s after" in note for note in acquisition.notes)
    assert any("10.0 ms after plane A" in note for note in acquisition.notes)


def test_series_without_times_are_counted(dicom_files, tmp_path):
    dicom_files.write_series(tmp_path, AcquisitionTime=None, CineRate="20")
    acquisition = read_biplane(tmp_path)
    np.testing.assert_allclose(acquisition.times, [0, 0.05, 0.1, 0.15])
    assert any("InstanceNumber" in note and "CineRate" in note for note in acquisition.notes)


def test_series_without_times_and_rate_are_refused(dicom_files, tmp_path):
    dicom_files.write_series(tmp_path, AcquisitionTime=None)
    with pytest.raises(InputError, match="do not say when") as raised:
        read_biplane(tmp_path)
    assert "\n" not in str(raised.value)


def test_a_series_whose_arm_moves(dicom_files, tmp_path):
    for path in dicom_files.write_series(tmp_path):
        if path.name[0] == "A":
            dicom_files.rewrite(path, PositionerPrimaryAngle=str(-30 + 5 * int(path.stem[-1])))
    acquisition = read_biplane(tmp_path)
    axis = acquisition.rig(2).a.axis
    np.testing.assert_allclose(np.degrees(np.arctan2(axis[0], -axis[1])), -20)


def test_a_series_of_different_pictures_is_refused(dicom_files, tmp_path):
    path = dicom_files.write_series(tmp_path)[1]
    dicom_files.rewrite(path, Rows=12, PixelData=bytes(12 * 32 * 2))
    with pytest.raises(InputError, match="other pictures than its series"):
        read_biplane(tmp_path)


@pytest.mark.parametrize("turns", [True, False])
def test_both_planes_in_one_file(dicom_files, tmp_path, write_pair, turns):
    frames_a, frames_b = dicom_files.gray_frames(4), dicom_files.gray_frames(4, seed=1)
    path = dicom_files.write_both(tmp_path / "both" / "run.dcm", frames_a, frames_b, turns=turns)
    expected = read_biplane(*write_pair()).rigs[0]
    for given in (path, path.parent):
        acquisition = read_biplane(given)
        for index, pair in enumerate(acquisition):
            np.testing.assert_array_equal(pair.image_a, frames_a[index])
            np.testing.assert_array_equal(pair.image_b, frames_b[index])
        for one, other in (
            (acquisition.rigs[0].a, expected.a),
            (acquisition.rigs[0].b, expected.b),
        ):
            np.testing.assert_allclose(one.projection, other.projection, atol=1e-9)
        assert any("holds both planes" in note for note in acquisition.notes)
        step = 2 * 0.066667 if turns else 0.066667
        np.testing.assert_allclose(np.diff(acquisition.times), step)
    if turns:
        assert any("66.7 ms after plane A" in note for note in acquisition.notes)
    _, frames = acquisition.source_frames
    assert [frame.number for frame in frames] == ([1, 3, 5, 7] if turns else [4, 5, 6, 7])


def test_both_planes_in_one_enhanced_file(enhanced_dicom, dicom_files, tmp_path):
    frames = dicom_files.gray_frames(6)
    groups = [
        enhanced_dicom.groups(letter, angles)
        for letter, angles in (("A", (-30.0, 0.0)), ("B", (-10.0, 5.0)))
    ]
    path, spare = enhanced_dicom.write_enhanced_pair(
        tmp_path, frames, frames, a=groups * 3, PlaneIdentification="MONOPLANE"
    )
    spare.unlink()
    acquisition = read_biplane(path)
    np.testing.assert_array_equal(acquisition[1].image_b, frames[3])
    assert any("FrameType" in note for note in acquisition.notes)


def test_a_rotating_plane_is_not_taken_for_two(write_pair):
    turning = {
        "PositionerMotion": "DYNAMIC",
        "PositionerPrimaryAngleIncrement": ["0", "45", "90"],
        "PositionerSecondaryAngleIncrement": ["0", "0", "0"],
        "ImageType": ["ORIGINAL", "PRIMARY", "SINGLE PLANE"],
    }
    a, b = write_pair(a=turning)
    b.unlink()
    with pytest.raises(InputError, match="one plane only"):
        read_biplane(a)


def test_an_order_that_the_names_do_not_tell(dicom_files, tmp_path):
    """Files are put in order by their numbers: names and the disk say nothing."""
    paths = dicom_files.write_series(tmp_path, frames=3)
    first = pydicom.dcmread(paths[0]).InstanceNumber
    assert first == 1
    paths[0].rename(tmp_path / "z.dcm")
    assert grays(read_biplane(tmp_path)) == [(100, 200), (101, 201), (102, 202)]
