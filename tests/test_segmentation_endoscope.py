"""Masks from an endoscope's pictures: by what lies behind, by color, by edges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from stereosom_plugin.errors import InputError

pytest.importorskip("skimage")
from stereosom_plugin.segmentation.endoscope import segmenter
from stereosom_plugin.segmentation.endoscope.ribbon import Ribbon

ROWS = slice(28, 33)


def tissue(seed: int = 0) -> np.ndarray:
    """A reddish picture with some texture, (60, 80, 3)."""
    rng = np.random.default_rng(seed)
    picture = np.array([150, 70, 60]) + rng.normal(0, 2, (60, 80, 1))
    return np.clip(picture, 0, 255).astype(np.uint8)


def with_device(picture: np.ndarray) -> np.ndarray:
    """The same with a bluish bar of five rows."""
    seen = picture.copy()
    seen[ROWS, 10:70] = 40, 60, 140
    return seen


def expected() -> np.ndarray:
    mask = np.zeros((60, 80), dtype=bool)
    mask[ROWS, 10:70] = True
    return mask


def test_a_known_background_leaves_the_device_in_each_eye():
    left, right = segmenter(background=(tissue(1), tissue(2)))
    assert np.array_equal(left(with_device(tissue(1))), expected())
    assert np.array_equal(right(with_device(tissue(2))), expected())


def test_what_the_empty_scene_shows_of_the_device_belongs_to_it():
    """A robot that is drawn back leaves a stub in the picture; a dark patch is none."""
    stub = tissue()
    stub[ROWS, 10:30] = 40, 60, 140
    stub[20:50, 62:] = 40, 60, 140
    left, _ = segmenter(background=(stub, stub))
    seen = with_device(tissue())
    seen[20:50, 62:] = 40, 60, 140
    mask = left(seen)
    assert np.flatnonzero(mask[30]).min() <= 12
    assert mask.sum() < 1.1 * expected().sum()


def test_a_mask_holds_the_pixels_whose_centers_lie_between_the_edges():
    along = np.linspace(5, 75, 141)
    rims = [np.column_stack([along, 30 + side * 4.3 + along / 7]) for side in (-1, 1)]
    ribbon = Ribbon((rims[0] + rims[1]) / 2, (rims[0], rims[1]), np.ones(141, dtype=bool), 8.6)
    x, y = np.meshgrid(np.arange(80), np.arange(60))
    between = (np.abs(y - 30 - x / 7) < 4.3) & (x >= 5) & (x <= 75)
    assert np.array_equal(ribbon.mask((60, 80)), between)


def test_a_device_that_swings_by_more_than_its_width_keeps_its_flat_end():
    row, column = np.indices((240, 320))

    def shown(angle_deg):
        """A bar of 16 px that comes in from the right, and its pixels."""
        x, y = 320 - column, row - 120
        angle = np.deg2rad(angle_deg)
        along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        mask = (np.abs(across) < 8) & (along < 200)
        noise = np.random.default_rng(1).normal(0, 2, (240, 320, 1))
        picture = np.where(mask[..., None], [170, 185, 200], [150, 70, 60]) + noise
        return np.clip(picture, 0, 255).astype(np.uint8), mask

    left, _ = segmenter()
    for angle in (-5, -3, 4, 12):  # its end moves by up to 28 px
        picture, mask = shown(angle)
        assert np.sum(left(picture) ^ mask) < 0.03 * mask.sum()


def test_a_rim_that_turns_back_in_a_sharp_bend_leaves_no_hole():
    turn = np.linspace(np.pi, 2 * np.pi, 60)
    out, back = np.linspace(10, 30, 40), np.linspace(30, 10, 40)
    middle = np.column_stack([
        np.concatenate([np.full(40, 38), 40 + 2 * np.cos(turn), np.full(40, 42)]),
        np.concatenate([out, 30 - 2 * np.sin(turn), back]),
    ])  # fmt: skip
    along = np.gradient(middle, axis=0)
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    rims = (middle - 4.2 * normal, middle + 4.2 * normal)  # wider than the bend
    mask = Ribbon(middle, rims, np.ones(140, dtype=bool), 8.4).mask((60, 80))
    assert np.array_equal(mask, ndimage.binary_fill_holes(mask))
    assert mask[12:33, 36:45].all()


def test_another_exposure_than_the_backgrounds_is_no_device():
    left, _ = segmenter(background=(tissue(), tissue()))
    brighter = np.clip(with_device(tissue()) * 1.2, 0, 255).astype(np.uint8)
    assert np.array_equal(left(brighter), expected())


def test_a_shadow_is_no_device():
    seen = with_device(tissue())
    seen[45:52, 10:70] = (seen[45:52, 10:70] * 0.7).astype(np.uint8)
    left, _ = segmenter(background=(tissue(), tissue()))
    assert not left(seen)[40:].any()


def test_a_highlight_within_the_device_belongs_to_it():
    seen = with_device(tissue())
    seen[30, 30:40] = 255
    left, _ = segmenter(color_box=(12, 28, 10, 5), example=with_device(tissue()))
    assert left(seen)[30, 30:40].all()


def test_a_white_background_is_no_highlight_of_what_bends_before_it():
    seen = np.full((120, 160, 3), 255, dtype=np.uint8)
    seen[40:43, 20:100] = seen[40:80, 97:100] = seen[46:49, 20:90] = 90, 20, 20
    left, _ = segmenter(width_px=12)
    mask = left(seen)
    assert mask[41, 30:90].all()
    assert not mask[43:46, 20:90].any()


@pytest.mark.parametrize(
    "drawn", [{"color_box": (20, 26, 12, 9)}, {"stroke": [(15, 30), (60, 30)]}]
)
def test_color_is_learned_from_a_box_or_a_stroke(drawn):
    left, right = segmenter(example=with_device(tissue()), **drawn)
    for eye, seed in ((left, 3), (right, 4)):
        assert np.array_equal(eye(with_device(tissue(seed))), expected())


def test_an_empty_scene_has_no_device():
    left, _ = segmenter(background=(tissue(), tissue()))
    assert not left(tissue(5)).any()


@pytest.mark.parametrize(
    ("asked", "what"),
    [
        ({"edges": 12.0, "color_box": (0, 0, 5, 5)}, "exclude each other"),
        ({"color_box": (200, 5, 5, 5), "example": tissue()}, "no part of the 80×60 picture"),
        ({"color_box": (1, 1, 5, 5)}, "no picture to be learned from"),
        ({"stroke": [(900, 900), (950, 900)], "example": tissue()}, "does not touch"),
        ({"width_px": -1.0}, "no width"),
    ],
)
def test_what_cannot_be_done_is_said(asked, what):
    with pytest.raises(InputError, match=what):
        segmenter(**asked)


def test_a_background_of_another_size_is_refused():
    left, _ = segmenter(background=(tissue()[:50], tissue()))
    with pytest.raises(InputError, match="80×50 with 3 colors, the frame 80×60"):
        left(tissue())


def test_outer_and_inner_tube_of_a_real_robot_are_one_device(shared_data):
    imread = pytest.importorskip("skimage.io").imread
    folder = shared_data / "concentric_tube_robot_stereo"
    names = ("left_0", "right_0", "background_left", "background_right")
    left_0, right_0, left, right = (imread(folder / f"{name}.png")[..., :3] for name in names)
    by_eye = segmenter(background=(left, right))
    # Read off the pictures by eye: on the outer tube, on the inner one, and near the tip.
    places = (((150, 522), (300, 562), (470, 672), (502, 730)),
              ((150, 707), (300, 723), (540, 830), (619, 1000)))  # fmt: skip
    for segment, picture, points in zip(by_eye, (left_0, right_0), places, strict=True):
        rows, columns = np.nonzero(segment(picture))
        for row, column in points:
            assert np.hypot(rows - row, columns - column).min() < 12
        assert len(rows) < 5000  # and little else


def test_a_shaded_body_is_as_wide_before_dark_tissue_as_before_bright():
    """Its depth is told by its width: a twentieth of that would be a twentieth of the distance."""
    row, column = np.mgrid[:200, :600]
    away = (row - 99.5) / 12
    shade = 40 + 120 * np.sqrt(np.clip(1 - away**2, 0, 1))
    behind = (0.3 + 0.7 * column / 600)[..., None] * (190, 60, 50)
    seen = np.where((np.abs(away) <= 1)[..., None], shade[..., None], behind)
    seen = ndimage.gaussian_filter(seen, (0.8, 0.8, 0))
    seen += np.random.default_rng(1).normal(0, 2, seen.shape)
    left, _ = segmenter(width_px=40)
    for _ in range(3):
        left(np.rint(np.clip(seen, 0, 255)).astype(np.uint8))
    across = left.last.edges[1] - left.last.edges[0]
    width = np.linalg.norm(across, axis=1)[20:-20]
    parts = [each.mean() for each in np.array_split(width, 4)]
    assert np.ptp(parts) < 0.3
    assert np.mean(parts) == pytest.approx(24, abs=0.8)
