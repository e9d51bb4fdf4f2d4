"""Algorithm 1 on truth that another program has rendered, and on synthetic shapes."""

import json
from functools import partial

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

import stereosom
from stereosom import Observation, Options, Prior, StereoSomOptions
from stereosom.backbone import Backbone
from stereosom.metrics import curve_errors, distance_to_curve
from stereosom.stereo_som import stereo_som
from stereosom.synthetic import arc, converging_rig, observe

reconstruct = partial(stereosom.reconstruct, method="stereo-som")
track = partial(stereosom.track, method="stereo-som")

# Largest mean distance to the true curve, mm, and largest error of the tip. The thin devices
# show the method, the thick mock-up its sliding along the curve (the paper: 1.53 mm, registered).
TRUTH_TABLE = {
    "cannula_00": (0.3, 1.0),
    "cannula_01": (0.3, 1.0),
    "entering_00": (0.3, 1.0),
    "entering_01": (0.3, 1.0),
    "helix45_01": (2.0, 5.0),
    "helix45_03": (2.0, 5.0),
    "helix90_00": (2.5, 6.0),
}


def load_case(folder, edges=False):
    """A case of `shared/data/masks`, read without the plugin."""
    from stereosom import StereoRig

    cameras = json.loads((folder / "rig.json").read_text())["cameras"]
    rig = StereoRig.from_projections(
        *(camera["projection"] for camera in cameras),
        *(tuple(camera["image_size"]) for camera in cameras),
    )
    masks = [np.asarray(Image.open(folder / f"{view}.png")) > 127 for view in "ab"]
    if edges:
        masks = [mask & ~ndimage.binary_erosion(mask) for mask in masks]
    truth = Backbone.through(np.loadtxt(folder / "truth.csv", delimiter=",", skiprows=1))
    kind = "edges" if edges else "filled"
    return Observation.from_masks(*masks, rig, kind=kind), truth


@pytest.mark.parametrize("case", TRUTH_TABLE)
def test_truth_set(shared_data, case):
    observation, truth = load_case(shared_data / "masks" / case)
    result = reconstruct(observation)
    assert result.ok, result.reason
    farthest, tip = TRUTH_TABLE[case]
    errors = curve_errors(result.backbone, truth)
    assert errors.distance < farthest
    assert errors.tip < tip
    assert result.radius == pytest.approx(
        json.loads((shared_data / "masks" / case / "case.json").read_text())["radius_mm"], rel=0.05
    )


def test_the_papers_own_setting(shared_data):
    """Edge pixels, known base, direction and height, no reaching for the ends."""
    observation, truth = load_case(shared_data / "masks" / "helix45_03", edges=True)
    prior = Prior(base=truth.base, direction=truth.tangent(0.0), length=150)
    result = stereo_som(observation, options=StereoSomOptions(prior=prior, reach_ends=False))
    errors = curve_errors(result.backbone, truth)
    assert errors.distance < 1.53
    assert errors.length < -3  # batch training pulls the ends inward, as the paper shows
    assert result.reason == ""  # with all of the prior known, nothing was assumed


def test_reaching_the_ends_mends_what_batch_training_pulls_inward():
    curve, rig = arc(60, 90), converging_rig(60)
    seen = observe(curve, 1.0, rig)
    with_ends = reconstruct(seen, options=StereoSomOptions())
    as_printed = reconstruct(seen, options=StereoSomOptions(reach_ends=False))
    assert as_printed.backbone.length < curve.length - 2
    assert with_ends.backbone.length > curve.length - 1


def test_more_passes_of_the_loop_pull_the_views_together(shared_data):
    observation, truth = load_case(shared_data / "masks" / "cannula_00")
    once, often = (
        curve_errors(
            reconstruct(observation, options=StereoSomOptions(max_iterations=n)).backbone, truth
        ).distance
        for n in (1, 10)
    )
    assert often < 0.5 * once


def test_a_prior_base_decides_the_direction():
    curve, rig = arc(60, 90), converging_rig(60)
    seen = observe(curve, 1.0, rig)
    for base, tip in ((curve.base, curve.tip), (curve.tip, curve.base)):
        result = reconstruct(seen, options=Options(prior=Prior(base=base)))
        assert np.linalg.norm(result.backbone.base - base) < 3
        assert np.linalg.norm(result.backbone.tip - tip) < 3
        assert "nearest to the given one" in result.reason


def test_the_previous_curve_decides_the_direction_while_tracking():
    rig = converging_rig(60)
    shapes = [arc(60, angle) for angle in (80, 85, 90)]
    options = Options(prior=Prior(base=shapes[0].tip))  # against what would be guessed
    results = list(track((observe(s, 1.0, rig) for s in shapes), options=options))
    for shape, result in zip(shapes, results, strict=True):
        assert np.linalg.norm(result.backbone.tip - shape.base) < 3
    assert results[2].reason == ""


def test_a_frame_without_a_device_is_carried_over_and_the_next_is_done():
    rig, curve = converging_rig(60), arc(60, 90)
    nothing = Observation(np.zeros((0, 2)), np.zeros((0, 2)), rig, time=0.1, index=1)
    run = [observe(curve, 1.0, rig), nothing, observe(curve, 1.0, rig)]
    results = list(track(run))
    assert [result.status for result in results] == ["ok", "predicted", "ok"]
    assert results[1].reason.startswith("view a: no device in the picture; carried on")


def test_a_jump_of_the_device_is_caught_by_starting_afresh():
    rig = converging_rig(60)
    far = arc(20, 60).transformed(np.diag([-1.0, -1, 1]), [-40, 30, 90])
    results = list(track([observe(arc(60, 90), 1.0, rig), observe(far, 1.0, rig)]))
    assert results[1].ok
    assert distance_to_curve(far.sample(50), results[1].backbone).max() < 4


def test_why_frames_could_not_be_read_is_the_reason():
    rig = converging_rig(60)
    result = reconstruct(Observation([], [], rig, defect="frame 3 is broken"))
    assert (result.status, result.reason) == ("failed", "frame 3 is broken")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"reference_vectors": 2}, "at least 3"),
        ({"epochs": 0}, "at least 1"),
        ({"neighborhood": -1}, "at least 0"),
        ({"points_per_view": 49}, "cannot train 50"),
        ({"max_mismatch": 0.0}, "must be a positive"),
        ({"degree": 1.5}, "whole number"),
    ],
)
def test_options_out_of_range_are_refused(change, says):
    with pytest.raises(ValueError, match=says):
        StereoSomOptions(**change)


def test_an_unknown_method_names_those_that_exist():
    with pytest.raises(ValueError, match="there are joint-spline"):
        stereosom.reconstruct(observe(arc(), 1.0, converging_rig()), method="magic")


@pytest.mark.parametrize("seed", range(8))
def test_noise_for_masks_fails_with_a_reason(seed):
    rng, rig = np.random.default_rng(seed), converging_rig(60)
    noise = [rng.random((768, 1024)) < 0.02 for _ in "ab"]
    result = reconstruct(Observation.from_masks(*noise, rig))
    assert result.status == "failed"
    assert result.reason
