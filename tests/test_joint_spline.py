"""The joint spline on truth that another program has rendered."""

import json

import numpy as np
import pytest
from PIL import Image

from stereosom import Observation, Options, Prior, StereoRig, reconstruct
from stereosom.backbone import Backbone
from stereosom.matching import match_monotone
from stereosom.metrics import closest_on_curve, curve_errors
from stereosom.middle_line import middle_line
from stereosom.refine import search
from stereosom.refine.contour import mask_contour
from stereosom.refine.reference import ROUND, outline
from stereosom.refine.search import TubeSearch
from stereosom.synthetic import arc, converging_rig, growing_helix, observe

# Mean at equal arc length and error of the tip, mm, without registration, ends included.
TRUTH_TABLE = {
    "helix45_00": (0.10, 0.25),
    "helix45_01": (0.10, 0.25),
    "helix45_02": (0.10, 0.25),
    "helix45_03": (0.10, 0.25),
    "helix20_00": (0.15, 0.40),
    "helix20_01": (0.15, 0.40),
    "helix90_00": (0.15, 0.40),
    "helix90_01": (0.15, 0.40),
    "cannula_00": (0.10, 0.30),
    "cannula_01": (0.10, 0.30),
    "loop_00": (0.15, 0.50),
    "loop_01": (0.15, 0.50),
    "dirty_00": (0.30, 1.00),
    "dirty_01": (0.30, 1.00),
    "entering_00": (0.10, 0.30),
    "entering_01": (0.10, 0.30),
}


def load_case(folder):
    cameras = json.loads((folder / "rig.json").read_text())["cameras"]
    rig = StereoRig.from_projections(
        *(camera["projection"] for camera in cameras),
        *(tuple(camera["image_size"]) for camera in cameras),
    )
    masks = [np.asarray(Image.open(folder / f"{view}.png")) > 127 for view in "ab"]
    truth = Backbone.through(np.loadtxt(folder / "truth.csv", delimiter=",", skiprows=1))
    return Observation.from_masks(*masks, rig), truth


@pytest.mark.parametrize("case", TRUTH_TABLE)
def test_truth_set(shared_data, case):
    observation, truth = load_case(shared_data / "masks" / case)
    result = reconstruct(observation, method="joint-spline")
    assert result.ok, result.reason
    if case.startswith("entering"):  # compare what both views see
        _, at = closest_on_curve(result.backbone.sample(200), truth)
        truth = truth.between(at.min(), truth.length)
    mean, tip = TRUTH_TABLE[case]
    errors = curve_errors(result.backbone, truth)
    assert errors.mean < mean
    assert errors.distance < 0.6 * mean
    assert errors.tip < tip
    radius = json.loads((shared_data / "masks" / case / "case.json").read_text())["radius_mm"]
    assert result.radius == pytest.approx(radius, rel=0.01)


def test_most_points_lie_within_what_it_says_of_itself(shared_data):
    beyond = []
    for case in TRUTH_TABLE:
        observation, truth = load_case(shared_data / "masks" / case)
        result = reconstruct(observation, method="joint-spline")
        s = result.backbone.arc_lengths(100)[5:-5]
        distance, _ = closest_on_curve(result.backbone(s), truth)
        beyond.append(np.mean(distance > 2.45 * result.standard_deviation_at(s)))
    assert np.mean(beyond) < 0.2


def test_it_is_the_default_and_needs_filled_masks():
    seen = observe(arc(60, 90), 1.0, converging_rig(60))
    assert reconstruct(seen).method == "joint-spline"
    edges = Observation(seen.pixels_a, seen.pixels_b, seen.rig, kind="edges")
    assert "needs filled masks" in reconstruct(edges).reason


def test_a_given_radius_stays():
    seen = observe(arc(60, 90), 1.0, converging_rig(60))
    result = reconstruct(seen, options=Options(prior=Prior(radius=1.02)))
    assert result.radius == pytest.approx(1.02)


def test_the_middle_line_goes_straight_on_where_a_device_crosses_itself():
    angle = np.linspace(-2.2, 2.2, 900)  # a loop: y = sin(2t), x = sin(t) would cross at 0
    way = np.column_stack([300 + 150 * np.sin(2 * angle / 1.4), 300 + 200 * np.sin(angle / 1.4)])
    y, x = np.mgrid[0:600, 0:600]
    mask = np.zeros((600, 600), dtype=bool)
    for px, py in way[::2]:
        near = (slice(int(py) - 8, int(py) + 9), slice(int(px) - 8, int(px) + 9))
        mask[near] |= (x[near] - px) ** 2 + (y[near] - py) ** 2 < 36
    row, column = np.nonzero(mask)
    line = middle_line(np.column_stack([column, row]).astype(float), 200)
    steps = np.linalg.norm(line.points[:, None] - way, axis=2).argmin(axis=1)
    assert abs(np.sum(np.sign(np.diff(steps)))) > 185  # in order all the way, but for noise
    assert line.width == pytest.approx(12, rel=0.25)


