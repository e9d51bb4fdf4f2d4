import pickle

import numpy as np
import pytest
from skimage.measure import points_in_poly

from stereosom.observation import Observation
from stereosom.synthetic import converging_rig

RIG = converging_rig(60)


def test_a_mask_pixel_becomes_the_point_x_y():
    mask = np.zeros((768, 1024), dtype=bool)
    mask[10, 20] = True
    seen = Observation.from_masks(mask, mask, RIG, time=1.5, index=3)
    assert seen.pixels_b.tolist() == [[20, 10]]
    assert (seen.time, seen.index) == (1.5, 3)


@pytest.mark.parametrize("shift", [0, 0.1])
@pytest.mark.parametrize("order", ["rows", "columns", "any"])
def test_pickled_it_is_the_same_to_the_last_bit(order, shift):
    row, column = np.nonzero(np.random.default_rng(1).random((30, 40)) < 0.8)
    pixels = np.column_stack([column, row]) - 7.0 + shift
    if order != "rows":
        pixels = pixels[np.random.default_rng(2).permutation(len(pixels))]
    if order == "columns":
        pixels = pixels[np.lexsort(pixels.T[::-1])]
    back = pickle.loads(pickle.dumps(Observation(pixels, pixels[:0], RIG, index=3)))
    assert np.array_equal(back.pixels_a, pixels)
    assert back.pixels_b.shape == (0, 2)
    assert (back.index, back.rig.a.image_size) == (3, RIG.a.image_size)
    with pytest.raises(ValueError, match="read-only"):
        back.pixels_a[0] = 0


def test_pickled_it_is_small():
    """What is segmented ahead waits in a pipe of a quarter of a megabyte."""
    mask = np.zeros((768, 1024), dtype=bool)
    mask[100:700, 300:400] = True
    assert len(pickle.dumps(Observation.from_masks(mask, mask, RIG))) < 50_000


def test_the_field_of_view_is_the_picture_unless_given():
    seen = Observation(np.zeros((0, 2)), np.zeros((0, 2)), RIG)
    distance = seen.distance_to_border("a", [[0, 300], [512, 384], [1023, 767]])
    assert distance == pytest.approx([0.5, 383.5, 0.5])  # pixels are half a pixel from the edge


def segment_distance(pixels, start, end):
    """To a side and no farther than its ends."""
    share = np.clip((pixels - start) @ (end - start) / np.sum((end - start) ** 2), 0, 1)
    return np.linalg.norm(pixels - start - share[:, None] * (end - start), axis=1)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("within", [0.5, 1.5, 40.0])
def test_pixels_at_the_border_are_those_no_farther_from_it(within, order):
    shutter = np.array([[100.0, 80], [700, 60], [900, 400], [620, 700], [90, 500]])[::order]
    row, column = np.indices((768, 1024)).reshape(2, -1)[:, ::37]
    pixels = np.column_stack([column, row]).astype(float)
    sides = list(zip(shutter, np.roll(shutter, -1, axis=0), strict=True))
    pixels = pixels[points_in_poly(pixels, shutter)]
    nearest = np.min([segment_distance(pixels, *side) for side in sides], axis=0)
    twice = np.repeat(shutter, 2, axis=0)  # corners that coincide make no side
    for field in (shutter, twice):
        seen = Observation(pixels, pixels[:1], RIG, field_of_view=(field, field))
        assert seen.distance_to_border("a", pixels) == pytest.approx(nearest, abs=1e-9)
        near = seen.at_border("a", pixels, within)
        assert near.any()
        assert not near.all()
        assert np.array_equal(near, nearest <= within)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"pixels_a": [[1, 2, 3]]}, "pixels_a: must be n×2, is 1×3"),
        ({"pixels_b": [[1, np.nan]]}, "pixels_b: holds values that are not finite"),
        ({"kind": "outline"}, "not one of filled, edges"),
        ({"time": np.inf}, "not a finite number of seconds"),
    ],
)
def test_what_is_no_observation_is_refused(change, says):
    with pytest.raises(ValueError, match=says):
        Observation(**({"pixels_a": [[1, 2]], "pixels_b": [[1, 2]], "rig": RIG} | change))


def test_a_mask_of_another_size_is_refused_with_both_sizes():
    with pytest.raises(ValueError, match="is 512×512 pixels, its camera's picture is 1024×768"):
        Observation.from_masks(np.ones((768, 1024)), np.ones((512, 512)), RIG)


def test_arrays_cannot_be_changed_afterwards():
    pixels = np.array([[1.0, 2.0]])
    seen = Observation(pixels, pixels, RIG)
    pixels[0, 0] = 99
    assert seen.pixels_a[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        seen.pixels_a[0, 0] = 5
