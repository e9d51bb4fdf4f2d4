"""Whatever is given: a result, or one clear ValueError, in bounded time."""

import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stereosom import Observation, Prior, StereoSomOptions, reconstruct
from stereosom.reconstruction import HardFrame
from stereosom.stereo_som import stereo_som
from stereosom.synthetic import arc, converging_rig, growing_helix, observe

RIG = converging_rig(60)
SEEN = [observe(arc(60, 90), 1.0, RIG), observe(growing_helix(), 3.2, RIG)]
BLOB = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0)), axis=-1).reshape(-1, 2)

numbers = st.floats(allow_nan=True, allow_infinity=True)
vectors = st.none() | st.tuples(numbers, numbers, numbers) | st.tuples(*[st.floats(-900, 900)] * 3)
priors = st.fixed_dictionaries(
    {"base": vectors, "direction": vectors, "length": st.none() | numbers | st.floats(1, 500)}
)
options = st.fixed_dictionaries(
    {},
    optional={
        "reference_vectors": st.integers(-2, 120) | numbers,
        "epochs": st.integers(-1, 12) | numbers,
        "points_per_view": st.integers(-1, 900) | numbers,
        "neighborhood": st.integers(-1, 60),
        "max_mismatch": numbers,
        "max_iterations": st.integers(-1, 4),
        "degree": st.integers(-1, 25),
        "reach_ends": st.booleans(),
        "seed": st.integers(-1, 2**70),
    },
)
slow_machine = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)


@slow_machine
@given(st.sampled_from(SEEN), priors, options)
def test_any_options_give_a_result_or_one_clear_error(seen, prior, chosen):
    started = time.monotonic()
    refusal = result = None
    try:
        result = reconstruct(
            seen,
            method="stereo-som",
            options=StereoSomOptions(prior=Prior(**prior), **chosen),
        )
    except ValueError as error:
        refusal = str(error)
    if refusal is not None:
        assert ":" in refusal
        assert "\n" not in refusal
    elif result.ok:
        s = result.backbone.arc_lengths(20)
        assert np.isfinite(result.backbone(s)).all()
        assert np.isfinite(result.standard_deviation_at(s)).all()
    else:
        assert result.reason
    assert time.monotonic() - started < 20  # no hang; far above any honest time


@pytest.mark.parametrize(
    ("pixels", "says"),
    [
        (BLOB[:49] + 300, "49 device pixels are fewer than the 50 reference vectors"),
        (np.full((100, 2), 300.0), "one place"),
        (np.vstack([BLOB + 100, np.add(BLOB, [700, 500])]), "too far|separate pieces"),
        (np.vstack([BLOB + 400, np.add(BLOB, [405, 500])]), "separate pieces"),
        (np.vstack([BLOB + 400, np.add(BLOB, [600, 400])]), "separate pieces"),
    ],
)
def test_pixels_that_show_no_device(pixels, says):
    with pytest.raises(HardFrame, match=says):
        stereo_som(Observation(pixels, pixels, RIG))


def test_points_in_one_place_with_all_of_the_prior_known():
    prior = Prior(base=[0, 0, 0], direction=[0, 0, 1], length=100)
    here = np.full((100, 2), 300.0)
    with pytest.raises(HardFrame, match="fewer than three"):
        stereo_som(Observation(here, here, RIG), options=StereoSomOptions(prior=prior))


@pytest.mark.parametrize("base", [[2000.0, 0, 0], [700.0, 300, 75]])
def test_a_start_behind_or_in_the_plane_of_a_camera(base):
    prior = Prior(base=base, direction=[1, 0, 0], length=100)
    with pytest.raises(HardFrame, match="behind camera"):
        stereo_som(SEEN[0], options=StereoSomOptions(prior=prior))


@pytest.mark.slow
@pytest.mark.usefixtures("compiled_loops")
@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0001, 0.02), st.integers(0, 6))
def test_garbage_for_masks_fails_with_its_reason(seed, share, smoothing):
    from scipy import ndimage

    rng = np.random.default_rng(seed)
    masks = []
    for _ in "ab":
        noise = ndimage.gaussian_filter(rng.random((768, 1024)), smoothing)
        masks.append(noise > np.quantile(noise, 1 - share))
    for method in ("joint-spline", "stereo-som"):
        started = time.monotonic()
        result = reconstruct(Observation.from_masks(*masks, RIG), method=method)
        assert time.monotonic() - started < 20
        if result.ok:
            assert np.isfinite(result.backbone.sample(20)).all()
        else:
            assert result.reason
