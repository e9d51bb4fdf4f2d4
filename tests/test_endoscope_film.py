"""The film that ships: a cannula before two eyes that stand 5 mm apart, its backbone known."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import stereosom
from stereosom.metrics import closest_on_curve

pytest.importorskip("cv2")
pytest.importorskip("av")
from stereosom_plugin import render, segmentation
from stereosom_plugin.ahead import ahead
from stereosom_plugin.cli import main
from stereosom_plugin.endoscopy import read_stereo
from stereosom_plugin.endoscopy.film import Film
from stereosom_plugin.errors import InputError
from stereosom_plugin.evaluation import evaluate, read_truth
from stereosom_plugin.segmentation.endoscope import segmenter

FILM = Path(__file__).parent.parent / "data" / "endoscope"
WORKING_DISTANCE = 60.0  # mm


def tracked(frames, **way):
    acquisition = read_stereo(FILM / "left.mp4", FILM / "right.mp4", FILM / "calibration.yaml")
    if "color_box" in way:
        way["example"] = acquisition.read(0)[0]
    seen = segmentation.observe(acquisition, segmenter(**way), frames=frames)
    return list(stereosom.track(seen))


def errors(result):
    """Distance of points along a curve from the true one: in depth and across it, (n,) mm."""
    truth = read_truth(FILM / f"truth_{result.index:03d}.csv")
    points = result.backbone.sample(200)
    _, at = closest_on_curve(points, truth)
    off = points - truth(at)
    return np.abs(off[:, 2]), np.hypot(off[:, 0], off[:, 1])


@pytest.fixture(scope="module")
def few():
    return tracked(range(4))


def test_depth_is_right_to_a_hundredth_of_the_working_distance(few):
    depth, across = zip(*map(errors, few), strict=True)
    assert np.mean(depth) < 0.01 * WORKING_DISTANCE
    assert np.mean(across) < 0.3


def test_what_is_said_of_the_certainty_is_that_depth_is_weak(few):
    """Eyes 5 mm apart at 60 mm: depth is known over twelve times less well than what lies
    across, and the standard deviation, which is that of the worst direction, is depth's."""
    for result in few:
        s = np.linspace(0.2, 0.8, 7) * result.backbone.length
        covariance = result.covariance_at(s)
        in_depth = np.sqrt(covariance[:, 2, 2])
        beside = np.cross(result.backbone.tangent(s), [0.0, 0.0, 1.0])
        beside /= np.linalg.norm(beside, axis=1, keepdims=True)
        across = np.sqrt(np.einsum("ni,nij,nj->n", beside, covariance, beside))
        assert np.median(in_depth / across) > 12
        assert np.all(result.standard_deviation_at(s) > 0.8 * in_depth)
        depth, _ = errors(result)
        # What it says is not far from what is: neither ten times less nor ten times more.
        assert 0.1 < np.median(result.standard_deviation_at(s)) / np.mean(depth) < 10


def test_both_eyes_see_the_tip_at_the_same_place_of_the_device():
    """A pixel between them is some millimetres in depth."""
    acquisition = read_stereo(FILM / "left.mp4", FILM / "right.mp4", FILM / "calibration.yaml")
    apart = []
    for seen in segmentation.observe(acquisition, segmenter(), frames=range(16)):
        truth = read_truth(FILM / f"truth_{seen.index:03d}.csv")
        ahead_of_tip = []
        for camera, pixels in ((seen.rig.a, seen.pixels_a), (seen.rig.b, seen.pixels_b)):
            before, tip = camera.project(truth([truth.length - 3, truth.length]))
            along = (tip - before) / np.linalg.norm(tip - before)
            beside = (pixels - tip) @ [-along[1], along[0]]
            ahead_of_tip.append(np.sort((pixels - tip)[np.abs(beside) < 4] @ along)[-8:].mean())
        apart.append(ahead_of_tip[0] - ahead_of_tip[1])
    assert np.std(apart) < 0.5


def test_its_thickness_is_that_of_the_device(few):
    """A hundredth wider is a hundredth nearer, where width alone tells depth."""
    assert np.mean([result.radius for result in few]) == pytest.approx(1.0, abs=0.01)


def test_a_tip_is_where_it_is_and_no_less_sure_than_that():
    """Seen nearly end-on, a round tip can be taken for a bend along the line of sight."""
    for result in tracked(range(10, 14)):
        truth = read_truth(FILM / f"truth_{result.index:03d}.csv")
        assert np.linalg.norm(result.backbone.tip - truth.tip) < 2
        assert 0.2 < result.standard_deviation_at([result.backbone.length])[0] < 2


