"""3D Slicer's own storage nodes read our files without a word of complaint.

Needs an environment of its own, whose Python STEREOSOM_SLICER_PYTHON names:
`python -m venv ENV && ENV/bin/pip install "trame-slicer[standalone]"`.
"""

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import growing_helix
from stereosom_plugin import exports, polydata

pytestmark = pytest.mark.interop
TO_RAS = np.array([-1.0, -1.0, 1.0])


def helix():
    backbone = growing_helix()
    covariance = np.tile(np.diag([0.1, 0.2, 0.3]), (5, 1, 1))
    return Reconstruction(
        0,
        0.0,
        "ok",
        method="truth",
        backbone=backbone,
        covariance=covariance,
        residuals=(0.5, 0.5),
        radius=1.0,
    )


@pytest.fixture(scope="module")
def read_by_slicer():
    python = os.environ.get("STEREOSOM_SLICER_PYTHON")
    if not python:
        pytest.skip("STEREOSOM_SLICER_PYTHON names no Python with trame-slicer[standalone]")

    def read(*files):
        script = Path(__file__).with_name("slicer_read.py")
        # Slicer's Python must not see the packages of this one.
        environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        command = [python, str(script), *map(str, files)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1]), done.stderr

    return read


def test_model_and_curve(tmp_path, read_by_slicer):
    result = helix()
    vtp, markups = tmp_path / "centerline_0000.vtp", tmp_path / "centerline.mrk.json"
    polydata.write_vtp(result, vtp, source_uids=("1.2.3",))
    polydata.write_markups(result, markups)
    seen, errors = read_by_slicer(vtp, markups)
    assert (seen["vtk"], errors) == ("", "")
    ours = polydata.read_vtp(vtp)

    model = seen["model"]
    assert model["read"]
    assert model["messages"] == []
    assert model["lines"] == 1
    assert model["active"] == {
        "scalars": "Abscissas",
        "vectors": "FrenetTangent",
        "normals": "ParallelTransportNormals",
    }
    np.testing.assert_allclose(model["points"], ours.points * TO_RAS, atol=1e-9)
    assert set(model["arrays"]) == set(ours.arrays)
    for name, array in ours.arrays.items():
        turned = name in ("FrenetTangent", "ParallelTransportNormals")
        wanted = array * TO_RAS if turned else array
        np.testing.assert_allclose(model["arrays"][name], wanted, atol=1e-6, err_msg=name)

    curve = seen["curve"]
    assert curve["read"]
    assert curve["messages"] == []
    np.testing.assert_allclose(curve["points"], result.backbone.sample(50) * TO_RAS, atol=1e-9)
    assert (curve["labels"][0], curve["labels"][-1]) == ("base", "tip")
    assert curve["length"] == pytest.approx(result.backbone.length, rel=1e-3)
    assert {"StandardDeviation", "Radius"} <= set(curve["measurements"])


@pytest.fixture(scope="module")
def there_and_back(tmp_path_factory, read_by_slicer):
    """Our files of two frames, what Slicer saw in them, and the folder of what it wrote."""
    folder = tmp_path_factory.mktemp("slicer")
    results = [replace(helix(), index=i, time=i / 30, residuals=(0.1, 0.2)) for i in range(2)]
    polydata.write_vtp(results[0], folder / "c.vtp")
    polydata.write_markups(results[0], folder / "c.mrk.json")
    lines = [polydata.to_centerline(result) for result in results]
    lines[1] = replace(lines[1], points=1.1 * lines[1].points)
    exports.write_sequence(lines, folder / "run.seq.mrb")
    exports.write_sequence(lines, folder / "läuft 50%.seq.mrml")
    names = ("c.vtp", "c.mrk.json", ".", "run.seq.mrb", "läuft 50%.seq.mrml")
    seen, errors = read_by_slicer(*(folder / name for name in names))
    assert (seen["vtk"], errors) == ("", "")
    assert seen["written"] == [True] * 3
    return lines, seen, folder


@pytest.mark.parametrize("number", [0, 1], ids=["bundle", "data beside it"])
def test_sequence_plays_in_seconds(there_and_back, number):
    lines, seen, _ = there_and_back
    sequence = seen["sequences"][number]
    assert (sequence["read"], sequence["messages"]) == (True, [])
    assert sequence["index"] == ["time", "s", "numeric"]
    assert [float(time) for time in sequence["times"]] == pytest.approx([0, 1 / 30])
    assert sequence["classes"] == ["vtkMRMLModelNode"] * 2
    assert sequence["arrays"] == [len(line.arrays) for line in lines]
    for points, line in zip(sequence["points"], lines, strict=True):
        np.testing.assert_allclose(points, line.points * TO_RAS, atol=1e-6)


def test_slicer_writes_our_sequence_as_a_bundle_again(there_and_back):
    """And with its data beside it never: Slicer reads models so, but does not write them."""
    lines, seen, _ = there_and_back
    bundle, beside = seen["rewritten"]
    assert not beside["written"]
    assert "contains storable nodes" in beside["messages"][0]
    assert bundle["written"]
    assert [float(time) for time in bundle["times"]] == pytest.approx([0, 1 / 30])
    for points, line in zip(bundle["points"], lines, strict=True):
        np.testing.assert_allclose(points, line.points * TO_RAS, atol=1e-4)


@pytest.mark.parametrize("space", ["lps", "ras"])
def test_we_read_the_model_that_slicer_writes(there_and_back, space):
    """In either space; Slicer keeps single precision."""
    lines, _, folder = there_and_back
    back = polydata.read_vtp(folder / f"{space}.vtp")
    np.testing.assert_allclose(back.points, lines[0].points, atol=1e-4)
    assert set(back.arrays) >= set(lines[0].arrays)
    for name, array in lines[0].arrays.items():
        np.testing.assert_allclose(back.arrays[name], array, atol=1e-4, err_msg=name)


def test_we_read_the_curve_that_slicer_writes(there_and_back):
    """One point of it was dragged in Slicer, to (1, 2, 3) in RAS."""
    lines, _, folder = there_and_back
    back = exports.read_markups(folder / "moved.mrk.json")
    wanted = lines[0].backbone.sample(50)
    wanted[1] = [-1, -2, 3]
    np.testing.assert_allclose(back.points, wanted, atol=1e-3)


def test_a_complaint_would_be_heard(tmp_path, read_by_slicer):
    """The control: without SPACE, 3D Slicer warns, and the test above would fail."""
    vtp, markups = tmp_path / "centerline_0000.vtp", tmp_path / "centerline.mrk.json"
    polydata.write_vtp(helix(), vtp)
    polydata.write_markups(helix(), markups)
    vtp.write_text(vtp.read_text().replace('Name="SPACE"', 'Name="PLACE"'))
    seen, errors = read_by_slicer(vtp, markups)
    assert "does not contain coordinate system information" in seen["vtk"] + errors
