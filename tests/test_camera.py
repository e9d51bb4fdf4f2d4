import numpy as np
import pytest

from stereosom.camera import Camera, StereoRig, triangulate
from stereosom.synthetic import converging_rig

K = np.array([[1000.0, 0, 320], [0, 1000, 240], [0, 0, 1]])
SIZE = (640, 480)
AHEAD = np.column_stack([K, K @ [0, 0, 500]])  # looks along z from 500 mm before the origin


def test_a_point_on_the_axis_falls_on_the_principal_point_at_its_depth():
    camera = Camera(AHEAD, SIZE)
    assert camera.project([[0, 0, 0]]) == pytest.approx(np.array([[320, 240]]))
    assert camera.depth([[0, 0, 100]]) == pytest.approx([600])
    assert camera.center == pytest.approx([0, 0, -500])
    assert camera.axis == pytest.approx([0, 0, 1])
    assert camera.focal_length == pytest.approx(1000)
    # one pixel at 500 mm with a focal length of 1000 px
    assert camera.pixel_size([[0, 0, 0]]) == pytest.approx([0.5])


def test_scale_of_the_matrix_means_nothing_its_sign_says_where_front_is():
    assert Camera(7 * AHEAD, SIZE).depth([[0, 0, 0]]) == pytest.approx([500])
    assert Camera(-AHEAD, SIZE).depth([[0, 0, 0]]) == pytest.approx([-500])
    assert Camera(-AHEAD, SIZE).project([[3, 4, 5]]) == pytest.approx(
        Camera(AHEAD, SIZE).project([[3, 4, 5]])
    )


def test_jacobian_is_the_derivative_of_the_projection():
    camera, point, step = Camera(AHEAD, SIZE), np.array([12.0, -7.0, 30.0]), 1e-4
    moved = point + step * np.vstack([np.eye(3), -np.eye(3)])
    plus, minus = np.split(camera.project(moved), 2)
    assert camera.jacobian(point[None])[0] == pytest.approx(((plus - minus) / (2 * step)).T)


def test_fundamental_matrix_of_a_pure_shift_compares_rows():
    # Two eyes 5 mm apart along x: corresponding pixels share their row.
    left = Camera.from_pose(K, np.eye(3), [0, 0, 0], SIZE)
    right = Camera.from_pose(K, np.eye(3), [-5, 0, 0], SIZE)
    f = StereoRig(left, right).fundamental
    same_row = np.array([100, 77, 1]) @ f @ np.array([400, 77, 1])
    row_below = np.array([100, 78, 1]) @ f @ np.array([400, 77, 1])
    assert same_row == pytest.approx(0, abs=1e-15)
    assert abs(row_below) == pytest.approx(1 / 1000)  # a pixel over the focal length


def test_corresponding_pixels_lie_at_the_same_epipolar_angle():
    rig, points = converging_rig(70), np.array([[5.0, -9, 40], [-20, 3, 110], [0, 0, 75]])
    angle_a = rig.epipolar_angle(rig.a, rig.a.project(points))
    angle_b = rig.epipolar_angle(rig.b, rig.b.project(points))
    assert angle_a == pytest.approx(angle_b)
    assert angle_a[2] == pytest.approx(0)  # both axes meet there


def test_epipolar_line_separates_smaller_from_larger_angles():
    rig = converging_rig(70)
    pixels = np.array([[500.0, 300], [500, 500], [700, 200]])
    angles = rig.epipolar_angle(rig.b, pixels)
    line = rig.epipolar_line(rig.b, angles[0])
    side = pixels @ line[:2] + line[2]
    assert side[0] == pytest.approx(0, abs=1e-12)
    assert np.sign(side[1:]) == pytest.approx(np.sign(angles[1:] - angles[0]))


@pytest.mark.parametrize(("sign_a", "sign_b"), [(1, 1), (-1, -1), (1, -1), (-1, 1)])
def test_signs_of_a_file_are_mended_so_that_the_shared_field_is_in_front(sign_a, sign_b):
    rig = converging_rig(45)
    mended = StereoRig.from_projections(
        sign_a * rig.a.projection, sign_b * rig.b.projection, rig.a.image_size, rig.b.image_size
    )
    assert mended.a.depth([[0, 0, 75]]) == pytest.approx([700])
    assert mended.b.depth([[0, 0, 75]]) == pytest.approx([700])


def test_parallel_eyes_keep_the_signs_that_were_given():
    left = Camera.from_pose(K, np.eye(3), [0, 0, 0], SIZE)
    right = Camera.from_pose(K, np.eye(3), [-5, 0, 0], SIZE)
    rig = StereoRig.from_projections(left.projection, right.projection, SIZE, SIZE)
    assert rig.a.axis == pytest.approx([0, 0, 1])


def test_a_mirroring_matrix_is_a_camera_like_any_other():
    mirrored = np.diag([-1.0, 1, 1]) @ K @ np.column_stack([np.eye(3), [0, 0, 500]])
    camera = Camera(mirrored, SIZE)
    assert np.linalg.det(camera.projection[:, :3]) < 0
    assert camera.depth([[0, 0, 0]]) == pytest.approx([500])


@pytest.mark.parametrize(
    ("projection", "size", "says"),
    [
        (np.eye(3), SIZE, "must be 3×4, is 3×3"),
        (np.zeros((3, 4)), SIZE, "singular"),
        (np.column_stack([np.eye(3), [0, np.nan, 0]]), SIZE, "not finite"),
        (np.vstack([AHEAD[:2], [0, 0, 0, 1]]), SIZE, "singular"),  # an orthographic view
        (AHEAD, (640, 0), "positive whole"),
        (AHEAD, (640.5, 480), "positive whole"),
        (AHEAD, 640, "not \\(width, height\\)"),
    ],
)
def test_what_is_no_camera_is_refused(projection, size, says):
    with pytest.raises(ValueError, match=says):
        Camera(projection, size)


def test_cameras_in_one_place_are_no_rig():
    turned = Camera.from_pose(K, np.diag([-1.0, -1, 1]), [0, 0, 500], SIZE)
    with pytest.raises(ValueError, match="same place"):
        StereoRig(Camera(AHEAD, SIZE), turned)


def test_parallel_rays_are_not_triangulated():
    left = Camera.from_pose(K, np.eye(3), [0, 0, 0], SIZE)
    right = Camera.from_pose(K, np.eye(3), [-5, 0, 0], SIZE)
    with pytest.raises(ValueError, match="parallel"):
        triangulate(StereoRig(left, right), [[320, 240]], [[320, 240]])
