"""Lenses: numbers worked out by hand, OpenCV as an oracle, and that both ways are inverse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereosom import StereoRig
from stereosom.camera import Camera
from stereosom_plugin import segmentation
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.lens import (
    FisheyeLens,
    IntensifierLens,
    RadialTangentialLens,
    cells,
    undistorted_field,
    undistorted_mask_pixels,
)
from stereosom_plugin.lens import mask as undistorting

K = np.array([[900.0, 0, 630], [0, 910, 500], [0, 0, 1]])
# k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau x, tau y
ALL = [-0.3, 0.1, 2e-3, -3e-3, -0.02, 0.01, 5e-3, 1e-3, 1e-3, -5e-4, 7e-4, 3e-4, 0.01, -0.02]


def test_radial_and_tangential_terms_by_hand():
    # Ray (0.1, 0.2): r² = 0.05; radial 1 − 0.01 + 0.05·0.0025 + 0.01·0.000125 = 0.99012625.
    # x: 0.099012625 + 2·0.001·0.02 − 0.002·(0.05 + 0.02) = 0.098912625
    # y: 0.19802525 + 0.001·(0.05 + 0.08) − 2·0.002·0.02 = 0.19807525
    lens = RadialTangentialLens(
        [[1000, 0, 320], [0, 1000, 240], [0, 0, 1]], [-0.2, 0.05, 0.001, -0.002, 0.01]
    )
    assert lens.distort([[420, 440]])[0] == pytest.approx([418.912625, 438.07525], abs=1e-9)


def test_fisheye_by_hand():
    # 45° = 0.785398 rad, θ² = 0.616850: shown at 0.785398 · (1 + 0.1 · 0.616850) focal lengths.
    lens = FisheyeLens([[1000, 0, 0], [0, 1000, 0], [0, 0, 1]], [0.1, 0, 0, 0])
    assert lens.distort([[1000, 0]])[0] == pytest.approx([833.8454, 0], abs=1e-3)


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_opencv_distorts_alike(count):
    cv2 = pytest.importorskip("cv2")
    pixels = np.random.default_rng(0).uniform([100, 100], [1100, 900], (200, 2))
    rays = np.column_stack([(pixels - K[:2, 2]) / [900, 910], np.ones(200)])
    wanted = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, np.array(ALL[:count]))[0]
    lens = RadialTangentialLens(K, ALL[:count])
    assert lens.distort(pixels) == pytest.approx(wanted[:, 0], abs=1e-8)


def test_opencv_fisheye_distorts_alike():
    cv2 = pytest.importorskip("cv2")
    k = np.array([0.02, -0.01, 0.003, -5e-4])
    pixels = np.random.default_rng(0).uniform([-900, -900], [2000, 2000], (200, 2))
    rays = (pixels - K[:2, 2]) / [900, 910]
    wanted = cv2.fisheye.distortPoints(rays[:, None], K, k)[:, 0]
    assert FisheyeLens(K, k).distort(pixels) == pytest.approx(wanted, abs=1e-8)


@settings(max_examples=40, deadline=None)
@given(
    st.sampled_from([4, 5, 8, 12, 14]),
    st.lists(st.floats(-1, 1), min_size=14, max_size=14),
    st.floats(0, 1280),
    st.floats(0, 1000),
)
def test_where_a_pixel_can_be_undistorted_it_comes_back(count, share, x, y):
    coefficients = np.array(share) * [
        0.5,
        0.5,
        0.02,
        0.02,
        0.5,
        0.1,
        0.1,
        0.1,
        *[0.01] * 4,
        0.1,
        0.1,
    ]
    lens = RadialTangentialLens(K, coefficients[:count])
    ideal = lens.undistort_where_defined([[x, y]])
    if np.isfinite(ideal).all():
        assert lens.distort(ideal)[0] == pytest.approx([x, y], abs=1e-6)


def test_beyond_the_fold_nothing_is_undistorted():
    # r (1 − 0.5 r²) has its greatest value at r² = 2/3: 0.5443. Nothing is shown at 0.6.
    lens = RadialTangentialLens([[100, 0, 0], [0, 100, 0], [0, 0, 1]], [-0.5, 0, 0, 0])
    assert lens.undistort([[54.4, 0]])[0, 0] < np.sqrt(2 / 3) * 100
    with pytest.raises(ValueError, match=r"1 of 2 pixels cannot be undistorted.*60\.0, 0\.0"):
        lens.undistort([[10, 0], [60, 0]])
    with pytest.raises(ValueError, match="cannot be distorted"):
        lens.distort([[90, 0]])


def test_a_fisheye_refuses_what_lies_beside_the_camera():
    lens = FisheyeLens([[100, 0, 0], [0, 100, 0], [0, 0, 1]], [0, 0, 0, 0])
    with pytest.raises(ValueError, match="cannot be undistorted"):
        lens.undistort([[160, 0]])  # 1.6 rad is more than 90°


@pytest.mark.parametrize("coefficients", [[1, 2, 3], [0] * 6, [np.nan] * 5, "abcd"])
def test_wrong_coefficients_are_refused(coefficients):
    with pytest.raises(ValueError, match="distortion"):
        RadialTangentialLens(K, coefficients)


def twisted(points):
    """A pincushion and an S, as an image intensifier shows a grid; not a polynomial."""
    offset = (points - 512) / 512
    angle = 0.02 * np.sin(1.5 * np.sum(offset**2, axis=1))
    out = offset * (1 + 0.05 * np.sum(offset**2, axis=1))[:, None]
    turned = np.column_stack(
        [
            np.cos(angle) * out[:, 0] - np.sin(angle) * out[:, 1],
            np.sin(angle) * out[:, 0] + np.cos(angle) * out[:, 1],
        ]
    )
    return 512 + 480 * turned


def bead_grid():
    side = np.arange(20.0, 1005.0, 15.0)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def test_an_intensifier_is_learned_from_its_grid_and_right_between_the_beads():
    grid = bead_grid()
    lens = IntensifierLens.fitted(twisted(grid), grid)
    between = np.random.default_rng(0).uniform(30, 990, (500, 2))
    assert np.abs(lens.undistort(twisted(between)) - between).max() < 0.1
    assert lens.distort(lens.undistort(between)) == pytest.approx(between, abs=1e-6)
    with pytest.raises(ValueError, match="cannot be undistorted"):
        lens.undistort([[1500, 500]])


@pytest.mark.parametrize(
    ("seen", "true", "says"),
    [
        (np.zeros((10, 2)), np.zeros((10, 2)), "at least"),
        (np.zeros((100, 2)), np.zeros((100, 2)), "on a line"),
        (bead_grid(), bead_grid()[1:], "references"),
        (np.repeat([[1, 2], [5, 7], [9, 3]], 40, axis=0), np.zeros((120, 2)), "do not spread"),
    ],
)
def test_a_grid_that_shows_no_distortion_map_is_refused(seen, true, says):
    with pytest.raises(ValueError, match=says):
        IntensifierLens.fitted(seen, true)


# ---- the device's pixels -------------------------------------------------------------

BARREL = RadialTangentialLens(K, [-0.25, 0.08, 0, 0, 0])
PINCUSHION = RadialTangentialLens(K, [0.2, -0.02, 2e-3, -3e-3, 0])


def seen_disc(lens, center, radius, size=(1280, 1000)):
    """Mask, as the lens shows it, of a disc in the ideal picture."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    ideal = lens.undistort(np.column_stack([x.ravel(), y.ravel()]).astype(float))
    inside = np.linalg.norm(ideal - center, axis=1) <= radius
    return inside.reshape(size[::-1])


