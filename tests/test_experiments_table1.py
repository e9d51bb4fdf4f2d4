"""`stereosom experiment table1`: the pictures are true, the edges are edges, the table is made."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

pv = pytest.importorskip("pyvista")

from stereosom import Camera  # noqa: E402
from stereosom.backbone import Backbone  # noqa: E402
from stereosom_plugin.calibration import read_rig  # noqa: E402
from stereosom_plugin.experiments import mockup, table1  # noqa: E402
from stereosom_plugin.experiments.table1_figures import end_shrinkage  # noqa: E402
from stereosom_plugin.segmentation.endoscope.edges import edge_mask  # noqa: E402


def centroid(image):
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    weight = image.astype(float)
    return np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()


def skewed(mirror=1.0):
    """A camera with a principal point far from the middle, unequal pixels, and skew."""
    intrinsics = [[mirror * 500, 3, 90], [0, 520, 100], [0, 0, 1]]
    angle = 0.4
    rotation = [[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]]
    return Camera.from_pose(intrinsics, rotation, [3, -4, 300], (320, 240))


@pytest.mark.parametrize(
    ("camera", "pixels"),
    [
        (mockup.overhead_rig().a, [(511.5, 383.5), (12.3, 10.1), (1010.4, 752.7)]),
        (mockup.overhead_rig().b, [(1009.8, 11.9)]),
        (skewed(), [(8.3, 6.2), (311.6, 9.4), (160.1, 230.7)]),
        (skewed(mirror=-1.0), [(8.3, 230.7), (250.2, 20.8)]),
    ],
)
def test_the_renderer_and_the_core_project_alike(camera, pixels):
    for pixel in pixels:
        point = camera.center + 500 * camera.rays([pixel])[0]
        ball = pv.Sphere(radius=2.5 * camera.pixel_size(point[None])[0], center=point)

        def fill(plotter, ball=ball):
            plotter.add_mesh(ball, color="white", lighting=False)

        image = mockup.render(camera, fill, background=0)
        assert np.abs(centroid(image) - pixel).max() < 0.1


@pytest.mark.parametrize("view", ["a", "b"])
def test_a_rendered_silhouette_is_the_independent_one(shared_data, view):
    from PIL import Image

    folder = shared_data / "masks" / "helix45_00"
    truth = np.loadtxt(folder / "truth.csv", delimiter=",", skiprows=1)
    radius = json.loads((folder / "case.json").read_text())["radius_mm"]
    camera = getattr(read_rig(folder / "rig.json")[0], view)
    ours = mockup.render_tube(Backbone.through(truth), radius, camera, gray=0, background=255) < 128
    theirs = np.asarray(Image.open(folder / f"{view}.png").convert("L")) > 127
    assert (ours & theirs).sum() / (ours | theirs).sum() > 0.98


def test_bands_are_painted_where_they_are_asked_for():
    curve = Backbone.through([[0, 0, 0], [0, 0, 100]])
    camera = mockup.overhead_rig().a
    image = mockup.render_tube(curve, 3.2, camera, bands=[(40, 60)], light=None)
    at = np.round(camera.project(curve([30.0, 38.0, 42.0, 58.0, 62.0]))).astype(int)
    bare, before, first, last, after = image[at[:, 1], at[:, 0]].astype(int)
    assert max(first, last) < 40 < 90 < min(bare, before, after)


def test_the_mockup_is_the_papers():
    curve = mockup.backbone()
    assert curve.length == pytest.approx(239, abs=0.01)
    assert np.ptp(curve.sample(2000)[:, 2]) == pytest.approx(150, abs=0.5)
    assert (curve.degree, len(curve.coefficients)) == (6, 7)


def test_poses_are_seeded_and_stay_in_both_pictures():
    rig, curve = mockup.overhead_rig(), mockup.backbone()
    for one, other in zip(mockup.poses(), mockup.poses(), strict=True):
        np.testing.assert_array_equal(one.translation, other.translation)
        for camera in (rig.a, rig.b):
            pixels = camera.project(one.of(curve).sample(100))
            assert (pixels > 20).all()
            assert (pixels < np.array(camera.image_size) - 20).all()


def test_edges_lie_only_along_a_step():
    image = np.full((60, 80), 220, dtype=np.uint8)
    image[20:40, 10:70] = 100
    rng = np.random.default_rng(1)
    image = (image + rng.normal(0, 2, image.shape)).round().astype(np.uint8)
    edges = edge_mask(image, 12)
    border = np.zeros_like(edges)
    border[20:40, 10:70] = True
    border[22:38, 12:68] = False  # the two rows on the dark side of the step
    assert not edges[~border].any()
    assert edges[20, 11:69].all()
    assert edges[21:39, 69].all()


def test_outermost_reference_vectors_stop_short_by_about_a_spacing():
    assert end_shrinkage(40, 100.0) == pytest.approx(100 / 40, rel=0.2)
    assert end_shrinkage(40, 100.0, neighborhood=0) < 0.6 * 100 / 40


def test_a_small_run_has_the_papers_error(tmp_path):
    text = table1.run(tmp_path, poses=1, counts=(50,), figures=False)
    with (tmp_path / "table1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["max_mismatch"]) for row in rows] == [0.01, 0.001]
    assert all(0.5 < float(row["error_mm"]) < 3.0 for row in rows)
    assert all(float(row["error_unregistered_mm"]) >= float(row["error_mm"]) for row in rows)
    with (tmp_path / "table1_poses.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 2
    assert "1.53 ± 0.31" in text


@pytest.mark.slow
def test_the_experiment_with_a_third_of_its_poses(tmp_path):
    text = table1.run(tmp_path, poses=7)
    with (tmp_path / "table1.csv").open() as file:
        rows = {
            int(row["reference_vectors"]): row
            for row in csv.DictReader(file)
            if row["max_mismatch"] == "0.01"
        }
    assert 1.0 < float(rows[50]["error_mm"]) < 2.0  # the paper's 1.53
    assert float(rows[20]["error_mm"]) > 1.5 * float(rows[50]["error_mm"])
    pictures = sorted(path.name for path in tmp_path.glob("*.png"))
    assert pictures == [
        "figure2.png", "figure3.png", "figure5.png", "figure6.png",
        "why_depth.png", "why_ends.png", "why_ordering.png",
    ]  # fmt: skip
    assert all(path.stat().st_size < 300_000 for path in tmp_path.glob("*.png"))
    assert "100" in text
