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
    for points in (line(), 10 + 0.3 * line()):  # beyond the border, and within
        (light,) = same(
            "light_across", picture, points, normals, np.arange(-3.0, 4), 0.1, within=1e-5
        )
        assert light.min() == np.float32(0.1)
    corner = np.array([[29.0, 29], [0, 0], [0, 28.5]])
    same("light_across", picture, corner, normals[:3], np.zeros(1), 0.1, within=1e-5)
    same("light_across", np.asfortranarray(picture), line(), normals, np.zeros(1), 0.1, within=1e-5)


@pytest.mark.parametrize("count", [1, 2, 5, 8, 49, 96, 301])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_medians(count, kind):
    values = rng.integers(0, 9, (60, count)).astype(kind)
    (found,) = same("medians", values)
    assert np.allclose(found, np.median(values, axis=1))
    same("medians", values.T[:, ::2])
    same("medians", np.sort(values, axis=1))
    # Where a sample says little of the rest.
    same("medians", np.where(np.arange(count) % 4 == 0, 9, values).astype(kind))


def test_the_best_way_also_where_ways_are_worth_the_same():
    for values in (rng.random((50, 30)), rng.integers(0, 3, (50, 30)).astype(float)):
        same("best_way", values, 0.15 * np.arange(-2, 3) ** 2)


@pytest.mark.parametrize("count", [1, 3, 17, 40])
def test_blur_mirrors_beyond_the_ends(count):
    same("blurred", rng.random((count, 2)), gaussian(2.0))
    same("blurred", rng.random((2, count)).T, gaussian(2.0))


def test_directions_across_a_line():
    (across,) = same("normals", line())
    assert np.allclose(np.linalg.norm(across, axis=1), 1)
    same("normals", np.array([[1.0, 1], [1, 1], [2, 1]]))


@pytest.mark.parametrize("spacing", [0.3, 2.0, 100.0])
def test_a_line_at_even_steps(spacing):
    (points,) = same("evenly", line(), spacing)
    assert np.allclose(points[[0, -1]], line()[[0, -1]])
    same("evenly", np.array([[0.0, 0], [0, 0], [3, 4], [3, 4]]), spacing)


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


@pytest.mark.parametrize("face", [False, True])
def test_the_light_that_a_tail_leaves(face):
    rng = np.random.default_rng(1)
    pixels = np.argwhere(rng.random((20, 30)) < 0.7)[:, ::-1].astype(float)
    body = rng.random(len(pixels)) * (pixels[:, 0] < 10)
    weights = gaussian(0.8, reach=3.0)
    (root,) = same("covered", pixels, body, line()[5:30], 4.0, 0.7, face, 1.5, weights, (20, 30))
    assert root.min() < 0.6
    assert root.max() == pytest.approx(1)


def test_deviations_are_limited_and_some_are_added():
    light, seen = np.random.default_rng(1).normal(size=(2, 300))
    (off,) = same("deviations", light, seen, 0.3, 2.0, np.array([7.0, -8.0]))
    assert np.abs(off[:300]).max() == 2
    assert off[300:].tolist() == [7, -8]


@pytest.mark.parametrize("deviation", [0.3, 0.8, 4.0])
def test_blur_of_a_picture_mirrors_beyond_its_borders(deviation):
    same("smooth", rng.random((20, 25)), gaussian(deviation, reach=3.0))
    same("smooth", rng.random((1, 3)), gaussian(deviation, reach=3.0))


@pytest.mark.parametrize("shape", [(15, 20), (40, 40)])
@pytest.mark.parametrize("step", [0.9, 2.0])
def test_heaps_of_discs_also_beyond_the_border(shape, step):
    across, along = 3 * rng.uniform(-1, 1, (2, 50))
    (heap,) = same("discs", line(), step, across, along, shape)
    assert 0 < heap.sum() < 40 * 50


