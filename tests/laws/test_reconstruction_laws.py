"""What no reconstruction may depend on: the order of pixels, of views, the world's axes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stereosom import Camera, Observation, StereoRig, reconstruct
from stereosom.synthetic import arc, converging_rig, growing_helix, observe

SHAPES = st.sampled_from([arc(60, 90), arc(40, 150), growing_helix(100, 80, 0.75)])
few = settings(max_examples=6, deadline=None)


METHODS = st.sampled_from(["joint-spline", "stereo-som"])


def curve_of(observation, method):
    result = reconstruct(observation, method=method)
    assert result.ok, result.reason
    return result.backbone.sample(50)


@few
@given(SHAPES, METHODS, st.integers(0, 1000))
def test_the_order_of_pixels_means_nothing(shape, method, seed):
    seen, rng = observe(shape, 1.0, converging_rig(60)), np.random.default_rng(seed)
    shuffled = replace(
        seen, pixels_a=rng.permutation(seen.pixels_a), pixels_b=rng.permutation(seen.pixels_b)
    )
    assert curve_of(shuffled, method) == pytest.approx(curve_of(seen, method), abs=1e-6)


@few
@given(SHAPES, METHODS)
def test_swapping_the_views_means_nothing(shape, method):
    seen = observe(shape, 1.0, converging_rig(60))
    rig = StereoRig(seen.rig.b, seen.rig.a)
    swapped = Observation(seen.pixels_b, seen.pixels_a, rig)
    assert curve_of(swapped, method) == pytest.approx(curve_of(seen, method), abs=0.02)


@few
@given(SHAPES, METHODS, st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-300, 300)] * 3))
def test_moving_the_world_moves_the_curve(shape, method, turn, shift):
    seen = observe(shape, 1.0, converging_rig(60))
    rotation = Rotation.from_rotvec(turn).as_matrix()
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = rotation.T, -rotation.T @ shift
    rig = StereoRig(
        *(Camera(view.projection @ back, view.image_size) for view in (seen.rig.a, seen.rig.b))
    )
    moved = Observation(seen.pixels_a, seen.pixels_b, rig)
    assert curve_of(moved, method) == pytest.approx(
        curve_of(seen, method) @ rotation.T + shift, abs=1e-2
    )
