"""How long the methods take, side by side in one run.

    python -m pytest tests/benchmark -m benchmark --benchmark-columns=median,ops \
        --benchmark-group-by=group

asserts nothing about time: compare the medians within a group. docs/experiments/speed.md quotes
such a run.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from stereosom import Observation, Prior, StereoSomOptions, track
from stereosom.baselines.epipolar_search import EpipolarSearchOptions, epipolar_search, match
from stereosom.baselines.point_cloud_som import order_cloud
from stereosom.baselines.voxel_carving import voxel_carving
from stereosom.joint_spline import joint_spline
from stereosom.som import Trainer, train_epoch
from stereosom.stereo_som import stereo_som, train_stereo_map
from stereosom.synthetic import converging_rig, growing_helix, observe

pytestmark = pytest.mark.benchmark

CURVE, RIG = growing_helix(), converging_rig(45)
SEEN = observe(CURVE, 3.2, RIG)
PRIOR = Prior(base=CURVE.base, direction=[0, 0, 1], length=150)


def drawn(count, seed=0):
    """So many random pixels of each view."""
    rng = np.random.default_rng(seed)
    return tuple(
        pixels[rng.choice(len(pixels), count, replace=False)]
        for pixels in (SEEN.pixels_a, SEEN.pixels_b)
    )


def line(count):
    return np.linspace([0, 0, 0], [0, 0, 150], count)


@pytest.mark.parametrize("vectors", [20, 50, 100])
@pytest.mark.benchmark(group="stereo map, cold, 800 points a view, one pass, by vectors")
def test_stereo_map_by_reference_vectors(benchmark, vectors):
    points, options = drawn(800), StereoSomOptions(reference_vectors=vectors, max_iterations=1)
    benchmark(train_stereo_map, RIG, points, line(vectors), options)


@pytest.mark.parametrize("count", [400, 800, 1600, 3200])
@pytest.mark.benchmark(group="stereo map, cold, 50 vectors, one pass, by points a view")
def test_stereo_map_by_points(benchmark, count):
    points = drawn(count)
    options = StereoSomOptions(points_per_view=count, max_iterations=1)
    benchmark(train_stereo_map, RIG, points, line(50), options)


@pytest.mark.parametrize("how", ["readable", "fast"])
@pytest.mark.benchmark(group="one epoch, 800 points, 50 vectors")
def test_epoch(benchmark, how):
    points, references = drawn(800)[0], RIG.a.project(line(50))
    if how == "fast":
        benchmark(Trainer(points).epoch, references, 1)
    else:
        benchmark(train_epoch, points, references, 1)


@pytest.mark.benchmark(group="map on the same number of points")
def test_conventional_map_on_a_cloud(benchmark):
    rng = np.random.default_rng(0)
    cloud = CURVE(rng.uniform(0, CURVE.length, 800)) + rng.normal(0, 1.5, (800, 3))
    benchmark(order_cloud, cloud, 50)


@pytest.mark.benchmark(group="map on the same number of points")
def test_stereo_map_on_two_views(benchmark):
    points, options = drawn(800), StereoSomOptions(max_mismatch=0.01)
    benchmark(train_stereo_map, RIG, points, line(50), options)


@pytest.mark.benchmark(group="what corresponds to what, and nothing else")
def test_correspondence_by_the_stereo_map(benchmark):
    points, options = drawn(800), StereoSomOptions(max_mismatch=0.01)
    benchmark(train_stereo_map, RIG, points, line(50), options)


@pytest.mark.parametrize("count", [800, None])
@pytest.mark.benchmark(group="what corresponds to what, and nothing else")
def test_correspondence_by_search(benchmark, count):
    points = drawn(count) if count else (SEEN.pixels_a, SEEN.pixels_b)
    benchmark.pedantic(match, (RIG, *points, 0.5), rounds=5, iterations=1, warmup_rounds=1)


WHOLE = {
    "joint-spline": lambda: joint_spline(SEEN),
    "stereo-som, one pass as printed": lambda: stereo_som(
        SEEN, options=StereoSomOptions(prior=PRIOR, max_mismatch=0.01, reach_ends=False)
    ),
    "stereo-som, default": lambda: stereo_som(SEEN),
    "epipolar search, 800 points": lambda: epipolar_search(
        SEEN, options=EpipolarSearchOptions(points_per_view=800)
    ),
    "epipolar search, all pixels": lambda: epipolar_search(
        SEEN, options=EpipolarSearchOptions(points_per_view=None)
    ),
    "voxel carving": lambda: voxel_carving(SEEN),
}


@pytest.mark.parametrize("method", WHOLE)
@pytest.mark.benchmark(group="one frame from masks, whole methods")
def test_whole_method(benchmark, method):
    benchmark.pedantic(WHOLE[method], rounds=3, iterations=1, warmup_rounds=1)


@pytest.mark.benchmark(group="tracking, one pair of a thin moving device")
def test_tracking(benchmark):
    """Each round is one pair: the device goes to and fro, and time goes on."""
    shapes = [growing_helix(150 + 0.3 * k, 110, 0.9 + 0.001 * k) for k in range(30)]
    there = [observe(shape, 0.4, RIG) for shape in shapes]
    assert max(len(one.pixels_a) for one in there) < 2000
    to_and_fro = itertools.islice(itertools.cycle(there + there[-2:0:-1]), 1020)
    made = [replace(one, index=index, time=index / 30) for index, one in enumerate(to_and_fro)]
    run = track(made)
    result = benchmark.pedantic(lambda: next(run), rounds=1000, iterations=1, warmup_rounds=20)
    assert result.ok
    if benchmark.stats is not None:  # None where nothing is measured
        seconds = np.array(benchmark.stats.stats.sorted_data)
        print(
            f"\ntracking: {1 / np.median(seconds):.0f} pairs/s by the median pair; the 99th "
            f"percentile is {np.percentile(seconds, 99) / np.median(seconds):.1f} times the median"
        )


def test_they_reconstruct_the_same_device():
    """What is timed must work: all of them find the mock-up."""
    for method in WHOLE.values():
        assert method().backbone.length == pytest.approx(239, abs=40)
    assert isinstance(SEEN, Observation)
