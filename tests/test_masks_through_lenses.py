"""The whole way from masks that lenses bent to millimetres, with OpenCV as the lens."""

import json

import numpy as np
import pytest
from PIL import Image

from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin.calibration import write_rig
from stereosom_plugin.cli import main
from stereosom_plugin.evaluation import evaluate
from stereosom_plugin.lens import RadialTangentialLens

cv2 = pytest.importorskip("cv2")

BENDS = np.array([-2.0, 4.0, 0.01, -0.015, 0.0])


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """A quarter circle in two views, its masks as bent lenses show them, and the truth."""
    folder, curve, rig = tmp_path_factory.mktemp("bent"), arc(120, 90), converging_rig(60)
    lenses = []
    for name, camera in (("a", rig.a), ("b", rig.b)):
        width, height = camera.image_size
        focal = camera.focal_length
        k = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        straight = silhouette(curve, 2.0, camera)
        x, y = np.meshgrid(np.arange(float(width)), np.arange(float(height)))
        pixels = np.column_stack([x.ravel(), y.ravel()])[:, None]
        ideal = cv2.undistortPoints(pixels, k, BENDS, None, k)[:, 0]
        column, row = np.rint(ideal).astype(int).T
        inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
        bent = np.zeros(width * height, dtype=bool)
        bent[inside] = straight[row[inside], column[inside]]
        picture = bent.reshape(height, width)
        moved = np.abs(ideal - pixels[:, 0])[bent].max()
        assert moved > 3, "the lens must matter"
        Image.fromarray(picture.astype(np.uint8) * 255).save(folder / f"{name}.png")
        lenses.append(RadialTangentialLens(k, BENDS))
    write_rig([rig], folder / "bent.json", (lenses[0], lenses[1]))
    write_rig([rig], folder / "straight.json")
    np.savetxt(folder / "truth.csv", curve.sample(300), delimiter=",", header="x,y,z", comments="")
    return folder


def reconstructed(case, rig, out):
    words = ["masks", str(case / "a.png"), str(case / "b.png"), "--rig", str(case / rig)]
    assert main([*words, "--base", "0,0,0", "--output", str(out), "--quiet"]) == 0
    return evaluate(out, case / "truth.csv")[0]


def test_a_device_behind_lenses_is_found_where_it_is(case, tmp_path):
    found = reconstructed(case, "bent.json", tmp_path / "out")
    assert found.distance < 0.1
    assert found.tip < 1
    kept = json.loads((tmp_path / "out" / "rig.json").read_text())
    assert kept["cameras"][0]["distortion"] == pytest.approx(BENDS)


def test_without_its_lens_it_is_not(case, tmp_path):
    """So that the test above can fail."""
    found = reconstructed(case, "straight.json", tmp_path / "out")
    assert found.distance > 0.15
    assert found.tip > 2
