"""Results in the files of other programs, read back by readers that are not ours."""

import json
import os
import re
import struct
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOGeometry import vtkGLTFReader
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc
from stereosom_plugin import polydata
from stereosom_plugin.cli import main
from stereosom_plugin.errors import InputError
from stereosom_plugin.exports import export, read_markups, write_markups

SUFFIXES = [".glb", ".html", ".mrk.json", ".seq.mrb", ".seq.mrml"]


def frame(index, **changes):
    """A quarter circle of radius 50 mm and more, 2 mm thick, a fifteenth of a second a frame."""
    known = {
        "index": index,
        "time": index / 15,
        "status": "ok",
        "method": "joint-spline",
        "backbone": arc(50 + 5 * index, 90),
        "covariance": np.tile(0.04 * np.eye(3), (5, 1, 1)),
        "residuals": (0.5, 0.7),
        "radius": 1.0,
    }
    return Reconstruction(**{**known, **changes})


def lines(count=3, **changes):
    return [polydata.to_centerline(frame(index, **changes)) for index in range(count)]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """An output folder of three frames, the last of them lost."""
    folder = tmp_path_factory.mktemp("run") / "out"
    folder.mkdir()
    for index in range(2):
        polydata.write_vtp(frame(index), folder / f"centerline_{index:04d}.vtp")
    header = "frame,time_s,status,length_mm,tip_x_mm,tip_y_mm,tip_z_mm,residual_a_px,"
    rows = [f"{i},{i / 15},ok,78,0,0,0,1,1,0.2," for i in range(2)] + ["2,0.13,lost,,,,,,,,dark"]
    table = "\n".join([header + "residual_b_px,sigma_mm,reason", *rows, ""])
    (folder / "centerlines.csv").write_text(table)
    return folder


# ---- .glb ------------------------------------------------------------------------------


def glb_parts(path):
    """JSON and binary chunk of a `.glb`, by the specification's words."""
    data = path.read_bytes()
    magic, version, whole = struct.unpack("<4sII", data[:12])
    assert (magic, version, whole) == (b"glTF", 2, len(data))
    length, kind = struct.unpack("<I4s", data[12:20])
    assert (kind, length % 4) == (b"JSON", 0)
    rest = data[20 + length :]
    size, kind = struct.unpack("<I4s", rest[:8])
    assert (kind, size, size % 4) == (b"BIN\0", len(rest) - 8, 0)
    return json.loads(data[20 : 20 + length]), rest[8:]


def numbers(described, binary, accessor):
    accessor = described["accessors"][accessor]
    view = described["bufferViews"][accessor["bufferView"]]
    kind = {5126: "<f4", 5125: "<u4", 5123: "<u2"}[accessor["componentType"]]
    stretch = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    found = np.frombuffer(stretch, kind).reshape(accessor["count"], -1)
    assert view["byteOffset"] % 4 == 0
    return found


