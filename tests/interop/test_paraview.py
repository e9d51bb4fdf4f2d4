"""ParaView reads our files, plays the series in seconds, and runs our filter as a plugin.

Needs `pvpython` (Debian: `apt-get install paraview python3-paraview`) and, where its Python
has no numpy 1.26 and scipy 1.11, a folder that has them, named by STEREOSOM_PARAVIEW_PACKAGES:
`pip install --target FOLDER numpy scipy`.
"""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import stereosom
import stereosom_plugin.centerline
from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin.calibration import write_rig
from stereosom_plugin.cli import main

pytestmark = pytest.mark.interop
RADII = (60, 66, 72)  # mm, of quarter circles: one a frame


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What ParaView made of a run of three frames, and of the same masks by the filter."""
    pvpython = os.environ.get("STEREOSOM_PVPYTHON") or shutil.which("pvpython")
    if not pvpython:
        pytest.skip("there is no pvpython (apt-get install paraview python3-paraview)")
    masks, rig = tmp_path_factory.mktemp("masks"), converging_rig(60)
    for frame, radius in enumerate(RADII):
        for name, camera in (("a", rig.a), ("b", rig.b)):
            (masks / name).mkdir(exist_ok=True)
            mask = silhouette(arc(radius, 90), 1.0, camera).astype(np.uint8) * 255
            for path in (masks / name / f"{frame}.png", masks / f"{name}_{frame}.png"):
                Image.fromarray(mask).save(path)
    write_rig([rig], masks / "rig.json")
    run = masks / "out"
    words = ["masks", masks / "a", masks / "b", "--rig", masks / "rig.json", "--rate", "20"]
    assert main([*map(str, words), "--output", str(run), "--quiet"]) == 0

    folders = [Path(package.__file__).parents[1] for package in (stereosom, stereosom_plugin)]
    folders += [Path(p) for p in [os.environ.get("STEREOSOM_PARAVIEW_PACKAGES")] if p]
    script = Path(__file__).with_name("paraview_run.py")
    plugin = Path(stereosom_plugin.__file__).with_name("paraview_plugin.py")
    done = subprocess.run(
        [pvpython, str(script), str(run), str(masks), str(plugin)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1]), done.stderr, run


def test_every_array_of_a_vtp_arrives(seen):
    found, _, run = seen
    ours = stereosom_plugin.centerline.read_vtp(run / "centerline_0000.vtp")
    assert set(found["vtp"]["arrays"]) == set(ours.arrays)
    assert found["vtp"]["arrays"]["Covariance"] == 6
    assert found["vtp"]["active"] == ["Abscissas", "FrenetTangent", "ParallelTransportNormals"]
    assert (found["vtp"]["points"], found["vtp"]["SPACE"]) == (200, "LPS")
    assert found["vtp"]["length"] == pytest.approx(ours.field["Length"][0])


def test_the_series_plays_in_seconds(seen):
    found, _, _ = seen
    assert found["pvd"]["times"] == pytest.approx([0.0, 0.05, 0.1])
    assert found["pvd"]["animation"] == pytest.approx([0.0, 0.1])
    np.testing.assert_allclose(found["pvd"]["lengths"], np.pi / 2 * np.array(RADII), atol=1.5)


def test_the_filter_follows_paraviews_time(seen):
    found, _, _ = seen
    assert found["filter"]["times"] == [0.0, 1.0, 2.0]
    assert found["filter"]["frames"] == ["0", "1", "2"]
    np.testing.assert_allclose(found["filter"]["lengths"], np.pi / 2 * np.array(RADII), atol=1.5)
    assert found["filter"]["samples"] == 30


def test_the_filters_error_is_one_line_and_paraview_lives_on(seen):
    found, errors, _ = seen
    assert found["filter"]["refused"] == 0
    assert "missing.json: no such file" in errors
    assert "Traceback" not in errors
