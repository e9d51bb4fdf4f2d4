"""Squared distances in stated deviations: by hand, by draws, and through the experiments."""

from __future__ import annotations

import csv
import json
import shutil

import numpy as np
import pytest

from stereosom.backbone import Backbone
from stereosom.reconstruct import reconstruct
from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc
from stereosom_plugin.experiments.confidence import offsets
from stereosom_plugin.experiments.devices import FAMILIES
from stereosom_plugin.experiments.rough_masks import coverage, observe

LINE = Backbone.through([[0, 0, 0], [0, 0, 100]])


def stated(curve, covariance):
    return Reconstruction(
        index=0,
        time=0.0,
        status="ok",
        backbone=curve,
        covariance=np.tile(covariance, (50, 1, 1)),
        residuals=(0.1, 0.1),
        radius=1.0,
    )


def test_one_deviation_in_each_direction_counts_two_across_and_three_at_the_ends():
    shift = np.array([0.3, -0.4, 0.5])
    result = stated(LINE.transformed(np.eye(3), shift), np.diag(shift**2))
    found = offsets(result, LINE)
    np.testing.assert_allclose(found.squared[1:-1], 2.0, rtol=1e-4)
    np.testing.assert_allclose(found.squared[[0, -1]], 3.0, rtol=1e-4)
    # χ² of two degrees of freedom: 1 − exp(−x/2).
    np.testing.assert_allclose(found.level[1:-1], 1 - np.exp(-1), rtol=1e-4)
    np.testing.assert_allclose(found.deviation[5], 0.4, rtol=1e-4)
    np.testing.assert_allclose(found.deviation[0], 0.5, rtol=1e-4)
    assert list(np.flatnonzero(found.ends)) == [0, 99]


def test_what_lies_along_the_curve_counts_at_the_ends_only():
    result = stated(LINE.transformed(np.eye(3), [0, 0, 0.4]), 0.1**2 * np.eye(3))
    found = offsets(result, LINE)
    np.testing.assert_allclose(found.squared[1:-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(found.squared[[0, -1]], 16.0, rtol=1e-4)
    assert not (found.level[[0, -1]] < 0.95).any()


def test_a_result_from_tip_to_base_is_turned_with_its_covariance():
    curve = arc(50, 90)
    covariance = np.linspace(0.1, 1.0, 50)[:, None, None] ** 2 * np.eye(3)
    forth = Reconstruction(
        0, 0.0, "ok", backbone=curve, covariance=covariance, residuals=(0.1, 0.1), radius=1.0
    )
    back = Reconstruction(
        0, 0.0, "ok", backbone=curve.reversed(), covariance=covariance[::-1],
        residuals=(0.1, 0.1), radius=1.0,
    )  # fmt: skip
    truth = curve.transformed(np.eye(3), [0.02, 0.03, -0.04])
    one, other = offsets(forth, truth), offsets(back, truth)
    assert (one.turned, other.turned) == (False, True)
    np.testing.assert_allclose(one.squared, other.squared, rtol=1e-6)
    np.testing.assert_allclose(one.deviation, other.deviation, rtol=1e-6)


def test_an_end_outside_the_stretch_is_no_end():
    result = stated(LINE.between(30, 100), 0.1**2 * np.eye(3))
    found = offsets(result, LINE, stretch=(30, 100))
    assert list(np.flatnonzero(found.ends)) == [99]


def test_draws_from_the_stated_covariance_are_inside_as_often_as_stated():
    rng = np.random.default_rng(3)
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.02], [0.0, 0.02, 0.05]])
    levels = []
    for shift in rng.multivariate_normal(np.zeros(3), covariance, 200):
        found = offsets(stated(LINE.transformed(np.eye(3), shift), covariance), LINE, count=3)
        levels.append(found.level)
    inside, ends = np.array(levels)[:, 1], np.array(levels)[:, [0]]
    for level in (0.5, 0.95):
        spread = 4 * np.sqrt(level * (1 - level) / 200)
        assert abs(np.mean(inside <= level) - level) < spread
        assert abs(np.mean(ends <= level) - level) < spread


def test_coverage_leaves_a_row_for_each_family_and_a_figure(tmp_path):
    pytest.importorskip("pyvista")
    from stereosom_plugin.experiments import coverage

    text = coverage.run(tmp_path, count=4, families=["cannula 75°"])
    with open(tmp_path / "coverage.csv", encoding="utf-8", newline="") as file:
        rows = {row["group"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"cannula 75°", "all"} | {
        f"edges ± {value:g} px" for value in coverage.ROUGHNESS
    }
    assert rows["all"]["runs"] == rows["cannula 75°"]["runs"] == "4"
    assert rows["all"]["inside"] in text
    assert (tmp_path / "coverage.png").stat().st_size > 0
    with open(tmp_path / "coverage_runs.csv", encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == 4
    with open(tmp_path / "coverage_levels.csv", encoding="utf-8", newline="") as file:
        shares = [float(row["share"]) for row in csv.DictReader(file) if row["part"] == "inside"]
    assert np.all(np.diff(shares[: len(coverage.LEVELS)]) >= 0)  # larger regions hold more


def test_limits_leave_a_row_for_each_setting(tmp_path):
    pytest.importorskip("pyvista")
    from stereosom_plugin.experiments import limits

    text = limits.run(tmp_path, shapes=1, sweeps={"convergence_deg": (20, 90)})
    with open(tmp_path / "limits.csv", encoding="utf-8", newline="") as file:
        narrow, right = csv.DictReader(file)
    assert (narrow["value"], right["value"]) == ("20", "90")
    assert float(narrow["across_bound_mm"]) > 2 * float(right["across_bound_mm"])
    # Three bounds is far off for one curve; a curve that is lost is farther.
    assert float(right["across_mm"]) < 3 * float(right["across_bound_mm"])
    assert right["across_mm"] in text
    assert (tmp_path / "limits.png").stat().st_size > 0


def test_cases_from_files_stand_beside_their_bound(mask_case, tmp_path):
    from stereosom_plugin.experiments.case_limits import report

    shutil.copytree(mask_case, tmp_path / "quarter")
    (tmp_path / "quarter" / "case.json").write_text(json.dumps({"radius_mm": 1.0}))
    titles, row = report(tmp_path)
    assert row.split()[0] == "quarter"
    assert len(row.split("|")) == len(titles.split("|")) == 3
    bound, mean = float(row.split()[1]), float(row.split("|")[1].split()[0])
    assert 0 < bound < 0.05
    assert mean < 2


@pytest.mark.parametrize(("seed", "roughness_px"), [(0, 0.4), (4, 0.8), (7, 0.8)])
def test_rough_edges_make_no_half_ball_of_a_flat_end(seed, roughness_px):
    # Both views, 20° apart, look at the end; half a ball would be 0.8 mm shorter.
    device = FAMILIES["mock-up 20°"](seed)
    covered = [coverage(device.curve, device.radius, view) for view in (device.rig.a, device.rig.b)]
    result = reconstruct(observe(tuple(covered), device.rig, roughness_px, seed=seed))
    assert result.tried is None or not any(result.tried.round_ends)
    assert result.backbone.length == pytest.approx(device.curve.length, abs=0.7)
