"""What the paper measures itself against: known answers, and an outside oracle."""

import numpy as np
import pytest

from stereosom import Camera, Observation, Options, Prior, StereoRig, reconstruct
from stereosom.backbone import Backbone
from stereosom.baselines.epipolar_search import epipolar_lines, match
from stereosom.baselines.point_cloud_som import order_cloud
from stereosom.baselines.voxel_carving import carve
from stereosom.metrics import closest_on_curve, distance_to_curve
from stereosom.synthetic import arc, converging_rig, observe, painted_bands, silhouette

RIG = converging_rig(60)
# Largest mean distance to a quarter circle of 60 mm, drawn 1 mm thick, in mm.
FARTHEST = {
    "point-cloud-som": 0.5,
    "epipolar-search": 0.5,
    "voxel-carving": 0.5,
    "needle-fit": 0.5,
    "stereo-som": 0.5,
    "joint-spline": 0.1,
}


@pytest.mark.parametrize("method", FARTHEST)
def test_a_quarter_circle(method):
    curve = arc(60, 90)
    result = reconstruct(
        observe(curve, 1.0, RIG), method=method, options=Options(prior=Prior(base=curve.base))
    )
    assert result.ok, result.reason
    assert result.method == method
    assert distance_to_curve(result.backbone.sample(50), curve).mean() < FARTHEST[method]
    _, at = closest_on_curve(result.backbone.sample(50), curve)
    assert np.diff(at).min() > -0.5
    assert np.ptp(at) > 0.9 * curve.length


def test_marker_arcs_follow_a_circle_through_its_bands():
    curve = arc(60, 90)
    masks = [np.zeros((768, 1024), dtype=bool) for _ in "ab"]
    for band in painted_bands(curve, 12):
        for mask, camera in zip(masks, (RIG.a, RIG.b), strict=True):
            mask |= silhouette(band, 1.0, camera)
    result = reconstruct(
        Observation.from_masks(masks[0], masks[1], RIG),
        method="marker-arcs",
        options=Options(prior=Prior(base=curve.base)),
    )
    assert result.ok, result.reason
    middle = result.backbone.arc_lengths(20)[3:-3]
    assert np.median(result.backbone.curvature(middle)) == pytest.approx(1 / 60, rel=0.05)
    assert distance_to_curve(result.backbone.sample(50), curve).mean() < 0.5


def test_the_conventional_map_agrees_with_minisom():
    """MiniSom's (1, k) map as an outside oracle: both lie along the middle of a noisy cloud."""
    minisom = pytest.importorskip("minisom")
    curve, rng = arc(60, 90), np.random.default_rng(5)
    cloud = curve(rng.uniform(0, curve.length, 1500)) + rng.normal(0, 0.8, (1500, 3))
    ours = order_cloud(cloud, 20)
    other = minisom.MiniSom(1, 20, 3, sigma=1.5, learning_rate=0.5, random_seed=1)
    other.random_weights_init(cloud)
    other.train_batch(cloud, 20_000)
    theirs = other.get_weights().reshape(20, 3)
    assert distance_to_curve(ours, curve).mean() < 0.6
    assert distance_to_curve(theirs, curve).mean() < 1.5
    spacing = curve.length / 20
    apart = np.linalg.norm(ours[:, None] - theirs, axis=2).min(axis=1)
    assert apart.mean() < spacing
    _, at = closest_on_curve(ours, curve)
    assert (np.diff(at) > 0).all() or (np.diff(at) < 0).all()


def test_the_search_is_that_of_two_loops():
    rng = np.random.default_rng(6)
    pixels_a, pixels_b = rng.uniform(300, 500, (60, 2)), rng.uniform(300, 500, (70, 2))
    lines = epipolar_lines(RIG, pixels_a)
    pairs = [
        (i, j)
        for i, line in enumerate(lines)
        for j, (x, y) in enumerate(pixels_b)
        if abs(line @ [x, y, 1]) <= 2.0
    ]
    in_a, in_b = match(RIG, pixels_a, pixels_b, 2.0)
    assert list(zip(in_a.tolist(), in_b.tolist(), strict=True)) == pairs
    assert len(pairs) > 10


def test_a_third_view_carves_more_away():
    line = Backbone.through([[0, 0, 40], [0, 5, 110]])
    cameras: list[Camera] = [RIG.a, RIG.b, converging_rig(170).a]
    views = []
    for camera in cameras:
        row, column = np.nonzero(silhouette(line, 2.0, camera))
        views.append((camera, np.column_stack([column, row]).astype(float)))
    bounds = np.array([[-15.0, -15, 30], [15, 20, 120]])
    two, three = (carve(views[:count], 0.5, bounds) for count in (2, 3))
    assert 0 < len(three) < len(two)
    assert distance_to_curve(three, line).max() < 2.0 / np.cos(np.radians(30)) + 1.0


@pytest.mark.parametrize("method", [*FARTHEST, "marker-arcs"])
@pytest.mark.parametrize("seed", [0, 1])
def test_noise_is_refused_or_answered_in_bounded_time(method, seed):
    rng = np.random.default_rng(seed)
    noise = [rng.random((768, 1024)) < 0.004 for _ in "ab"]
    result = reconstruct(Observation.from_masks(noise[0], noise[1], RIG), method=method)
    assert result.ok or result.reason


@pytest.mark.parametrize("method", [*FARTHEST, "marker-arcs"])
def test_nothing_and_one_place_are_refused(method):
    for pixels in (np.zeros((0, 2)), np.full((80, 2), 300.0)):
        result = reconstruct(Observation(pixels, pixels, StereoRig(RIG.a, RIG.b)), method=method)
        assert result.status == "failed"
        assert result.reason