@pytest.mark.parametrize("angle", [20, 45, 90])
def test_a_device_with_rounded_ends_reaches_to_the_middles_of_their_balls(angle):
    device = growing_helix(200, 110, 1.0)  # drawn as balls along it
    result = reconstruct(observe(device, 3.2, converging_rig(angle)))
    ends = np.stack([result.backbone.base, result.backbone.tip])
    away = np.linalg.norm(ends[:, None] - np.stack([device.base, device.tip]), axis=2)
    assert away.min(axis=1).max() < 0.1
    assert result.backbone.length == pytest.approx(device.length, abs=0.15)


def test_what_is_searched_for_anew_keeps_its_direction_and_its_rounded_end():
    device = growing_helix(200, 110, 1.0)
    seen = observe(device, 3.2, converging_rig(60))
    begun = TubeSearch.of(seen, None, None)
    curve = device.polyline(121)
    forth = begun.anywhere(curve, (False, True))
    back = begun.anywhere(curve[::-1], (True, False))
    for fit, expected in ((forth, curve), (back, curve[::-1])):
        np.testing.assert_allclose(fit.tube.curve[[0, -1]], expected[[0, -1]], atol=1.0)
    assert forth.tube.capped[1] == back.tube.capped[0] == ROUND


def test_a_fit_that_stopped_soon_goes_on_where_its_ends_are_as_they_are(monkeypatch):
    device = growing_helix(200, 110, 1.0)
    begun = TubeSearch.of(observe(device, 1.5, converging_rig(90)), None, None)
    monkeypatch.setattr(search, "_SOON", 6)
    passes = []
    fit_tube = search.fit_tube
    monkeypatch.setattr(
        search, "fit_tube", lambda *a, **k: passes.append(k.get("passes")) or fit_tube(*a, **k)
    )
    monkeypatch.setattr(search, "with_better_ends", lambda rig, fit, edges, refit: fit)
    assert begun.anywhere().settled
    assert passes == [6, None]


def test_matching_leaves_an_unseen_end_without_partner():
    height = np.linspace(0, 500, 80)
    matching = match_monotone(height, height[:60])
    assert matching.in_a[-1] == pytest.approx(59, abs=1)
    assert np.abs(height[matching.in_a] - height[matching.in_b]).max() < 7


def test_the_contour_of_a_disc_is_its_circle():
    y, x = np.mgrid[0:80, 0:80]
    row, column = np.nonzero((x - 40.3) ** 2 + (y - 39.8) ** 2 < 30**2)
    contour = mask_contour(np.column_stack([column, row]).astype(float))
    from_middle = contour.points - [40.3, 39.8]
    radius = np.linalg.norm(from_middle, axis=1)
    assert radius.mean() == pytest.approx(30, abs=0.05)
    outward = np.sum(contour.directions * from_middle / radius[:, None], axis=1)
    assert outward.min() > 0.95


def test_a_flat_end_seen_obliquely_shows_half_an_ellipse():
    # A vertical tube of 3 mm, its end 40 mm below cameras 700 mm away: sin(40/700) of a radius.
    z = np.linspace(35.0, 115.0, 50)
    curve, up = np.column_stack([0 * z, 0 * z, z]), np.tile([0.0, 0, 1], (50, 1))
    camera = converging_rig(60).a
    capped = np.array([1, 1])
    picture, *_ = outline(camera.projection, camera.center, curve, up, 3.0, capped)
    below = picture[:, 1].max() - camera.project(curve[:1])[0, 1]
    assert below == pytest.approx(3.0 * (40 / 701) * 2400 / 700, rel=0.1)


@pytest.mark.parametrize("case", ["epipolar_00", "epipolar_01"])
def test_along_an_epipolar_plane_points_lie_in_their_regions_or_are_flagged(shared_data, case):
    observation, truth = load_case(shared_data / "masks" / case)
    result = reconstruct(observation)
    s = result.backbone.arc_lengths(100)[1:-1]
    distance, _ = closest_on_curve(result.backbone(s), truth)
    # The square root of 5.99, the 95 % point of χ² with two degrees of freedom.
    inside = distance < 2.448 * result.standard_deviation_at(s)
    assert np.all(inside | ~result.determined_at(s))
    assert not result.determined_at(s).all()


@pytest.mark.slow
def test_random_masks_end_in_a_result_or_a_reason():
    rig = converging_rig(60)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        masks = []
        for _ in "ab":
            mask = np.zeros((768, 1024), dtype=bool)
            for _ in range(rng.integers(1, 12)):
                row, column = rng.integers(0, 700), rng.integers(0, 950)
                high, wide = rng.integers(1, 200, 2)
                mask[row : row + high, column : column + wide] = rng.random() < 0.8
            masks.append(mask)
        result = reconstruct(Observation.from_masks(masks[0], masks[1], rig))
        if result.ok:
            assert np.isfinite(result.backbone.sample(20)).all()
            assert np.isfinite(result.covariance).all()
        else:
            assert result.reason
