"""`stereosom fluoroscopy --describe`: what was understood, without a picture read."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stereosom_plugin.cli import main
from stereosom_plugin.fluoroscopy import describe_biplane
from stereosom_plugin.fluoroscopy.describe import angles_text


def described(capsys, *words):
    assert main(["fluoroscopy", "--describe", *map(str, words)]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    return printed.out


def axis(primary, secondary):
    """Direction to the detector in LPS: to the left, to the front, to the head."""
    primary, secondary = np.radians([primary, secondary])
    return [
        np.sin(primary) * np.cos(secondary),
        -np.cos(primary) * np.cos(secondary),
        np.sin(secondary),
    ]


@pytest.mark.parametrize(
    ("angles", "spelled"),
    [
        ((-30, 15), "RAO 30 / CRA 15"),
        ((45, -20), "LAO 45 / CAU 20"),
        ((0, 0), "LAO 0 / CRA 0"),
        ((-99.5, 3.25), "RAO 99.5 / CRA 3.2"),
    ],
)
def test_angles_as_clinicians_write_them(angles, spelled):
    assert angles_text(np.array([axis(*angles)])) == spelled


def test_angles_of_an_arm_that_moves():
    there = np.array([axis(primary, 10) for primary in (-30, 0, 30)])
    assert angles_text(there) == "RAO 30 to LAO 30 / CRA 10"
    assert angles_text(np.concatenate([there, there[::-1]])) == "RAO 30 to LAO 30 / CRA 10"


def test_a_plain_run(write_pair, capsys):
    a, b = write_pair(both={"PositionerSecondaryAngle": "15"})
    for given in ((a, b), (b, a), (a.parent,)):
        lines = described(capsys, *given)
        assert "plane A: plane_a.dcm\n  RAO 30 / CRA 15\n" in lines
        assert "source to detector 1100 mm, to isocenter 750 mm" in lines
        assert "32 × 24 pixels of 0.4 × 0.4 mm at the detector, 0.273 mm" in lines
        assert "3 frames in 0.133 s, 15.00 a second, from 10:15:00 on" in lines
        assert "pairs: 3, from frame 0 of plane A" in lines
        assert lines.endswith("nothing assumed\n")


def test_a_single_frame_has_no_rate(write_pair, dicom_files, capsys):
    one = dicom_files.gray_frames(1)
    lines = described(capsys, *write_pair(frames_a=one, frames_b=one))
    assert "  1 frame, from 10:15:00 on" in lines


def test_what_was_assumed_is_listed(write_pair, capsys):
    late = {"AcquisitionTime": "101500.040", "DistanceSourceToPatient": None}
    paths = write_pair(a={"AcquisitionTime": "101500.020"}, b=late)
    lines = described(capsys, *paths)
    assert "plane B was exposed 20.0 ms after plane A" in lines
    assert "  - plane B: DistanceSourceToPatient (0018,1111) is absent; 750.0 mm" in lines


def test_as_json(write_pair, capsys):
    told = json.loads(described(capsys, *write_pair(), "--json"))
    assert told["planes"]["B"]["angles"] == "LAO 60 / CRA 0"
    assert told["pairs"]["convergence_deg"] == [90.0, 90.0]
    assert told["notes"] == []


def test_no_picture_is_read(write_pair):
    """Compressed frames that no decoder could read do not matter."""
    a, b = write_pair()
    data = bytearray(a.read_bytes())
    data[-4000:] = bytes(4000)
    a.write_bytes(bytes(data))
    assert describe_biplane(a, b)["planes"]["A"]["frames"] == 3


def test_a_wrong_input_is_refused_in_one_line(write_pair, capsys):
    a, _ = write_pair()
    assert main(["fluoroscopy", "--describe", str(a)]) == 2
    assert "one plane only" in capsys.readouterr().err
    assert main(["fluoroscopy", str(a.parent)]) == 2
    assert "--output" in capsys.readouterr().err


def test_the_development_studies(shared_data, capsys):
    lines = described(capsys, shared_data / "biplane_xa" / "guidewire")
    assert "LAO 0 / CRA 20" in lines
    assert "LAO 90 / CRA 0" in lines
    assert lines.endswith("nothing assumed\n")
