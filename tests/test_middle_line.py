"""From a mask to the line in its middle: known answers, and the compiled kernels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from stereosom.middle_line import reference
from stereosom.middle_line.kernels import kernels

PICTURES = ("noise", "clouds", "lines")
often = settings(max_examples=60, deadline=None)


def picture(text):
    """A mask drawn in characters."""
    return np.array([[character == "#" for character in row] for row in text.split()])


def pixels_of(mask):
    """Pixels (n, 2) of a mask."""
    return np.argwhere(mask)[:, ::-1].astype(float)


def test_a_small_mask_is_about_as_wide_as_wanted():
    bar = np.zeros((40, 200), dtype=bool)
    bar[10:30, 10:190] = True
    mask, left, top, factor = reference.small_mask(pixels_of(bar), 5.0)
    assert factor == 4
    rows, columns = np.nonzero(mask)
    assert np.ptp(rows) + 1 == pytest.approx(5, abs=1)
    assert np.ptp(columns) + 1 == pytest.approx(45, abs=1)
    # The middle stays where it is.
    middle = [(rows.mean() + 0.5) * 4 - 0.5 + top, (columns.mean() + 0.5) * 4 - 0.5 + left]
    assert middle == pytest.approx([19.5, 99.5], abs=1.5)


def test_specks_go_and_corners_hold_together():
    mask = picture("###...# ####... ....##. .....##")
    found = reference.without_small(mask, True, 0.3, np.inf)
    assert np.array_equal(found, picture("###.... ####... ....##. .....##"))


def test_small_holes_are_filled_but_not_what_is_around():
    mask = picture("........ .######. .#.##.#. .####.#. .######. ........")
    found = reference.without_small(mask, False, 1.0, 2.5)
    assert np.array_equal(found, picture("........ .######. .######. .######. .######. ........"))
    assert np.array_equal(reference.without_small(mask, False, 1.0, 1.5)[2:4, 5], [False, False])
    assert not reference.without_small(picture("..... .###. ....."), False, 1.0, 100.0)[0].any()


def test_ways_run_from_node_to_node():
    nodes, stops, pixels = reference.trace(picture("#...#.. .#.#... ..#.... ..#.... ..#...."))
    ways = np.split(pixels, stops[:-1])
    assert sorted(len(way) for way in ways) == [3, 3, 3]
    assert len(np.unique(nodes)) == 4
    for way in ways:
        assert np.abs(np.diff(way, axis=0)).max() == 1
        assert [2, 2] in way.tolist()


def test_a_ring_is_a_way_back_to_where_it_begins():
    nodes, stops, _ = reference.trace(picture(".##. #..# #..# .##."))
    assert nodes.tolist() == [[0, 0]]
    assert stops.tolist() == [9]


def test_how_far_pixels_go_straight_on():
    pixels = np.array([[1.0, 0], [4, 0.4], [6, 3], [9, 0], [-9, 0]])
    given_to = (pixels, np.zeros(2), np.array([1.0, 0]), 0.5)
    assert reference.straight_on(*given_to, (-5.0, 8.0)) == 4
    assert reference.straight_on(*given_to, (-5.0, 9.5)) == 9
    assert np.isnan(reference.straight_on(*given_to, (5.0, 8.0)))


# ---- the compiled kernels --------------------------------------------------------------


@pytest.fixture(scope="module")
def compiled():
    pytest.importorskip("numba", reason="numba, which is optional, is not installed")
    from stereosom.middle_line import compiled

    return compiled


def random_mask(seed, kind):
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 60, 2)
    if kind == "noise":
        return rng.random(shape) < rng.choice([0.02, 0.3, 0.6, 0.99])
    if kind == "clouds":
        noise = gaussian_filter(rng.normal(size=shape), rng.uniform(0.5, 6))
        return noise > np.quantile(noise, rng.uniform(0.3, 0.95))
    y, x = np.mgrid[: shape[0], : shape[1]]
    away = np.full(shape, np.inf)
    for angle, way in zip(rng.uniform(0, np.pi, 3), rng.uniform(0, 40, 3), strict=True):
        away = np.minimum(away, np.abs(x * np.cos(angle) + y * np.sin(angle) - way))
    return away < rng.uniform(0.5, 5)


@often
@given(st.integers(0, 10**6), st.sampled_from(PICTURES), st.sampled_from([1.0, 2.0, 5.0]))
def test_compiled_small_mask(compiled, seed, kind, wide):
    rng = np.random.default_rng(seed)
    pixels = pixels_of(random_mask(seed, kind))
    if len(pixels) == 0:
        pixels = np.zeros((1, 2))
    pixels = rng.permutation(np.vstack([pixels, pixels[:3]])) + rng.integers(-9, 900, 2)
    found, expected = compiled.small_mask(pixels, wide), reference.small_mask(pixels, wide)
    assert found[1:] == expected[1:]
    assert np.array_equal(found[0], expected[0])


@often
@given(
    st.integers(0, 10**6),
    st.sampled_from(PICTURES),
    st.booleans(),
    st.sampled_from([(0.05, np.inf), (0.5, np.inf), (1.0, 6.0), (1.0, 100.0)]),
)
def test_compiled_without_small(compiled, seed, kind, filled, small):
    mask = random_mask(seed, kind)
    found = compiled.without_small(mask, filled, *small)
    assert np.array_equal(found, reference.without_small(mask, filled, *small))


@often
@given(st.integers(0, 10**6), st.sampled_from(PICTURES))
def test_compiled_thin(compiled, seed, kind):
    mask = random_mask(seed, kind)
    assert np.array_equal(compiled.thin(mask), reference.thin(mask))


@often
@given(st.integers(0, 10**6), st.sampled_from(PICTURES), st.booleans())
def test_compiled_trace(compiled, seed, kind, thinned):
    mask = random_mask(seed, kind)
    skeleton = reference.thin(mask) if thinned else mask
    for found, expected in zip(compiled.trace(skeleton), reference.trace(skeleton), strict=True):
        assert np.array_equal(found, expected)


@often
@given(st.integers(0, 10**6))
def test_compiled_straight_on(compiled, seed):
    rng = np.random.default_rng(seed)
    heading = rng.normal(size=2)
    heading /= np.linalg.norm(heading)
    pixels, place = rng.integers(0, 30, (rng.integers(1, 99), 2)) * 1.0, rng.uniform(0, 30, 2)
    given_to = (pixels, place, heading, rng.uniform(0.3, 5), (-3.0, rng.uniform(1, 20)))
    expected = reference.straight_on(*given_to)
    assert compiled.straight_on(*given_to) == pytest.approx(expected, nan_ok=True)


def test_without_numba_numpy_does(monkeypatch):
    monkeypatch.setattr("stereosom.loops.find_spec", lambda _: None)
    kernels.cache_clear()
    assert kernels() is reference
    kernels.cache_clear()
