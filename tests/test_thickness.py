"""Before two eyes that stand close together, a device keeps the thickness of its clear frames."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from stereosom import Observation, StereoRig, track
from stereosom.backbone import Backbone
from stereosom.camera import Camera
from stereosom.reconstruct import METHODS
from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import converging_rig
from stereosom.thickness import SAID, Thickness

LINE = Backbone.through(np.array([[-20.0, 0, 60], [0, 0, 60], [20, 0, 60]]))
K = [[560.0, 0, 320], [0, 560, 180], [0, 0, 1]]
LEFT = Camera.from_pose(K, np.eye(3), [0, 0, 0], (640, 360))
EYES = StereoRig(LEFT, Camera.from_pose(K, np.eye(3), [-5, 0, 0], (640, 360)))


def frame(radius, sigma, index=0):
    """A result whose depth, along z, is known to sigma mm."""
    covariance = np.tile(np.diag([1e-4, 1e-4, sigma**2]), (100, 1, 1))
    return Reconstruction(
        index, float(index), "ok", backbone=LINE, covariance=covariance, residuals=(0.1, 0.1),
        radius=radius,
    )  # fmt: skip


def test_clear_frames_count_more():
    thickness = Thickness().after(frame(1.0, 1.0), EYES).after(frame(1.3, 10.0), EYES)
    assert thickness.radius == pytest.approx(1.003, abs=0.001)
    assert thickness.share == pytest.approx(1 / 60, rel=0.1)  # 1 mm of depth at 60 mm and more


def test_a_frame_that_leaves_depth_open_is_fitted_with_what_is_known():
    thickness = Thickness()
    for _ in range(5):
        thickness = thickness.after(frame(1.0, 1.0), EYES)
    asked = []

    def fit(radius):
        asked.append(radius)
        return frame(radius, 0.2)

    found = thickness.settled(frame(1.6, 8.0), EYES, fit)
    assert asked == [pytest.approx(1.0)]
    assert found.reason == SAID
    # What is known of the thickness, 1.5 %, is known of depth: 0.9 mm at 60 mm, beside the fit's.
    middle = found.covariance_at(np.array([LINE.length / 2]))[0]
    assert np.sqrt(middle[2, 2]) == pytest.approx(np.hypot(0.2, 0.9), rel=0.05)


def test_clear_frames_and_planes_across_are_left_alone():
    thickness = Thickness(1.0, 1e4)

    def never(_):
        raise AssertionError

    clear, unclear = frame(1.1, 1.0), frame(1.1, 8.0)
    assert thickness.settled(clear, EYES, never) is clear
    assert thickness.settled(unclear, converging_rig(60), never) is unclear
    assert Thickness().settled(unclear, EYES, never) is unclear  # nothing is known yet


def test_a_run_carries_the_thickness_along(monkeypatch):
    """A method that, left alone, takes a device to be ever thicker, and farther away."""

    def drifting(observation, *, options):
        known = options.prior.radius
        made = frame(
            known or 1.0 + 0.2 * observation.index, 0.5 if known else 1.0, observation.index
        )
        return (
            made
            if known or observation.index < 3
            else replace(made, covariance=100 * made.covariance)
        )

    pixels = LEFT.project(LINE.sample(200))
    seen = (Observation(pixels, pixels, EYES, time=k / 20, index=k) for k in range(8))
    module = sys.modules["stereosom.reconstruct"]  # its name is that of a function, too
    monkeypatch.setattr(module, "METHODS", {**METHODS, "drifting": drifting})
    results = list(track(seen, method="drifting"))
    assert [result.reason == SAID for result in results] == [False] * 3 + [True] * 5
    assert max(result.radius for result in results) < 1.5


def test_planes_across_need_no_thickness_and_do_not_wait_for_one():
    assert Thickness().after(frame(1.0, 1.0), converging_rig(60)) == Thickness()
