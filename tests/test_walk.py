"""A guess that is off by more than the device is wide is brought onto the masks."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereosom import track
from stereosom.backbone import Backbone
from stereosom.metrics import curve_errors, distance_to_curve
from stereosom.refine import reference, search
from stereosom.refine.walked import walked
from stereosom.synthetic import converging_rig, observe

SIZE = {"focal_length": 1600.0, "image_size": (640, 480)}
RIG = converging_rig(70, **SIZE)
RADIUS = 1.5
SHARP = (False, False)


def swung(degrees, length=110.0):
    """A bent device whose farther half is swung about its middle, and bends more for it."""
    s = np.linspace(-length / 2, length / 2, 200)
    lean = 0.2 + 0.006 * s + np.radians(degrees) * np.clip(2 * s / length, 0, None)
    aside = 0.4 + 0.01 * s
    ways = np.column_stack(
        [np.sin(lean) * np.cos(aside), np.sin(lean) * np.sin(aside), np.cos(lean)]
    )
    points = np.cumsum(ways, axis=0) * (s[1] - s[0])
    return Backbone.through(points - points[100] + [0, 0, 75])


def guess_of(curve):
    return curve.polyline(121)


@pytest.mark.parametrize("degrees", [-25, 20, 40])
def test_a_guess_is_brought_onto_a_device_that_swung(degrees):
    true = swung(degrees)
    guess = guess_of(swung(0))
    assert distance_to_curve(guess, true).max() > 5 * RADIUS
    found = walked(observe(true, RADIUS, RIG), guess, RADIUS, SHARP)
    assert distance_to_curve(found, true).max() < RADIUS
    assert np.linalg.norm(found[0] - true.base) < 2 * RADIUS
    assert np.linalg.norm(found[-1] - true.tip) < 2 * RADIUS


def test_it_goes_to_where_the_device_ends_now():
    whole, guess = swung(10), guess_of(swung(0))
    for true in (whole.between(0, 0.8 * whole.length), swung(10, length=125)):
        found = walked(observe(true, RADIUS, RIG), guess, RADIUS, SHARP)
        assert np.linalg.norm(found[-1] - true.tip) < 2 * RADIUS


def test_half_a_ball_ends_a_radius_before_its_mask_does():
    # What `observe` draws has half a ball at its ends.
    true, guess = swung(30), guess_of(swung(0))
    seen = observe(true, 4.0, RIG)
    sharp, rounded = (walked(seen, guess, 4.0, ends) for ends in (SHARP, (True, True)))
    for end, place in ((0, true.base), (-1, true.tip)):
        assert np.linalg.norm(rounded[end] - place) < 1.5
        assert np.linalg.norm(sharp[end] - place) > 2.0


def test_a_guess_that_is_near_is_left_to_the_fit():
    guess = guess_of(swung(0))
    assert walked(observe(swung(2), RADIUS, RIG), guess, RADIUS, SHARP) is guess


def test_a_guess_that_lies_on_both_masks_is_not_walked():
    true = swung(0)
    seen, rounded = observe(true, RADIUS, RIG), np.array(SHARP)
    views = RIG.a.projection, seen.pixels_a, RIG.b.projection, seen.pixels_b
    inner = true.between(2.0, true.length - 2.0)
    path, _ = reference.walk(*views, guess_of(inner), RADIUS, rounded)
    assert len(path) == 0
    path, _ = reference.walk(*views, guess_of(swung(20)), RADIUS, rounded)
    assert len(path) > 100


def test_a_guess_elsewhere_is_left_as_it_is():
    guess = guess_of(swung(0))
    away = swung(0).transformed(np.eye(3), [30.0, 30.0, 0])
    assert walked(observe(away, RADIUS, RIG), guess, RADIUS, SHARP) is guess


def test_what_swings_to_and_fro_is_followed(monkeypatch):
    searched, anywhere = [], search.TubeSearch.anywhere
    monkeypatch.setattr(
        search.TubeSearch, "anywhere", lambda *a: searched.append(0) or anywhere(*a)
    )
    curves = [swung(degrees) for degrees in (0, 20, 35, 20, -5, -25, 0)]
    run = [observe(curve, RADIUS, RIG, time=k / 15) for k, curve in enumerate(curves)]
    run = [type(seen)(**{**seen.__dict__, "index": k}) for k, seen in enumerate(run)]
    for true, result in zip(curves, track(run), strict=True):
        assert result.ok
        errors = curve_errors(result.backbone, true)
        assert errors.distance < 0.2
        assert errors.tip < 2 * RADIUS  # rounded, and no part of the curve
    assert len(searched) == 1  # the first


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(-40, 40),
    st.sampled_from([0.3, 1.5, 4.0]),
    st.tuples(st.booleans(), st.booleans()),
)
def test_compiled_walk(seed, degrees, radius, rounded):
    pytest.importorskip("numba", reason="numba, which is optional, is not installed")
    from stereosom.refine import compiled

    rng = np.random.default_rng(seed)
    rig = converging_rig(rng.uniform(5, 90), **SIZE)
    seen = observe(swung(degrees), radius, rig)
    kept_a, kept_b = (
        pixels[rng.random(len(pixels)) < rng.choice([1.0, 0.99, 0.7])]
        for pixels in (seen.pixels_a, seen.pixels_b)
    )
    guess = guess_of(swung(0)) + rng.normal(0, 0.5, 3)
    given_to = (
        rig.a.projection, kept_a, rig.b.projection, kept_b, guess, radius, np.array(rounded)
    )  # fmt: skip
    (found, first), (expected, begun) = compiled.walk(*given_to), reference.walk(*given_to)
    assert first == begun
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, atol=1e-6)
