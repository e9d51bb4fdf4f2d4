import csv

import pytest


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