def test_glb_is_a_tube_about_the_curve_in_metres_with_the_head_up(tmp_path):
    export(lines(1), tmp_path / "c.glb")
    described, binary = glb_parts(tmp_path / "c.glb")
    (mesh,) = described["meshes"]
    attributes = mesh["primitives"][0]["attributes"]
    points = numbers(described, binary, attributes["POSITION"])
    truth = arc(50, 90).sample(2000)
    distance = np.linalg.norm(points[:, None] - truth, axis=2).min(axis=1)
    on_caps = distance < 0.99  # their middles
    assert on_caps.sum() <= 2 * 14
    np.testing.assert_allclose(distance[~on_caps], 1.0, atol=0.02)
    normals = numbers(described, binary, attributes["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    colors = numbers(described, binary, attributes["COLOR_0"])
    assert colors.shape == (len(points), 4)
    triangles = numbers(described, binary, mesh["primitives"][0]["indices"])
    assert triangles.max() == len(points) - 1
    # LPS (left, back, head) in mm → (left, up, front) in m.
    matrix = np.reshape(described["nodes"][0]["matrix"], (4, 4)).T
    np.testing.assert_allclose(matrix @ [10, 20, 30, 1], [0.010, 0.030, -0.020, 1])
    assert np.linalg.det(matrix) == pytest.approx(1e-9)
    low, high = (described["accessors"][attributes["POSITION"]][key] for key in ("min", "max"))
    np.testing.assert_array_equal([low, high], [points.min(axis=0), points.max(axis=0)])
    assert "animations" not in described


def test_glb_triangles_look_outwards(tmp_path):
    export(lines(1), tmp_path / "c.glb")
    described, binary = glb_parts(tmp_path / "c.glb")
    primitive = described["meshes"][0]["primitives"][0]
    points = numbers(described, binary, primitive["attributes"]["POSITION"])
    normals = numbers(described, binary, primitive["attributes"]["NORMAL"])
    corners = numbers(described, binary, primitive["indices"]).reshape(-1, 3)
    a, b, c = (points[corners[:, i]] for i in range(3))
    facing = np.sum(np.cross(b - a, c - a) * normals[corners].mean(axis=1), axis=1)
    assert np.mean(facing > 0) > 0.99


def test_glb_of_a_run_plays_in_seconds(tmp_path):
    export(lines(3), tmp_path / "c.glb")
    described, binary = glb_parts(tmp_path / "c.glb")
    (animation,) = described["animations"]
    shown = []
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        keys = numbers(described, binary, sampler["input"]).ravel()
        np.testing.assert_allclose(keys, [0, 1 / 15, 2 / 15, 3 / 15], atol=1e-5)
        shown.append(numbers(described, binary, sampler["output"])[:, 0])
        assert sampler["interpolation"] == "STEP"
    np.testing.assert_array_equal(shown, [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]])


def test_glb_is_read_by_vtk(tmp_path):
    export(lines(2), tmp_path / "c.glb")
    reader = vtkGLTFReader()
    reader.SetFileName(str(tmp_path / "c.glb"))
    reader.Update()
    found = reader.GetOutput()
    bounds = np.zeros(6)
    found.GetBounds(bounds)
    # Metres; x to 51 mm, z (up: y) to 51 mm; the second frame has no size at first.
    np.testing.assert_allclose(bounds[[1, 3]], 0.051, atol=1e-3)
    names = reader.GetAllSceneNames()
    assert names is not None
    assert reader.GetNumberOfAnimations() == 1
    assert reader.GetAnimationDuration(0) == pytest.approx(2 / 15, abs=1e-4)


# ---- .html -----------------------------------------------------------------------------


def page_data(path):
    text = path.read_text("utf-8")
    found = re.search(r'<script type="application/json" id="run">(.*?)</script>', text, re.S)
    return json.loads(found[1]), text


def test_page_holds_the_run_and_asks_for_nothing_else(tmp_path):
    export(lines(3), tmp_path / "run.html", color_by="StandardDeviation")
    run, text = page_data(tmp_path / "run.html")
    assert [each["time"] for each in run["frames"]] == pytest.approx([0, 1 / 15, 2 / 15])
    assert run["colorBy"] == "StandardDeviation"
    np.testing.assert_allclose(run["frames"][2]["points"][-1], arc(60, 90).tip, atol=1e-3)
    assert run["frames"][0]["s"][-1] == pytest.approx(25 * np.pi, rel=1e-3)
    assert "default-src 'none'" in text
    assert not re.search(r"https?://|\bsrc=|@import|url\(", text)
    assert len(text) < 60_000


def test_page_text_cannot_break_out(tmp_path):
    hostile = "</script><script>alert(1)</script>"
    export(lines(1, method=hostile), tmp_path / "<b>.html")
    run, text = page_data(tmp_path / "<b>.html")
    assert run["frames"][0]["method"] == hostile
    assert hostile not in text
    assert "<title>&lt;b&gt;</title>" in text


# ---- 3D Slicer -------------------------------------------------------------------------


def test_curve_comes_back(tmp_path):
    line = lines(1)[0]
    write_markups(line, tmp_path / "c.mrk.json")
    back = read_markups(tmp_path / "c.mrk.json")
    assert back.backbone.length == pytest.approx(25 * np.pi, rel=1e-5)
    np.testing.assert_allclose(back.arrays["Radius"], 1.0)
    np.testing.assert_allclose(back.arrays["StandardDeviation"], 0.2)


def markups(**changes):
    point = {"position": [0, 0, 0]}
    curve = {"type": "Curve", "controlPoints": [point, {"position": [0, 3, 4]}], **changes}
    return {"markups": [curve]}


def test_curve_in_ras_is_turned_and_undefined_points_are_passed_over(tmp_path):
    loose = {"position": [9, 9, 9], "positionStatus": "undefined"}
    points = [{"position": [1, 2, 3]}, loose, {"position": [4, 5, 6]}]
    content = markups(coordinateSystem="RAS", controlPoints=points)
    (tmp_path / "c.mrk.json").write_text(json.dumps(content))
    line = read_markups(tmp_path / "c.mrk.json")
    np.testing.assert_array_equal(line.points, [[-1, -2, 3], [-4, -5, 6]])


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "Expecting value"),
        ("[]", "no markups file"),
        ("{}", "no markups file"),
        ("[" * 100_000, "nested too deep"),
        ('{"markups": []}', "holds 0 curves"),
        (json.dumps(markups(coordinateUnits="m")), "not in mm"),
        (json.dumps(markups(coordinateSystem="XYZ")), "neither LPS nor RAS"),
        (json.dumps(markups(controlPoints=[])), "has 0 control points"),
        (json.dumps(markups(controlPoints=[{"position": [0, 0, np.nan]}] * 2)), "finite"),
        (json.dumps(markups(controlPoints=[{"position": [0, 0, 1e9]}] * 2)), "kilometre"),
        (json.dumps(markups(controlPoints=[{"position": "abc"}] * 2)), "points"),
        (json.dumps(markups(controlPoints=[{"position": [1, 2, 3]}] * 2)), "two different"),
    ],
)
def test_broken_curves_are_refused_in_one_line(tmp_path, text, why):
    (tmp_path / "c.mrk.json").write_text(text)
    with pytest.raises(InputError, match=re.escape(why)) as caught:
        read_markups(tmp_path / "c.mrk.json")
    assert len(str(caught.value).splitlines()) == 1


