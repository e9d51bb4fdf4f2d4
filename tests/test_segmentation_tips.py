"""Where a device ends in an endoscope's picture, and in what shape."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

pytest.importorskip("cv2")
from stereosom_plugin.segmentation.endoscope import segmenter
from stereosom_plugin.segmentation.endoscope.tips import find_tip

HALF = 12.0
RIMS = tuple(np.column_stack([np.arange(0.0, 100, 3), np.full(34, 150 + y)]) for y in (-HALF, HALF))


def gain_of(end, roundness):
    """One within a device along x that ends so, minus one outside."""

    def gain(x, y):
        aside = np.clip((y - 150) / HALF, -1, 1)
        reach = end - roundness * HALF * (1 - np.sqrt(1 - aside**2))
        return np.where((x <= reach) & (np.abs(y - 150) <= HALF), 1.0, -1.0)

    return gain


@pytest.mark.parametrize("roundness", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("end", [97.3, 99.0, 104.6])
def test_the_end_and_its_shape_are_found_between_the_rows(end, roundness):
    tip = find_tip(RIMS, (300, 300), gain_of(end, roundness))
    assert tip.place[0] + HALF * tip.roundness == pytest.approx(end, abs=0.6)
    assert tip.roundness == pytest.approx(roundness, abs=0.13)
    left, right = tip.after(RIMS)
    assert max(left[:, 0].max(), right[:, 0].max()) == pytest.approx(end, abs=0.8)
    for edge, there in ((left, 150 - HALF), (right, 150 + HALF)):
        assert np.all(np.diff(edge[:, 0]) > -1e-9)
        assert edge[0, 1] == pytest.approx(there)
        assert edge[-1, 1] == pytest.approx(150, abs=0.15 * HALF)


def test_of_ends_that_are_as_likely_the_middle_is_taken():
    """Where colors tell nothing for a while, what is first or last is chance."""
    narrow = tuple(
        np.column_stack([np.arange(0.0, 100, 1), np.full(100, 150 + y)]) for y in (-3, 3)
    )

    def gain(x, y):
        return np.where(x < 98, 1.0, np.where(x < 101, 0.0, -1.0))

    tip = find_tip(narrow, (300, 300), gain)
    assert tip.place[0] + 3 * tip.roundness == pytest.approx(99.5, abs=0.2)


def test_what_goes_on_or_leaves_the_picture_has_no_end():
    assert find_tip(RIMS, (300, 300), gain_of(150.0, 0.0)) is None
    assert find_tip(RIMS, (105, 300), gain_of(99.0, 0.0)) is None


def test_a_bar_ends_in_the_mask_where_it_does_in_the_picture():
    generator = np.random.default_rng(1)
    left, _ = segmenter(width_px=40)
    beyond = []
    for end in 300 + np.cumsum(generator.uniform(0, 3, 16)):
        bar = np.zeros((300, 600))
        bar[138:162] = np.clip(end - np.arange(600) + 0.5, 0, 1)
        seen = ndimage.gaussian_filter(200 - 150 * bar, 0.7) + generator.normal(0, 2, bar.shape)
        mask = left(np.repeat(np.rint(seen).astype(np.uint8)[..., None], 3, axis=2))
        beyond.append(mask[144:156].sum(axis=1).mean() - end)
    assert np.std(beyond) < 0.5
    assert np.abs(np.mean(beyond)) < 1


def test_a_device_that_swings_by_many_widths_is_followed_to_its_tip():
    generator, (row, column) = np.random.default_rng(2), np.indices((400, 640))
    left, _ = segmenter()
    for bend in (-4e-4, 4e-4, -4e-4):
        away = np.abs(row - 200 - bend * column**2) / np.hypot(1, 2 * bend * column)
        seen = 200 - 150 * ((away < 10) & (column < 520)) + generator.normal(0, 2, row.shape)
        mask = left(np.repeat(np.rint(seen).astype(np.uint8)[..., None], 3, axis=2))
        assert np.flatnonzero(mask.any(axis=0)).max() == pytest.approx(519, abs=8)
        assert mask.sum() == pytest.approx(np.count_nonzero((away < 10) & (column < 520)), rel=0.05)
