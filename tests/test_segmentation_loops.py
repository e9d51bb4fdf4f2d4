"""The loops of the segmentation: what numba compiles gives the same as numpy."""

from __future__ import annotations

import numpy as np
import pytest

from stereosom_plugin.segmentation.loops import loops, reference
from stereosom_plugin.segmentation.picture import gaussian

compiled = pytest.importorskip("stereosom_plugin.segmentation.loops.compiled")
rng = np.random.default_rng(0)


def line(points=40, size=30):
    """A curved line that leaves a picture of that size."""
    share = np.linspace(0, 1, points)[:, None]
    return size * np.hstack([1.2 * share - 0.1, 0.3 + 0.6 * share**2])


def same(name, *arguments, within=1e-9):
    ours, theirs = (getattr(which, name)(*arguments) for which in (compiled, reference))
    if not isinstance(ours, tuple):
        ours, theirs = (ours,), (theirs,)
    for one, other in zip(ours, theirs, strict=True):
        assert np.shape(one) == np.shape(other)
        assert np.allclose(one, other, rtol=within, atol=within), name
    return ours


def test_light_across_a_line():
    picture = rng.random((30, 30)).astype(np.float32)
    normals = rng.normal(size=(40, 2))
    same("log_across", picture, line(), normals, np.arange(-3.0, 4), 0.1, within=1e-5)


@pytest.mark.parametrize("count", [1, 2, 5, 8, 49])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_medians(count, kind):
    values = rng.integers(0, 9, (60, count)).astype(kind)
    (found,) = same("medians", values)
    assert np.allclose(found, np.median(values, axis=1))
    same("medians", values.T[:, ::2])


def test_the_best_way_also_where_ways_are_worth_the_same():
    for values in (rng.random((50, 30)), rng.integers(0, 3, (50, 30)).astype(float)):
        same("best_way", values, 0.15 * np.arange(-2, 3) ** 2)


@pytest.mark.parametrize("count", [1, 3, 40])
def test_blur_mirrors_beyond_the_ends(count):
    same("blurred", rng.random((count, 2)), gaussian(2.0))


def test_what_is_absorbed():
    log = rng.random((50, 33)).astype(np.float32)
    same("absorbed", log, np.arange(-16.0, 17) / 2, 9, gaussian(1.5), within=1e-5)


@pytest.mark.parametrize("spacing", [0.7, 100.0])
def test_even_steps(spacing):
    way = np.concatenate([[0.0, 0.0], np.cumsum(rng.random(38))])
    same("even", line(), way, spacing)


@pytest.mark.parametrize("ends", [False, True])
@pytest.mark.parametrize("face", [False, True])
@pytest.mark.parametrize("pace", [0.7, 3.0])
def test_shadow(face, ends, pace):
    pixels = np.stack(np.indices((30, 30)), axis=-1).reshape(-1, 2).astype(float)
    (share,) = same("shadow", pixels, line()[5:35], 4.0, pace, ends, face)
    assert share.max() <= 1
    assert np.count_nonzero(share) > 100


def test_root_of_the_light_after_a_blur():
    shown = rng.random((20, 25)) < 0.4
    share = rng.random(np.count_nonzero(shown))
    same("blurred_root", share, shown, 1.5, gaussian(0.8, reach=3.0))


def test_heaps_of_points_also_beyond_the_border():
    points = rng.uniform(-4, 24, (500, 2))
    (heap,) = same("heaped", points, (15, 20))
    inside = np.all((points >= 0) & (points <= [19, 14]), axis=1)
    assert heap.sum() >= np.count_nonzero(inside)


def test_a_line_is_drawn_also_across_the_border_and_around_bends():
    turn = np.linspace(0, 5, 60)
    lines = [line(), 15 + np.column_stack([9 * np.cos(turn), 6 * np.sin(turn)])]
    lines += [np.array([[3.0, 3], [20, 4], [5, 9]])]
    for points in lines:
        radius = np.linspace(1.5, 4, len(points))
        masks = np.zeros((2, 30, 28), dtype=bool)
        for mask, which in zip(masks, (compiled, reference), strict=True):
            which.draw_line(mask, points, radius)
        assert (masks[0] == masks[1]).all()
        assert masks[0].any()