def test_sequence_holds_a_model_a_time(tmp_path):
    export(lines(3), tmp_path / "run.seq.mrb")
    with zipfile.ZipFile(tmp_path / "run.seq.mrb") as bundle:
        names = bundle.namelist()
        bundle.extractall(tmp_path)
    assert names[0] == "run.seq/run.mrml"
    scene = ElementTree.parse(tmp_path / names[0]).getroot()
    index = scene.find("Sequence").attrib
    assert (index["indexName"], index["indexUnit"]) == ("time", "s")
    times = dict(entry.split(":") for entry in index["indexValues"].split(";"))
    files = {
        model.get("id"): scene.find(f"ModelStorage[@id='{model.get('references')[8:-1]}']")
        for model in scene.iter("Model")
    }
    for number, (model, time) in enumerate(times.items()):
        assert float(time) == pytest.approx(number / 15)
        reader = vtkXMLPolyDataReader()
        reader.SetFileName(str(tmp_path / "run.seq" / files[model].get("fileName")))
        reader.Update()
        points = vtk_to_numpy(reader.GetOutput().GetPoints().GetData())
        np.testing.assert_allclose(points, arc(50 + 5 * number, 90).sample(200), atol=1e-6)
        assert reader.GetOutput().GetPointData().HasArray("Covariance")
        assert reader.GetOutput().GetCellData().HasArray("Length")


def test_sequence_with_its_data_beside_it(tmp_path):
    """The same scene as in the bundle; the data lie where it says, and go with an older run."""
    export(lines(3), tmp_path / "run.seq.mrml")
    export(lines(2), tmp_path / "run.seq.mrml")
    export(lines(2), tmp_path / "run.seq.mrb")
    with zipfile.ZipFile(tmp_path / "run.seq.mrb") as bundle:
        bundled = bundle.read("run.seq/run.mrml").decode()
    scene = (tmp_path / "run.seq.mrml").read_text("utf-8")
    assert scene == bundled.replace("Data/", "run.seq.data/")
    data = sorted((tmp_path / "run.seq.data").iterdir())
    assert [file.name for file in data] == ["centerline_0.vtp", "centerline_1.vtp"]
    for file, line in zip(data, lines(2), strict=True):
        np.testing.assert_allclose(polydata.read_vtp(file).points, line.points)


def test_sequence_leaves_the_files_of_others_alone(tmp_path):
    (tmp_path / "run.seq.data").mkdir()
    (tmp_path / "run.seq.data" / "mine.txt").write_text("")
    with pytest.raises(InputError, match="holds other files; give --output another name"):
        export(lines(2), tmp_path / "run.seq.mrml")
    assert [f.name for f in tmp_path.rglob("*")] == ["run.seq.data", "mine.txt"]


def test_sequence_that_cannot_be_written_leaves_nothing(tmp_path, monkeypatch):
    (tmp_path / "run.seq.mrml").mkdir()  # nothing takes the place of a folder
    with pytest.raises(InputError, match="cannot be written"):
        export(lines(2), tmp_path / "run.seq.mrml")
    assert [f.name for f in tmp_path.rglob("*")] == ["run.seq.mrml"]


def test_sequence_of_fast_frames_keeps_them_apart(tmp_path):
    """Slicer takes times for one that differ by less than a tolerance."""
    fast = [replace(line, time=line.time / 1000) for line in lines(2)]
    export(fast, tmp_path / "run.seq.mrb")
    scene = zipfile.ZipFile(tmp_path / "run.seq.mrb").read("run.seq/run.mrml").decode()
    tolerance = float(re.search(r'numericIndexValueTolerance="([^"]+)"', scene)[1])
    assert tolerance < 1 / 15000