def test_a_tail_in_the_view_that_looks_along_it():
    rays = rng.normal(size=(20, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    projection = np.array([[900.0, 0, 250, 9], [0, 900, 250, 9], [0, 0, 1, 2000]])
    bend, depth, center = np.array([1.0, -2, 3]), np.linspace(500, 520, 20), rng.normal(size=3)
    points, way = same("tail", bend, depth, 0.4, center, rays, projection)
    assert np.allclose(
        points[0],
        ((center + depth[0] * rays[0]) @ projection[:, :3].T + projection[:, 3])[:2]
        / (2000 + (center + depth[0] * rays[0])[2]),
    )
    assert way[0] == 0


def test_a_damped_step_and_what_it_tells_of_the_slopes():
    slopes, misfit = rng.normal(size=(60, 4)), rng.normal(size=60)
    (step,) = same("damped_step", slopes, misfit, 1e-2)
    assert np.sum((misfit + slopes @ step) ** 2) < np.sum(misfit**2)
    change, mended = rng.normal(size=60), [slopes.copy(), slopes.copy()]
    for one, which in zip(mended, (compiled, reference), strict=True):
        which.learn_slopes(one, change, step)
        assert np.allclose(one @ step, change)
    assert np.allclose(*mended)


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


@pytest.mark.parametrize("sure", [0.0, 50.0])
def test_the_profile_that_fits(sure):
    place, chords = np.arange(-7, 7.5, 0.5), (np.arange(24) + 0.5) / 24
    start, true = np.array([2.5, 0.6, 0.8, 0.0]), np.array([3.1, 0.9, 0.9, 0.3])
    low, high = np.array([0.4, 0.01, 0.3, -2]), np.array([9.0, 6, 2.5, 2])
    taken = reference.tube_profile(place, chords, true)[0]
    known = np.array([0, 0, sure, 0])
    (found,) = same("fitted_profile", place, chords, taken, start, low, high, known, within=1e-6)
    assert np.abs(found - true).max() < (0.01 if sure == 0 else 0.15)


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
    profile = rng.integers(0, 255, (40, 21, channels)).astype(np.float32)
    same("half_way", profile, 0.3, 0.01, within=1e-4)
    profile[:] = 90
    profile[:, 13:] = 190  # between the places 12 and 13, at the middle of which it is 10
    shift, far, by_hue = same("half_way", profile, 0.3, 0.01, within=1e-4)
    assert shift[10] == pytest.approx(0.3 * 2.5)
    assert far[10] == pytest.approx(100 * np.sqrt(channels))
    assert not by_hue  # it is brighter, no more


def test_shades_of_a_round_body_do_not_move_its_edge_where_hue_tells_it():
    """The nearer its edge the darker it is, here more, there less; what is behind is red."""
    depth, least = np.arange(11)[::-1], np.linspace(0.3, 0.9, 40)[:, None]
    profile = np.zeros((40, 21, 3), dtype=np.float32)
    profile[:, :11] = 160 * (least + (1 - least) * np.sqrt(depth / 10))[..., None]
    profile[:, 11:] = 120, 40, 40
    by_all, by_hue = (same("half_way", profile, 0.3, least, within=1e-4) for least in (9, 0.05))
    assert (by_all[2], by_hue[2]) == (False, True)
    assert np.ptp(by_all[0]) > 0.15
    assert by_hue[0] == pytest.approx(0.15, abs=0.02)


@pytest.mark.parametrize("channels", [1, 3])
def test_colors_between_pixels_and_beyond_the_border(channels):
    picture = rng.integers(0, 256, (20, 30, channels)).astype(np.uint8)
    x, y = rng.uniform(-3, 33, (2, 25, 7))
    (found,) = same("sampled", picture, x, y, within=1e-4)
    corner = np.array([[-2.0, 29.0, 40.0, 3.5]]), np.array([[-2.0, 19.0, 25.0, 0.0]])
    (found,) = same("sampled", picture, *corner, within=1e-4)
    half = (picture[0, 3].astype(float) + picture[0, 4]) / 2
    assert np.allclose(found[0], [picture[0, 0], picture[-1, -1], picture[-1, -1], half])
    (light,) = same("sampled", (picture / 255).astype(np.float32), x, y, within=1e-4)
    assert light.max() <= 1
    same("sampled", picture[:1, :1], x, y, within=1e-4)


@pytest.mark.parametrize("channels", [1, 3])
def test_how_like_colors_are(channels):
    shades = 6
    table = rng.random(shades**channels).astype(np.float32)
    picture = rng.integers(0, 256, (20, 30, channels)).astype(np.uint8)
    x, y = rng.integers(0, 20, (2, 25, 7)).astype(float)
    (found,) = same("likeness", picture, x, y, table, shades)
    level = picture[int(y[3, 2]), int(x[3, 2])].astype(int) * shades // 256
    number = level @ shades ** np.arange(channels - 1, -1, -1)
    assert found[3, 2] == table[number]
    same("likeness", np.full_like(picture, 255), x + 0.4, y - 20, table, shades)


@pytest.mark.parametrize("channels", [1, 3])
def test_how_often_colors_are(channels):
    picture = rng.uniform(-0.1, 1.1, (20, 30, channels)).astype(np.float32)
    sample = rng.random((20, 30)) < 0.2
    (number,) = same("shades", picture, 6)
    counts = same("counted", picture, sample, 6)[0]
    assert counts.sum(axis=1).tolist() == [sample.sum(), (~sample).sum()]
    assert counts[0, number[sample][0]] == np.sum(number[sample] == number[sample][0])


@pytest.mark.parametrize("size", [1, 5, 7])
def test_medians_along(size):
    same("middles", rng.integers(0, 5, 40).astype(float), size)
    same("middles", rng.random(3), size)


def test_columns_that_hold_most():
    gain = rng.normal(size=(40, 31))
    first = rng.integers(0, 31, 40)
    same("most_gain", gain, first, 20)
    gain = np.where(np.abs(np.arange(31) - 15) <= 6, 1.0, -1.0) + np.zeros((40, 1))
    (found,) = same("most_gain", gain.astype(np.float32), np.full(40, 14), 12)
    assert found.tolist() == [[5] * 40, [7] * 40]


def test_what_lies_before_an_end():
    total = np.cumsum(rng.random((37, 15)), axis=0)
    ends, reaches = np.arange(-0.8, 1.6, 0.04), np.linspace(0, 1.5, 13)
    short = 1 - np.sqrt(1 - np.linspace(-0.9, 0.9, 15) ** 2)
    (held,) = same("held", total, ends, reaches, short, -1.5, 1 / 12)
    assert held[-1, 0] == pytest.approx(total[-1].sum())


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
