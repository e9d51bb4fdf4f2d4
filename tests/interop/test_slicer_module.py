"""The module Stereo SOM on 3D Slicer's own nodes: what a user chooses, sees and exports.

Needs the environment of test_slicer.py, with what Slicer has beside its nodes (scipy,
SimpleITK) and what the module installs into it (scikit-image, pydicom).
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from stereosom.synthetic import arc, converging_rig
from stereosom_plugin import fluoroscopy, polydata
from stereosom_plugin.output import read_table

pytestmark = pytest.mark.interop
ROOT = Path(__file__).parents[2]
TO_RAS = np.array([-1.0, -1.0, 1.0])
# As slicer_module.py places its pictures: i to the left, j to the back, and these.
SPACING, ORIGIN = np.array([0.3, 0.25]), np.array([10.0, 20.0, 30.0])
FRAMES = [None, 60.0, 66.0]  # mm, radii of quarter circles; the first pictures are empty


def slicer_python():
    python = os.environ.get("STEREOSOM_SLICER_PYTHON")
    if not python:
        pytest.skip("STEREOSOM_SLICER_PYTHON names no Python with trame-slicer[standalone]")
    # This project, as if it were installed there; nothing else of this Python.
    paths = os.pathsep.join(map(str, (ROOT, ROOT / "plugin", ROOT / "plugin/slicer/StereoSOM")))
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    return python, environment | {"PYTHONPATH": paths}


def ask(job, folder, *files):
    python, environment = slicer_python()
    call = [python, Path(__file__).with_name("slicer_module.py"), job, folder, *files]
    done = subprocess.run(call, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert "ERROR" not in done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def masks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("masks")
    return ask("masks", folder), folder


def to_picture_plane(pixels):
    flat = np.column_stack([pixels * SPACING * [-1, -1], np.zeros(len(pixels))])
    return flat + ORIGIN


def test_the_curve_lies_where_the_device_is_in_ras(masks):
    """Known points: the base of each quarter circle is the world's origin, its tip (r, 0, r)."""
    seen, _ = masks
    assert [len(frame["points"][0]) for frame in seen["frames"]] == [0, 50, 50]
    for frame, radius in zip(seen["frames"][1:], FRAMES[1:], strict=True):
        points = np.array(frame["points"][0])
        tip = arc(radius, 90).tip
        np.testing.assert_allclose(points[0], [0, 0, 0], atol=0.8)
        np.testing.assert_allclose(points[-1], tip * TO_RAS, atol=0.8)
        assert abs(tip[0]) > 50, "else RAS and LPS could not be told apart"


def test_projections_lie_on_the_device_in_each_picture(masks):
    seen, _ = masks
    rig = converging_rig(60, focal_length=1200, image_size=(512, 384))
    for frame, radius in zip(seen["frames"][1:], FRAMES[1:], strict=True):
        for camera, points in zip((rig.a, rig.b), frame["points"][1:], strict=True):
            true = arc(radius, 90).sample(500)
            wanted = to_picture_plane(camera.project(true))
            away = np.linalg.norm(np.array(points)[:, None] - wanted[None], axis=2).min(axis=1)
            assert away.max() < 0.3  # one pixel


def test_one_browser_scrubs_pictures_and_curves(masks):
    """Those of view a as they are; of view b, whose clock is off, a copy by the same times."""
    seen, _ = masks
    assert [frame["pictures"] for frame in seen["frames"]] == seen["wanted_pictures"]
    assert seen["own"] == [True, False]
    assert (seen["times"], seen["unit"]) == (["0.000", "0.067", "0.133"], ["time", "s"])
    assert seen["fps"] == pytest.approx(15, rel=0.01)


def test_each_model_is_shown_in_its_own_view(masks):
    curve, a, b = masks[0]["displays"]
    assert (curve["3d"], curve["2d"]) == (True, False)
    for display, tag in ((a, "Red"), (b, "Yellow")):
        assert (display["3d"], display["2d"]) == (False, True)
        assert (display["mode"], display["views"]) == ("projection", [tag])
    assert masks[0]["backgrounds"] == [True, True]


def test_table_of_length_and_tip(masks):
    rows = masks[0]["table"]
    assert [row[2] for row in rows] == ["failed", "ok", "ok"]
    assert "no device in the picture" in rows[0][-1]
    assert rows[0][3] == "nan"
    for row, radius in zip(rows[1:], FRAMES[1:], strict=True):
        assert float(row[3]) == pytest.approx(radius * np.pi / 2, abs=0.8)
        np.testing.assert_allclose(
            np.array(row[4:7], dtype=float), arc(radius, 90).tip * TO_RAS, atol=0.8
        )


def test_the_model_is_what_slicer_reads_from_our_file(masks):
    seen, _ = masks
    points = seen["frames"][2]["points"][0]
    np.testing.assert_allclose(points, seen["points_read"], atol=1e-6)
    assert seen["arrays"].keys() == seen["arrays_read"].keys()
    for name, values in seen["arrays"].items():
        np.testing.assert_allclose(values, seen["arrays_read"][name], atol=1e-6, err_msg=name)


