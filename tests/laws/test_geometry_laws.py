"""Laws of the geometry, for every rig and point, on purpose also near the degenerate."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from stereosom.camera import Camera, StereoRig, triangulate
from stereosom.synthetic import converging_rig

# Down to a third of a degree between the views, where depth is all but lost.
angles = st.one_of(st.floats(0.3, 2), st.floats(2, 178))
rigs = st.builds(
    converging_rig, angles, distance=st.floats(50, 2000), focal_length=st.floats(300, 8000)
)
points = st.lists(st.tuples(*[st.floats(-20, 20)] * 3), min_size=1, max_size=8).map(
    lambda offsets: np.add(offsets, [0, 0, 75])
)
motions = st.tuples(st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-500, 500)] * 3))


def moved(rig, rotation, shift):
    """The rig after every world point went x -> R x + t."""
    back = np.eye(4)
    back[:3, :3], back[:3, 3] = rotation.T, -rotation.T @ shift
    return StereoRig(
        *(Camera(camera.projection @ back, camera.image_size) for camera in (rig.a, rig.b))
    )


@given(rigs, points)
def test_projecting_and_triangulating_are_inverse(rig, world):
    again = triangulate(rig, rig.a.project(world), rig.b.project(world))
    # Rounding of pixels, about 1e-12 of their value, grows with depth over baseline.
    weak = 1 / np.sin(np.radians(min(rig.convergence_deg, 180 - rig.convergence_deg)))
    assert np.abs(again - world).max() < 1e-8 * weak


@given(rigs, points)
def test_pictures_of_a_point_satisfy_the_epipolar_constraint(rig, world):
    in_a, in_b = (
        np.column_stack([camera.project(world), np.ones(len(world))]) for camera in (rig.a, rig.b)
    )
    assert np.abs(np.sum(in_b * (in_a @ rig.fundamental.T), axis=1)).max() < 1e-9


@given(rigs, points, motions)
def test_moving_the_world_moves_what_is_triangulated(rig, world, motion):
    rotation, shift = Rotation.from_rotvec(motion[0]).as_matrix(), np.array(motion[1])
    there = moved(rig, rotation, shift)
    in_a, in_b = rig.a.project(world), rig.b.project(world)
    assert there.a.project(world @ rotation.T + shift) == pytest.approx(in_a, abs=1e-5)
    weak = 1 / np.sin(np.radians(min(rig.convergence_deg, 180 - rig.convergence_deg)))
    again = triangulate(there, in_a, in_b)
    assert np.abs(again - (triangulate(rig, in_a, in_b) @ rotation.T + shift)).max() < 1e-6 * weak


@given(rigs, points)
def test_swapping_the_views_changes_nothing_in_space(rig, world):
    in_a, in_b = rig.a.project(world) + 0.3, rig.b.project(world) - 0.2
    swapped = StereoRig(rig.b, rig.a)
    assert triangulate(swapped, in_b, in_a) == pytest.approx(
        triangulate(rig, in_a, in_b), abs=1e-6, rel=1e-6
    )
    assert pytest.approx(-rig.fundamental, abs=1e-12) == swapped.fundamental.T or (
        pytest.approx(rig.fundamental, abs=1e-12) == swapped.fundamental.T
    )


@settings(max_examples=30)
@given(rigs, points)
def test_intrinsics_do_not_matter_in_normalized_rays(rig, world):
    for camera in (rig.a, rig.b):
        rays = camera.rays(camera.project(world))
        toward = world - camera.center
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        assert rays == pytest.approx(toward, abs=1e-9)
