import csv

import numpy as np
import pytest

from stereosom import Options, Prior, reconstruct


def test_a_row_for_each_family_and_method(tmp_path):
    pytest.importorskip("pyvista")
    from stereosom_plugin.experiments.methods import run

    text = run(tmp_path, poses=1, only=["cannula 75°"], methods=["joint-spline", "stereo-som"])
    with open(tmp_path / "methods.csv", encoding="utf-8", newline="") as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"joint-spline", "stereo-som"}
    assert float(rows["stereo-som"]["mean_mm"]) < 1.5
    assert float(rows["joint-spline"]["mean_mm"]) < 0.1
    assert float(rows["joint-spline"]["right_topology"]) == 1
    assert "cannula 75°" in text
    assert (tmp_path / "methods_runs.csv").stat().st_size > 0
    assert (tmp_path / "methods.png").stat().st_size > 0


def test_a_flat_end_is_not_taken_for_a_rounded_one_that_fits_no_better():
    """A pose whose base, tilted the wrong way, costs more than half a ball that is odd, too."""
    pytest.importorskip("pyvista")
    from stereosom_plugin.experiments import methods, mockup

    family = next(family for family in methods.families() if family.name == "mock-up 20°")
    pose = list(mockup.poses(6, seed=7, reach=8.0))[5]
    truth = family.curve.transformed(pose.rotation, pose.translation)
    seen = methods._observe(family, truth, "joint-spline")
    result = reconstruct(seen, options=Options(prior=Prior(base=truth.base)))
    away = np.linalg.norm(result.backbone.sample(100) - truth.sample(100), axis=1)
    assert away.mean() < 0.4
