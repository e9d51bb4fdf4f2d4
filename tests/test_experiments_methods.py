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


@pytest.mark.parametrize("number", [5, 9, 26])
def test_an_end_seen_nearly_edge_on_is_tilted_the_right_way(number):
    """Poses that a wrong tilt, or half a ball, explains nearly as well: ends up to 2.6 mm off."""
    pytest.importorskip("pyvista")
    from stereosom_plugin.experiments import methods, mockup

    family = next(family for family in methods.families() if family.name == "mock-up 20°")
    pose = list(mockup.poses(number + 1, seed=7, reach=8.0))[number]
    truth = family.curve.transformed(pose.rotation, pose.translation)
    seen = methods._observe(family, truth, "joint-spline")
    result = reconstruct(seen, options=Options(prior=Prior(base=truth.base)))
    away = np.linalg.norm(result.backbone.sample(100) - truth.sample(100), axis=1)
    assert away.max() < 0.4