# ---- the command -----------------------------------------------------------------------


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_command_writes_each_format(run, tmp_path, capsys, suffix):
    output = tmp_path / f"run{suffix}"
    assert main(["export", str(run), "--output", str(output)]) == 0
    assert output.stat().st_size > 1000
    frames = "frame 0" if suffix == ".mrk.json" else "frame 0 to 1"
    assert capsys.readouterr().out == f"{output}: {frames}\n"


def test_command_takes_one_frame_one_file_or_a_curve_from_slicer(run, tmp_path):
    calls = [
        [run, "--frame", "1", "--output", tmp_path / "one.mrk.json"],
        [run / "centerline_0001.vtp", "--output", tmp_path / "file.html"],
        [tmp_path / "one.mrk.json", "--output", tmp_path / "slicer.html"],
    ]
    for words in calls:
        assert main(["export", *map(str, words), "--quiet"]) == 0
    lengths = [page_data(tmp_path / f"{name}.html")[0]["frames"][0]["s"][-1]
               for name in ("file", "slicer")]  # fmt: skip
    assert lengths == pytest.approx([55 * np.pi / 2] * 2, rel=1e-3)


def refused(words, capsys):
    assert main(["export", *map(str, words)]) == 2
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    assert captured.out == ""
    return line.removeprefix("stereosom: error: ")


def test_wrong_calls_are_refused_in_one_line_and_leave_nothing(run, tmp_path, capsys):
    bare = tmp_path / "bare.vtp"
    bare.write_text(
        '<VTKFile type="PolyData" version="0.1"><PolyData><Piece NumberOfPoints="2" '
        'NumberOfLines="1"><Points><DataArray type="Float64" NumberOfComponents="3" '
        'format="ascii">0 0 0 0 0 9</DataArray></Points><Lines><DataArray type="Int64" '
        'Name="connectivity" format="ascii">0 1</DataArray><DataArray type="Int64" '
        'Name="offsets" format="ascii">2</DataArray></Lines></Piece></PolyData></VTKFile>'
    )
    (tmp_path / "empty").mkdir()
    (tmp_path / "there.glb").write_text("old")
    before = sorted(tmp_path.rglob("*"))
    for words, why in [
        ([run, "--output", tmp_path / "x.stl"], "ends in no known format"),
        ([run, "--output", tmp_path / "there.glb"], "exists already"),
        ([run, "--output", tmp_path / "no" / "x.glb"], "cannot be written"),
        ([run, "--frame", "2", "--output", tmp_path / "x.glb"], "no centerline of frame 2"),
        ([tmp_path / "empty", "--output", tmp_path / "x.glb"], "holds no centerlines.csv"),
        ([tmp_path / "no.vtp", "--output", tmp_path / "x.glb"], "cannot be read"),
        ([bare, "--color-by", "Curvature", "--output", tmp_path / "x.glb"], "holds no Curvature"),
        ([bare, "--color-by", "Radius", "--output", tmp_path / "x.html"], "holds no Radius"),
    ]:
        assert why in refused(words, capsys)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_foreign_line_without_any_array_is_drawn_plain(tmp_path, suffix):
    line = replace(lines(1)[0], arrays={}, field={})
    export([line], tmp_path / f"c{suffix}")
    assert (tmp_path / f"c{suffix}").stat().st_size > 500


@pytest.mark.parametrize("suffix", [".glb", ".html", ".mrk.json"])
def test_nan_along_the_curve_is_refused(tmp_path, suffix):
    line = lines(1)[0]
    radius = np.where(np.arange(200) == 7, np.nan, 1.0)
    broken = replace(line, arrays={**line.arrays, "Radius": radius})
    with pytest.raises(InputError, match="values in Radius that are not finite"):
        export([broken], tmp_path / f"c{suffix}")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_full_disk_leaves_nothing(tmp_path, suffix, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match="No space left on device"):
        export(lines(1), tmp_path / f"c{suffix}")
    assert not list(tmp_path.iterdir())


def test_the_viewer_ships():
    assert Path(polydata.__file__).with_name("exports").joinpath("viewer.html").is_file()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no such limit")
def test_no_room_is_one_line(run, tmp_path):
    """In a process that may write no file of more than 8 kB, as on a disk that is full."""
    limited = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192));"
        "from stereosom_plugin.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    (tmp_path / "out").mkdir()
    words = ["export", str(run / "centerline_0000.vtp"), "--output", f"{tmp_path}/out/x.html"]
    # The child that reads the .vtp passes arrays through a file: it reads one in this process.
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            limited.replace("sys.exit", "sys.executable = ''; sys.exit"),
            *words,
        ],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "cannot be written (File too large)" in line
    assert not list((tmp_path / "out").iterdir())