def test_a_mask_is_undistorted_without_holes_and_to_its_true_size():
    mask = seen_disc(BARREL, (150, 120), 40)
    pixels = undistorted_mask_pixels(mask, BARREL)
    assert len(np.unique(pixels, axis=0)) == len(pixels)
    assert len(pixels) == pytest.approx(np.pi * 40**2, rel=0.01)
    assert pixels.mean(axis=0) == pytest.approx([150, 120], abs=0.1)
    assert np.linalg.norm(pixels - [150, 120], axis=1).max() < 41.5


@pytest.mark.parametrize("kind", ["compiled", "reference"])
@pytest.mark.parametrize("lens", [BARREL, PINCUSHION], ids=["barrel", "pincushion"])
def test_a_mask_is_undistorted_by_cells_as_pixel_by_pixel(lens, kind, monkeypatch):
    loops = pytest.importorskip(f"stereosom_plugin.lens.loops.{kind}")
    monkeypatch.setattr(cells, "loops", lambda: loops)
    row, column = np.indices((1000, 1280))
    away = np.hypot(column - 500, row - 700)
    ring = (away > 280) & (away < 330)  # it leaves the picture below, and has a hole
    thin = np.abs(column - 1200 - 30 * np.sin(row / 40)) < 1
    specks = np.random.default_rng(5).random(ring.shape) > 0.9995
    all_of_them = ring | thin | specks
    for mask in (ring, thin, specks, all_of_them, all_of_them[:997, :1275]):
        by_cells = cells.cells_of(lens, mask.shape).undistorted(mask)
        assert by_cells is not None
        assert np.array_equal(by_cells, undistorting._by_pixels(mask, lens))


