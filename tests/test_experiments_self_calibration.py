"""The experiment on wrong headers: its own yardstick by hand, and one draw through its files."""

import csv

import numpy as np
import pytest

from stereosom.camera import Camera, StereoRig
from stereosom_plugin.experiments import self_calibration
from stereosom_plugin.fluoroscopy import read_biplane

SIZE = (1001, 1001)
K = [[1000, 0, 500], [0, 1000, 500], [0, 0, 1]]


def pair(lifted=0.0):
    """Two cameras 1000 mm from the origin, on x and on y; the second one `lifted` mm along z."""
    on_x = Camera.from_pose(K, [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], [0, 0, 1000], SIZE)
    on_y = Camera.from_pose(K, [[-1, 0, 0], [0, 0, -1], [0, -1, 0]], [0, lifted, 1000], SIZE)
    return StereoRig(on_x, on_y)


def test_3_mm_across_epipolar_lines_are_3_px_at_1_px_per_mm():
    true, wrong = pair(), pair(lifted=3.0)
    points = np.random.default_rng(0).uniform(-1, 1, (200, 3))
    assert self_calibration.epipolar_distance(true, true, points) == pytest.approx(0, abs=1e-9)
    assert self_calibration.epipolar_distance(wrong, true, points) == pytest.approx(3, rel=0.01)


def test_a_header_without_errors_is_the_study_s_own(sample, monkeypatch):
    for name in ("ANGLE_DEG", "ISOCENTER_MM", "DISTANCE"):
        monkeypatch.setattr(self_calibration, name, 0.0)
    rig = self_calibration.wrong_rig(sample, np.random.default_rng(0))
    (true,) = read_biplane(sample).rigs
    for view in "ab":
        np.testing.assert_allclose(
            getattr(rig, view).projection, getattr(true, view).projection, atol=1e-9
        )


def test_one_draw_of_the_shipped_study(sample, tmp_path, monkeypatch):
    study = self_calibration._study("sample", sample)
    monkeypatch.setattr(self_calibration, "_studies", lambda: [study])
    printed = self_calibration.run(tmp_path, draws=1)
    stated, refined = csv.DictReader((tmp_path / "self_calibration.csv").read_text().splitlines())
    assert (stated["header"], refined["header"]) == ("as stated", "refined")
    assert float(refined["epipolar_px"]) < 0.3 * float(stated["epipolar_px"])
    assert float(refined["shape_mm"]) < float(stated["shape_mm"])
    assert refined["epipolar_px"] in printed
