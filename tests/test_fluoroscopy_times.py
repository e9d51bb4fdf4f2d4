"""When frames were taken, and which frames of both planes are paired."""

from __future__ import annotations

import numpy as np
import pytest

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane

VECTOR = {"FrameIncrementPointer": 0x00181065, "FrameTime": None}
NO_TIME = {"FrameTime": None, "FrameIncrementPointer": None}


def test_frame_time_is_in_milliseconds(write_pair):
    acquisition = read_biplane(*write_pair())
    np.testing.assert_allclose(acquisition.times, [0, 0.066667, 0.133334])
    assert acquisition.notes == ()


def test_frame_time_vector_holds_increments(write_pair):
    vector = VECTOR | {"FrameTimeVector": ["0", "100", "50"]}
    np.testing.assert_allclose(read_biplane(*write_pair(both=vector)).times, [0, 0.1, 0.15])


def test_pointer_chooses_between_both(write_pair):
    both = {"FrameTimeVector": ["0", "100", "50"], "FrameTime": "20"}
    to_vector = both | {"FrameIncrementPointer": 0x00181065}
    np.testing.assert_allclose(read_biplane(*write_pair("v", both=to_vector)).times, [0, 0.1, 0.15])
    np.testing.assert_allclose(read_biplane(*write_pair("t", both=both)).times, [0, 0.02, 0.04])


@pytest.mark.parametrize("keyword", ["CineRate", "RecommendedDisplayFrameRate"])
def test_a_rate_stands_in_and_is_noted(write_pair, keyword):
    acquisition = read_biplane(*write_pair(both=NO_TIME | {keyword: "20"}))
    np.testing.assert_allclose(acquisition.times, [0, 0.05, 0.1])
    assert keyword in acquisition.notes[0]


def test_no_time_and_no_rate_is_refused(write_pair):
    with pytest.raises(InputError, match="has no FrameTime"):
        read_biplane(*write_pair(both=NO_TIME))


@pytest.mark.parametrize("first", ["0", "40"])
def test_a_time_vector_of_zeros_tells_no_time(write_pair, first):
    zeros = VECTOR | {"FrameTimeVector": [first, "0", "0"]}
    acquisition = read_biplane(*write_pair("rate", both=zeros | {"CineRate": "20"}))
    np.testing.assert_allclose(acquisition.times, [0, 0.05, 0.1])
    assert "FrameTimeVector (0018,1065) is all zero; times follow" in acquisition.notes[0]
    with pytest.raises(InputError, match="has no FrameTime"):
        read_biplane(*write_pair("none", both=zeros))


@pytest.mark.parametrize("steps", [["0", "10"], ["40"], ["0", "10", "-5"]])
def test_a_torn_time_vector_is_refused(write_pair, steps):
    with pytest.raises(InputError, match="FrameTimeVector"):
        read_biplane(*write_pair(a=VECTOR | {"FrameTimeVector": steps}))


def test_one_frame_needs_no_time(write_pair, dicom_files):
    one = dicom_files.gray_frames(1)
    acquisition = read_biplane(*write_pair(frames_a=one, frames_b=one))
    assert acquisition.times.tolist() == [0]
    np.testing.assert_array_equal(acquisition[0].image_a, one[0])


def test_planes_of_different_length_are_paired_by_the_clock(write_pair, dicom_files):
    many, few = dicom_files.gray_frames(6), dicom_files.gray_frames(3, seed=1)
    steps = {"FrameTime": "100"}
    later = {"AcquisitionDateTime": "20260105101500.31+0100"} | steps
    first = {"AcquisitionDateTime": "20260105101500.1+0100"} | steps
    acquisition = read_biplane(*write_pair(frames_a=many, frames_b=few, a=first, b=later))
    np.testing.assert_allclose(acquisition.times, [0, 0.1, 0.2])
    np.testing.assert_array_equal(acquisition[0].image_a, many[2])
    np.testing.assert_array_equal(acquisition[2].image_b, few[2])
    assert "3 pairs" in acquisition.notes[0]


def test_planes_of_different_rate_are_paired_by_the_clock(write_pair, dicom_files):
    slow, fast = dicom_files.gray_frames(3), dicom_files.gray_frames(5, seed=1)
    acquisition = read_biplane(
        *write_pair(frames_a=slow, frames_b=fast, a={"FrameTime": "80"}, b={"FrameTime": "40"})
    )
    np.testing.assert_allclose(acquisition.times, [0, 0.08, 0.16])
    np.testing.assert_array_equal(acquisition[1].image_b, fast[2])


def test_a_moving_rig_follows_the_paired_frames(write_pair, dicom_files):
    turning = {
        "PositionerMotion": "DYNAMIC",
        "PositionerPrimaryAngleIncrement": [str(i) for i in range(5)],
        "PositionerSecondaryAngleIncrement": ["0"] * 5,
        "AcquisitionTime": "101500.0",
        "FrameTime": "100",
    }
    acquisition = read_biplane(
        *write_pair(
            a=turning,
            b={"AcquisitionTime": "101500.2", "FrameTime": "100"},
            frames_a=dicom_files.gray_frames(5),
            frames_b=dicom_files.gray_frames(3),
        )
    )
    axis = acquisition.rig(0).a.axis
    np.testing.assert_allclose(np.degrees(np.arctan2(axis[0], -axis[1])), -28)


def test_different_length_without_a_clock_is_refused(write_pair, dicom_files):
    with pytest.raises(InputError, match="4 and 3 frames") as raised:
        read_biplane(*write_pair(frames_a=dicom_files.gray_frames(4), b={"AcquisitionTime": None}))
    assert "\n" not in str(raised.value)


def test_runs_taken_at_different_times_are_refused(write_pair, dicom_files):
    with pytest.raises(InputError, match="not taken at one time"):
        read_biplane(
            *write_pair(frames_a=dicom_files.gray_frames(4), b={"AcquisitionTime": "111500"})
        )


def test_a_lag_between_planes_in_step_is_noted(write_pair):
    acquisition = read_biplane(*write_pair(b={"AcquisitionTime": "101501"}))
    assert len(acquisition) == 3
    assert "1.000 s apart" in acquisition.notes[0]