def test_a_box_on_the_device_does_as_well(few):
    box = tracked(range(2), color_box=(400, 215, 30, 20))
    for one, other in zip(few, box, strict=False):
        assert np.mean(errors(other)[0]) < 0.02 * WORKING_DISTANCE
        assert other.backbone.length == pytest.approx(one.backbone.length, rel=0.1)


def test_a_film_that_was_begun_goes_on_in_another_process():
    """Decoder and OpenCV have threads here that a copy of the process lacks."""
    acquisition = read_stereo(FILM / "left.mp4", FILM / "right.mp4", FILM / "calibration.yaml")
    here = list(segmentation.observe(acquisition, segmenter(), frames=range(3)))
    there = list(ahead(segmentation.observe(acquisition, segmenter(), frames=range(3))))
    for one, other in zip(here, there, strict=True):
        assert np.array_equal(one.pixels_a, other.pixels_a)
        assert np.array_equal(one.pixels_b, other.pixels_b)
    assert np.array_equal(acquisition.read(3)[0], acquisition.read(3)[0])  # and here, too


def test_a_copy_of_the_process_decodes_frame_by_frame():
    """Both processes have work for a processor each: decoding side by side costs a tenth more."""
    film = Film(FILM / "left.mp4")

    def ways():
        film.frame(0)
        yield film._stream.thread_type.name

    assert next(ways()) == "AUTO"
    (there,) = ahead(ways())
    if hasattr(os, "sched_getaffinity") and len(os.sched_getaffinity(0)) > 1:
        assert there == "SLICE"


def test_exchanged_eyes_are_noticed_though_the_tissue_is_faint():
    with pytest.raises(InputError, match="left and right are exchanged"):
        read_stereo(FILM / "right.mp4", FILM / "left.mp4", FILM / "calibration.yaml")
    as_given = read_stereo(FILM / "left.mp4", FILM / "right.mp4", FILM / "calibration.yaml")
    assert not as_given.notes


def test_the_overlay_goes_through_the_lens_of_its_eye(tmp_path, monkeypatch):
    out, made, drawn = tmp_path / "out", render.Overlay.of, []
    call = [FILM / "left.mp4", FILM / "right.mp4", "--rig", FILM / "calibration.yaml"]
    words = ["endoscopy", *map(str, call), "--frames", "10:11", "--output", str(out), "--quiet"]
    assert main(words) == 0

    def watched(*described):
        drawn.append(made(*described))
        return drawn[-1]

    monkeypatch.setattr(render.Overlay, "of", watched)
    picture = str(tmp_path / "over.png")
    assert main(["render", str(out), "--overlay", "both", "--output", picture]) == 0
    focal_lengths = [over.lens.intrinsics[0, 0] for over in drawn]
    assert focal_lengths == [560.0, 562.1]  # the left eye's, and the right one's
    # Where OpenCV shows the true tip to the left eye, from which all is measured.
    cv2 = pytest.importorskip("cv2")
    tip, lens = read_truth(FILM / "truth_010.csv").tip, drawn[0].lens
    shown, _ = cv2.projectPoints(
        tip.reshape(1, 1, 3), np.zeros(3), np.zeros(3), lens.intrinsics, lens.coefficients
    )
    assert drawn[0].seen(drawn[0].camera.project(drawn[0].points))[-1] == pytest.approx(
        shown.ravel(), abs=4
    )


@pytest.mark.slow
def test_the_whole_film_from_the_command_line(tmp_path):
    out = tmp_path / "out"
    call = [FILM / "left.mp4", FILM / "right.mp4", "--rig", FILM / "calibration.yaml"]
    assert main(["endoscopy", *map(str, call), "--output", str(out)]) == 0
    frames = evaluate(out, FILM)
    assert len(frames) == 40
    # Distance is that from the curve, ends are compared with the true ones.
    assert np.mean([frame.distance for frame in frames]) < 0.01 * WORKING_DISTANCE
    assert max(frame.distance for frame in frames) < 0.02 * WORKING_DISTANCE
    assert min(frame.covered for frame in frames) > 0.95
    assert max(frame.tip for frame in frames) < 0.035 * WORKING_DISTANCE
    assert np.mean([frame.tip for frame in frames]) < 0.013 * WORKING_DISTANCE
    film = tmp_path / "film.mp4"
    assert main(["render", str(out), "--output", str(film), "--overlay", "both"]) == 0
    assert film.stat().st_size > 10_000