def test_from_frame_to_frame_a_lens_is_asked_no_more(monkeypatch):
    lens = RadialTangentialLens(K, [-0.25, 0.08, 0, 0, 0])
    first, second = (seen_disc(lens, (x, 200), 30) for x in (300, 600))
    undistorted_mask_pixels(first, lens)
    monkeypatch.delattr(RadialTangentialLens, "_bend")
    pixels = undistorted_mask_pixels(second, lens)
    assert pixels.mean(axis=0) == pytest.approx([600, 200], abs=0.2)


def test_an_empty_mask_has_no_pixels():
    assert undistorted_mask_pixels(np.zeros((10, 10), dtype=bool), BARREL).shape == (0, 2)


def rig():
    size = (1280, 1000)
    left = Camera.from_pose(K, np.eye(3), [0, 0, 0], size)
    return StereoRig(left, Camera.from_pose(K, np.eye(3), [-5, 0, 0], size))


def test_observations_are_free_of_distortion_and_drawing_goes_back():
    masks = tuple(seen_disc(BARREL, (x, 200), 30) for x in (300, 240))
    acquisition = Acquisition(lambda _: masks, (rig(),), [0.0], lenses=(BARREL, BARREL))
    (seen,) = segmentation.observe(acquisition, lambda mask: mask)
    # Where two lattices of pixels meet, the middle of a disc moves by a tenth of a pixel or two.
    assert seen.pixels_a.mean(axis=0) == pytest.approx([300, 200], abs=0.3)
    assert seen.pixels_b.mean(axis=0) == pytest.approx([240, 200], abs=0.3)
    row, column = np.nonzero(masks[0])
    drawn = acquisition.seen("a", np.array([[300.0, 200.0]]))[0]
    assert drawn == pytest.approx([column.mean(), row.mean()], abs=0.5)


def test_the_border_that_a_device_crosses_stays_a_border():
    """A lens bends the left side of the picture; where the device enters, it ends the field."""
    mask = np.zeros((1000, 1280), dtype=bool)
    mask[480:500, :400] = True  # enters from the left
    acquisition = Acquisition(lambda _: (mask, mask), (rig(),), [0.0], lenses=(BARREL, BARREL))
    (seen,) = segmentation.observe(acquisition, lambda mask: mask)
    entry = seen.pixels_a[np.argmin(seen.pixels_a[:, 0])]
    assert seen.distance_to_border("a", [entry])[0] < 2
    assert seen.pixels_a[:, 0].min() < -20  # the barrel hid how far out that is


def test_from_frame_to_frame_a_border_is_bent_once(monkeypatch):
    corners = np.array([[-0.5, -0.5], [1279.5, -0.5], [1279.5, 999.5], [-0.5, 999.5]])
    lens = RadialTangentialLens(K, [-0.25, 0.08, 0, 0, 0])
    entered = [np.array([[0.0, y], [0.0, y + 1]]) for y in (300.0, 700.0)]
    undistorted_field(corners, lens, entered[0])
    middle, slope = (lens.undistort([[-0.5, 700.5 + away]])[0] for away in (0.0, 1.0))
    monkeypatch.delattr(RadialTangentialLens, "_bend")
    field = undistorted_field(corners, lens, entered[1])
    # One of its sides runs through the place, along the tangent there.
    sides = np.roll(field, -1, axis=0) - field
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    away = middle - field
    distance = np.abs(sides[:, 0] * away[:, 1] - sides[:, 1] * away[:, 0])
    along = (slope - middle) / np.linalg.norm(slope - middle)
    assert distance.min() < 0.01
    assert abs(sides[distance.argmin()] @ along) == pytest.approx(1, abs=1e-4)


@pytest.mark.parametrize("shape", [(1, 30), (30, 1), (1, 1)])
def test_a_picture_of_one_row_or_column_has_no_cells(shape):
    assert undistorted_mask_pixels(np.ones(shape, dtype=bool), BARREL).shape[1] == 2


def test_without_a_device_the_field_is_the_hull_of_the_bent_border():
    corners = np.array([[-0.5, -0.5], [1279.5, -0.5], [1279.5, 999.5], [-0.5, 999.5]])
    field = undistorted_field(corners, BARREL, np.empty((0, 2)))
    assert BARREL.undistort(corners[:1])[0] == pytest.approx(field[np.argmin(field.sum(axis=1))])


def test_a_device_beyond_the_lens_model_is_a_defect_of_the_frame_not_an_end_of_the_run():
    folds = RadialTangentialLens(K, [-1.5, 0, 0, 0])
    mask = np.zeros((1000, 1280), dtype=bool)
    mask[:, 600:610] = True
    acquisition = Acquisition(lambda _: (mask, mask), (rig(),), [0.0], lenses=(folds, folds))
    (seen,) = segmentation.observe(acquisition, lambda mask: mask)
    assert "cannot be undistorted" in seen.defect