def test_exported_folder_is_that_of_the_command(masks):
    seen, folder = masks
    assert [row["status"] for row in read_table(folder / "out")] == ["failed", "ok", "ok"]
    line = polydata.read_vtp(folder / "out" / "centerline_0001.vtp")
    np.testing.assert_allclose(line.points * TO_RAS, seen["frames"][1]["points"][0], atol=1e-6)
    assert (folder / "out" / "centerlines.seq.mrb").stat().st_size > 1000


def test_the_curve_that_is_shown_can_be_edited(masks):
    seen, _ = masks
    points = np.array(seen["frames"][2]["points"][0])
    np.testing.assert_allclose(seen["edited"], points[[0, -1]], atol=1e-3)
    assert seen["edit_refused"].startswith("frame 0 has no curve")


def test_dicom_planes_are_told_apart_by_their_files(tmp_path, sample):
    """View a was chosen to be plane B: the geometry is that of the files, and so is the curve."""
    files = [str(sample / f"plane_{plane}.dcm") for plane in "ab"]
    seen = ask("dicom", tmp_path, *files)
    assert seen["status"] == "ok"
    assert seen["views"] == seen["ids"]
    truth = np.loadtxt(sample / "truth_000.csv", delimiter=",", skiprows=1)
    curve = np.array(seen["points"][0])
    away = np.linalg.norm(curve[:, None] - (truth * TO_RAS)[None], axis=2).min(axis=1)
    assert away.mean() < 0.2
    rig = fluoroscopy.read_biplane(*files).rig(0)
    for camera, points in zip((rig.a, rig.b), seen["points"][1:], strict=True):
        wanted = to_picture_plane(camera.project(truth))
        away = np.linalg.norm(np.array(points)[:, None] - wanted[None], axis=2).min(axis=1)
        assert away.max() < 0.6
    assert json.loads((tmp_path / "out" / "run.json").read_text())["command"] == "fluoroscopy"


def test_what_cannot_be_used_is_refused_in_one_line(tmp_path):
    said = ask("refusals", tmp_path)
    for name, wanted in {
        "nothing": "view a: is not chosen",
        "no frames": "view a: holds no frames",
        "no pixels": "view b: holds no pictures",
        "models": "view b: holds no pictures",
        "size": "view a: is 30×20 pixels, the rig's is 1024×768",
        "count": "views a, b: have 1 and 2 frames",
        "no rig": "view a: was not loaded from DICOM",
        "no such rig": "no such file",
        "not in the database": "is not in the DICOM database",
    }.items():
        assert wanted in said[name]
        assert "; " in said[name], "how to mend it"
        assert "\n" not in said[name]


def test_slicers_own_views_draw_it(tmp_path, sample):
    """The curve over both pictures, in the color of its view, and in 3D: off screen."""
    python, environment = slicer_python()
    files = [str(sample / f"plane_{plane}.dcm") for plane in "ab"]
    call = [python, Path(__file__).with_name("slicer_views.py"), *files, tmp_path / "views.png"]
    off_screen = {"VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow"}
    done = subprocess.run(
        call, env=environment | off_screen, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "views.png") as picture:
        drawn = np.asarray(picture.convert("RGB")).astype(int)
    a, b, space = np.split(drawn, 3, axis=1)
    for view, wanted in ((a, (255, 191, 26)), (b, (51, 204, 255))):
        like = np.abs(view - wanted).max(axis=2) < 40
        rows, columns = np.nonzero(like)
        assert len(rows) > 100
        assert np.ptp(rows) > 80
        assert columns.max() < view.shape[1] * 0.75
    assert np.ptp(space.reshape(-1, 3), axis=0).min() > 100, "the background alone is blue"


def test_the_description_satisfies_ctk_cli(tmp_path):
    """As Slicer's own scripts are found: an executable without a suffix that answers `--xml`."""
    python, environment = slicer_python()
    (tmp_path / "python-real").symlink_to(python)
    (tmp_path / "StereoSOMRun").symlink_to(ROOT / "plugin/slicer/StereoSOMRun/StereoSOMRun.py")
    code = (
        "import ctk_cli, json, logging, sys\n"
        "logging.basicConfig(level='WARNING', format='%(message)s')\n"
        "module = ctk_cli.CLIModule(sys.argv[1])\n"
        "print(json.dumps([[p.name for p in kind] for kind in module.classifyParameters()]))\n"
    )
    done = subprocess.run(
        [python, "-c", code, str(tmp_path / "StereoSOMRun")],
        env=environment | {"PATH": f"{tmp_path}{os.pathsep}{environment['PATH']}"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    arguments, options, returned = json.loads(done.stdout)
    assert arguments == ["viewA", "viewB"]
    assert {"output", "kind", "rig", "centerline", "method"} <= set(options)
    assert returned == ["reconstructed", "failed", "lastLength", "lastTip"]
