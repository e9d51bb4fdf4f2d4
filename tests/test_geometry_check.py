"""A header that cannot be right is told; a right one is not doubted; refining says what it did."""

import json
from dataclasses import replace

import numpy as np
import pydicom
import pytest

from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.cli import main
from stereosom_plugin.fluoroscopy import read_biplane
from stereosom_plugin.geometry_check import GeometryCheck, evenly, refine_geometry
from stereosom_plugin.segmentation import observe


@pytest.fixture(scope="module")
def sample_seen(sample):
    """What both views of the shipped study show."""
    return list(observe(read_biplane(sample)))


@pytest.fixture(scope="module")
def wrong_study(sample, tmp_path_factory):
    """The shipped study with another run's angle in the header of plane B."""
    folder = tmp_path_factory.mktemp("wrong")
    for plane, turn in (("a", 0), ("b", 25)):
        dataset = pydicom.dcmread(sample / f"plane_{plane}.dcm")
        dataset.PositionerSecondaryAngle = str(float(dataset.PositionerSecondaryAngle) + turn)
        dataset.save_as(folder / f"plane_{plane}.dcm")
    return folder


def watched(observations):
    check = GeometryCheck(range(len(observations)))
    for observation in observations:
        check.see(observation)
    return check


def lifted(rig, shift):
    """The rig if view b believed the isocenter `shift` mm nearer to the feet."""
    moved = np.eye(4)
    moved[2, 3] = shift
    camera = type(rig.b)(rig.b.projection @ moved, rig.b.image_size)
    return type(rig)(rig.a, camera, rig.frame)


def test_a_right_header_is_not_doubted(sample_seen):
    assert watched(sample_seen).warning() == ""


@pytest.mark.parametrize("shift", [-5.0, 5.0])
def test_an_isocenter_off_by_5_mm_is_told_in_px_and_mm(sample_seen, shift):
    """At 90 degrees between the views, 5 mm along the common axis are 5 mm across the lines."""
    wrong = [replace(one, rig=lifted(one.rig, shift)) for one in sample_seen]
    told = watched(wrong).warning()
    assert "--refine-geometry" in told
    assert 4.0 < float(told.split("(")[1].split(" mm")[0]) < 6.0


def test_what_was_not_seen_is_not_judged(sample_seen):
    nothing = np.zeros((0, 2))
    blind = [replace(one, pixels_a=nothing) for one in sample_seen]
    assert watched(blind).warning() == ""
    assert GeometryCheck(()).warning() == ""


def test_few_frames_are_kept_however_long_the_run():
    check = GeometryCheck(range(100_000))
    assert len(check._wanted) == 8
    assert evenly(range(3), 30) == [0, 1, 2]


def test_refining_takes_the_shift_away_and_says_so(sample):
    right = read_biplane(sample)
    wrong = replace(right, rigs=tuple(lifted(rig, 5.0) for rig in right.rigs))
    refined = refine_geometry(wrong, _default())
    between = [_between(one.rigs[0], right.rigs[0]) for one in (wrong, refined)]
    assert between[0] > 4.5
    assert between[1] < 1.0
    told = refined.notes[len(right.notes) :]
    assert len(told) == 3
    assert isinstance(refined, Acquisition)
    assert (refined.sources, refined.source_frames) == (right.sources, right.source_frames)
    assert "px before" in told[0]
    assert "plane A" in told[1]
    assert "plane B" in told[2]


def test_what_cannot_be_refined_stays_and_says_why(sample):
    right = read_biplane(sample)
    refined = refine_geometry(right, _default(), frames=[0])
    assert refined.rigs == right.rigs
    assert "was not refined" in refined.notes[-1]


def test_the_command_warns_or_refines_but_never_in_silence(wrong_study, tmp_path, capsys):
    call = ["fluoroscopy", str(wrong_study), "--frames", "0:6", "--output"]
    main([*call, str(tmp_path / "as_stated")])
    assert "cannot be right" in capsys.readouterr().err
    main([*call, str(tmp_path / "refined"), "--refine-geometry"])
    said = capsys.readouterr().err
    assert "geometry was refined" in said
    assert "cannot be right" not in said
    record = json.loads((tmp_path / "refined" / "run.json").read_text())
    assert record["options"]["refine_geometry"] is True
    assert any("geometry was refined" in note for note in record["notes"])


def _default():
    from stereosom_plugin.segmentation import segment_xray

    return segment_xray


def _between(rig, true):
    """How far apart the rays of both views pass that meet in the true rig, mm, at the tip."""
    point = np.array([[0.0, 0.0, 0.0]])
    rays = [
        (one.center, one.rays(other.project(point))[0])
        for one, other in ((rig.a, true.a), (rig.b, true.b))
    ]
    (from_a, along_a), (from_b, along_b) = rays
    normal = np.cross(along_a, along_b)
    return abs((from_b - from_a) @ normal) / np.linalg.norm(normal)