def test_darker_lines_fill_in_the_same():
    smooth = rng.random((70, 60)).astype(np.float32)
    along = np.pi * np.arange(12) / 12
    along = np.stack([np.cos(along), np.sin(along)], axis=1)
    taps = np.rint(np.arange(-3, 4)[:, None] * 2.4 * along[:, None]).astype(np.intp)
    aside = np.rint(3.5 * along[:, ::-1] * [-1, 1]).astype(np.intp)
    found = []
    for which in (compiled, reference):
        absorption = np.full((44, 34), 0.1, dtype=np.float32)
        direction = np.zeros((44, 34), dtype=np.int8)
        better = which.darker_lines(smooth, taps, aside, absorption, direction)
        found.append((better, direction, absorption))
    for one, other in zip(*found, strict=True):
        assert np.allclose(one, other, atol=1e-6)
    assert 0 < np.count_nonzero(found[0][0]) < found[0][0].size


def test_profile_of_a_tube_and_its_slopes():
    place, chords = np.arange(-6, 6.5, 0.5), (np.arange(24) + 0.5) / 24
    tube = np.array([3.1, 0.9, 0.8, 0.3])
    profile, slopes = same("tube_profile", place, chords, tube)
    for number in range(4):
        moved = tube.copy()
        moved[number] += 1e-6
        changed = compiled.tube_profile(place, chords, moved)[0]
        assert np.allclose((changed - profile) / 1e-6, slopes[:, number], atol=1e-5)


def test_without_numba_numpy_does(monkeypatch):
    assert loops() is compiled
    loops.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr("stereosom.loops.find_spec", lambda name: None)
        without = loops()
    loops.cache_clear()
    assert without is reference


@pytest.mark.parametrize("count", [2, 5, 60])
@pytest.mark.parametrize("wide", [1, 2])
def test_a_weighted_mean(count, wide):
    values, weights = rng.random((count, 2)), rng.random((count, wide))
    (mean,) = same("weighted", values, weights, gaussian(3.0, reach=3.0), 0.1)
    assert mean.shape == values.shape


def test_a_mean_neither_shortens_nor_turns_a_straight_line():
    straight = np.outer(np.arange(40), [1.0, -2.0])
    (mean,) = same("weighted", straight, np.ones((40, 1)), gaussian(3.0, reach=3.0), 0.0)
    assert np.allclose(mean, straight)


@pytest.mark.parametrize("channels", [1, 3])
def test_where_colors_have_gone_half_the_way(channels):
    profile = rng.integers(0, 255, (40, 21, channels)).astype(np.uint8)
    same("half_way", profile, 0.3, within=1e-4)
    profile[:] = 90
    profile[:, 13:] = 190  # between the places 12 and 13, at the middle of which it is 10
    shift, far = same("half_way", profile, 0.3, within=1e-4)
    assert shift[10] == pytest.approx(0.3 * 2.5)
    assert far[10] == pytest.approx(100 * np.sqrt(channels))


def test_filling_what_an_outline_winds_about():
    around = np.linspace(0, 2 * np.pi, 50, endpoint=False)[:, None]
    ring = 15 + 12 * np.hstack([np.cos(around), np.sin(around)])
    twice = 15 + 6 * np.hstack([np.cos(2 * around), np.sin(2 * around)])
    beyond = 8 + 20 * rng.normal(size=(30, 2))  # crosses itself, and leaves the picture
    for outline in (ring, twice, beyond, np.rint(beyond)):
        filled = []
        for which in (compiled, reference):
            drawn = np.zeros((30, 32), dtype=bool)
            which.fill(drawn, outline)
            filled.append(drawn)
        assert filled[0].any()
        assert np.array_equal(*filled)
    compiled.fill(drawn := np.zeros((30, 32), dtype=bool), ring)
    y, x = np.indices(drawn.shape)
    assert np.count_nonzero(drawn ^ (np.hypot(x - 15, y - 15) < 12)) < 12
