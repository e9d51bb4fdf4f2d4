"""The bound on what two silhouettes determine, and the noise that it is computed for."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stereosom.backbone import Backbone
from stereosom.synthetic import arc, converging_rig
from stereosom_plugin.calibration import read_rig
from stereosom_plugin.evaluation import read_truth
from stereosom_plugin.experiments.cramer_rao import PIXEL_DEVIATION, cramer_rao_bound


def upright(length=100.0):
    """A straight device along z, across the baseline of `converging_rig`."""
    return Backbone.through([[0, 0, 75 - length / 2], [0, 0, 75 + length / 2]])


def test_a_straight_tube_is_as_uncertain_as_the_mean_of_its_edge_points():
    # Four control points make one cubic. Fitted to N offsets of deviation σ, evenly along a line,
    # its variance is σ²/N times the sum of squares of the four normalized Legendre polynomials.
    # Views at right angles, from very far: each measures one of the directions across.
    length, angle, distance, focal = 100.0, 90.0, 1e5, 2400 / 700 * 1e5
    rig = converging_rig(angle, distance=distance, focal_length=focal)
    bound = cramer_rao_bound(
        upright(length), 1.5, rig, deviation_px=0.5, control_points=4, radius_known=True, count=101
    )
    mm = distance / focal
    edge_points = 2 * length / mm  # one a pixel, along both rims, in one view
    share = np.linspace(-1, 1, 101)
    legendre = np.polynomial.legendre.legvander(share, 3)
    leverage = np.sum(legendre**2 * (2 * np.arange(4) + 1), axis=1)
    expected = 0.5 * mm * np.sqrt(leverage / edge_points)
    inside = slice(10, -10)
    found = bound.standard_deviation
    # The flat ends and the tilt of the rims add a little to what the rims tell.
    assert np.all(found[inside] <= 1.001 * expected[inside])
    np.testing.assert_allclose(found[inside], expected[inside], rtol=0.05)


def test_deviation_falls_with_the_root_of_the_points():
    # Twice the focal length, twice the pixels along the outline, each half as large.
    coarse, fine = (
        cramer_rao_bound(upright(), 1.5, converging_rig(60, focal_length=f, image_size=size))
        for f, size in ((2400, (1024, 768)), (4800, (2048, 1536)))
    )
    ratio = coarse.standard_deviation / fine.standard_deviation
    np.testing.assert_allclose(ratio, 2 * np.sqrt(2), rtol=1e-3)


def test_twice_the_noise_is_twice_the_deviation():
    bounds = [
        cramer_rao_bound(arc(60, 90), 2.0, converging_rig(45), deviation_px=sigma)
        for sigma in (0.2, 0.4)
    ]
    ratio = bounds[1].standard_deviation / bounds[0].standard_deviation
    # A kilometer is known beforehand: it holds the sliding of the curve along itself a little.
    np.testing.assert_allclose(ratio, 2, rtol=1e-3)
    scaled = bounds[0].scaled(2).standard_deviation
    np.testing.assert_allclose(scaled, bounds[1].standard_deviation, rtol=1e-3)


def test_narrower_angles_know_less():
    deviations = [
        cramer_rao_bound(upright(), 2.0, converging_rig(angle)).standard_deviation[50]
        for angle in (90, 45, 20, 10)
    ]
    assert np.all(np.diff(deviations) > 0)
    # Depth is as uncertain as the offsets over the sine of half the angle.
    expected = np.sin(np.radians(45)) / np.sin(np.radians([45, 22.5, 10, 5]))
    np.testing.assert_allclose(np.divide(deviations, deviations[0]), expected, rtol=0.03)


def test_along_the_baseline_only_the_width_tells_the_depth():
    # The baseline of `converging_rig` is y, at z = 75: this device lies in an epipolar plane.
    level = Backbone.through([[0, -50, 75], [0, 50, 75]])
    rig = converging_rig(60)
    across = cramer_rao_bound(upright(), 1.5, rig).standard_deviation[50]
    seen = cramer_rao_bound(level, 1.5, rig, radius_known=True).standard_deviation[50]
    unseen = cramer_rao_bound(level, 1.5, rig, width_seen=False).standard_deviation[50]
    assert across < 0.05
    assert 20 * across < seen < unseen
    assert unseen > 100


def test_a_point_outside_the_pictures_tells_nothing():
    rig = converging_rig(60)
    long = Backbone.through([[0, 0, -200], [0, 0, 75]])
    bound = cramer_rao_bound(long, 1.5, rig)
    assert bound.standard_deviation[0] > 100
    assert bound.standard_deviation[-10] < 0.1
    seen = cramer_rao_bound(long, 1.5, rig, stretch=(200, 275))
    assert list(np.flatnonzero(seen.ends)) == [99]
    assert seen.standard_deviation.max() < 0.2


@pytest.mark.parametrize(
    ("case", "least", "most"),
    [("helix45_00", 0.017, 0.023), ("helix45_03", 0.017, 0.023), ("helix90_00", 0.01, 0.017)],
)
def test_a_mockup_can_be_known_to_two_hundredths_of_a_millimeter(shared_data, case, least, most):
    folder = shared_data / "masks" / case
    bound = cramer_rao_bound(
        read_truth(folder / "truth.csv"),
        json.loads((folder / "case.json").read_text(encoding="utf-8"))["radius_mm"],
        read_rig(folder / "rig.json")[0],
    )
    assert least < np.median(bound.standard_deviation) < most


def test_epipolar_cases_are_open_by_millimeters_and_one_more_than_the_other(shared_data):
    worst = []
    for case in ("epipolar_00", "epipolar_01"):
        folder = shared_data / "masks" / case
        truth, (rig, *_) = read_truth(folder / "truth.csv"), read_rig(folder / "rig.json")
        for width_seen in (True, False):
            bound = cramer_rao_bound(truth, 1.5, rig, width_seen=width_seen)
            worst.append(bound.standard_deviation.max())
    assert 1 < worst[0] < worst[1] < 3
    assert 2 < worst[2] < 3
    assert worst[3] > 2.5 * worst[1]


# ---- the noise -----------------------------------------------------------------------


def test_a_rough_edge_wanders_as_much_as_the_bound_is_told():
    pytest.importorskip("pyvista")
    from stereosom_plugin.experiments.rough_masks import deviation, roughened

    rng = np.random.default_rng(5)
    columns, block, amplitude = 1600, 100, 0.5
    covered = np.zeros((80, columns))
    slope = 20 + 0.013 * np.arange(columns)  # every fraction of a pixel
    rows = np.arange(80)[:, None]
    covered = np.clip(slope - rows + 0.5, 0, 1) * (rows > 3)
    offsets = []
    for _ in range(12):
        edge = roughened(covered, amplitude, rng)[4:].sum(axis=0) + 4 - 0.5
        wandered = (edge - slope)[:1500].reshape(-1, block).mean(axis=1)
        offsets.append(wandered)
    # The mean of N boundary points, each on its own: σ/√N.
    found = np.std(offsets) * np.sqrt(block)
    assert found == pytest.approx(deviation(amplitude), rel=0.15)
    assert deviation(0) == PIXEL_DEVIATION


def test_the_bounds_outline_is_the_edge_that_vtk_draws():
    pytest.importorskip("pyvista")
    from scipy.spatial import cKDTree
    from skimage.measure import find_contours

    from stereosom_plugin.experiments import cramer_rao
    from stereosom_plugin.experiments.rough_masks import coverage

    # Bent, and seen obliquely at both ends: rims and both flat ends count.
    curve, radius, camera = arc(60, 90), 3.0, converging_rig(60).a
    tube = cramer_rao._Family.around(curve, radius, 16).member()
    pieces = cramer_rao._outline(tube, camera)
    shown = cramer_rao._shown(tube, camera, pieces)
    covered = coverage(curve, radius, camera)
    edge = np.concatenate(find_contours(covered, 0.5))[:, ::-1]
    for piece, seen in zip(pieces, shown, strict=True):
        assert seen.mean() > 0.9
        along = np.gradient(piece, axis=0)
        normal = np.column_stack([along[:, 1], -along[:, 0]])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        _, nearest = cKDTree(edge).query(piece)
        offset = np.sum((edge[nearest] - piece) * normal, axis=1)[seen]
        assert abs(offset.mean()) < 0.06  # pixels round the corners of an end
        assert np.sqrt(np.mean(offset**2)) < 0.15
    distance, _ = cKDTree(np.concatenate(pieces)).query(edge)
    assert distance.max() < 0.7  # nothing of the edge has no counterpart
