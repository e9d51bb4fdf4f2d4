"""Broken, hostile and mistaken calibrations: one line each, bounded, nothing executed."""

import json
import random
import re
import resource
import struct
import time
import zipfile
import zlib

import pytest
from scipy import io

from stereosom_plugin.calibration import read_calibration
from stereosom_plugin.cli import main
from stereosom_plugin.errors import InputError


@pytest.fixture
def refused(tmp_path):
    """Read contents that must be refused; the one line that says why."""

    def read(*contents, **said):
        paths = []
        for number, content in enumerate(contents):
            paths.append(tmp_path / f"calibration_{number}")
            paths[-1].write_bytes(content if isinstance(content, bytes) else content.encode())
        begun = time.monotonic()
        with pytest.raises(InputError) as error:
            read_calibration(paths, **said)
        assert time.monotonic() - begun < 20
        line = str(error.value)
        assert "\n" not in line
        assert line.count("; ") >= 1
        return line

    return read


YAML = "%YAML:1.0\n---\n"
MATRIX = "M1: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ {} ]\n"
DEEP = 100_000
HOSTILE = {
    "an alias bomb": (YAML + "a: &a [1, 2]\nb: &b [*a, *a]\nc: [*b, *b]\n", "aliases"),
    "a cyclic document": (YAML + "a: &a\n  b: *a\n", "aliases"),
    "yaml that would run a program": (
        'a: !!python/object/apply:os.system ["touch executed"]\n', "no calibration that is known"),
    "deep flow yaml": ("a: " + "[" * DEEP, "nested too deeply"),
    "deep block yaml": ("\n".join(" " * i + "a:" for i in range(1000)), "nested too deeply"),
    "many question marks": ("? " * DEEP, "nested too deeply"),
    "deep json": ('{"a":' + "[" * DEEP, "nested too deeply"),
    "a number of a million digits": ('{"cameras":' + "9" * 1_000_000 + "}", "no JSON"),
    "deep xml": ("<a>" * DEEP, "nested too deeply"),
    "an entity bomb": (
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "x"><!ENTITY c "&b;&b;">]><a>&c;</a>',
        "entities"),
    "an external entity": ('<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>', "DTD"),
    "an unknown encoding": ('<?xml version="1.0" encoding="klingon"?><a/>', "broken XML"),
    "two megabytes of yaml": (YAML + "a: [" + "1, " * 700_000 + "1]", "larger than 1 MiB"),
    "twenty megabytes": (b"{" + b" " * (20 << 20), "larger than 16 MiB"),
    "nothing": ("", "empty"),
    "zeros": (b"\0" * 100, "no text"),
    "a picture": (b"\x89PNG\r\n\x1a\n\xff", "no text"),
    "a poem": ("Shall I compare thee to a summer's day?", "no calibration that is known"),
    "hdf5": (b"\x89HDF\r\n\x1a\n" + b"\0" * 100, "MATLAB 7.3.*-v7"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files(refused, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content, says = HOSTILE[name]
    line = refused(content)
    assert re.search(says, line), line
    assert not (tmp_path / "executed").exists()


MISTAKEN = {
    "a matrix of the wrong size": (lambda f: f.opencv_yaml().replace("rows: 3", "rows: 2", 1),
                                   "9 numbers, not 2×3"),
    "a negative size": (lambda f: f.opencv_yaml().replace("rows: 3", "rows: -3", 1), "not -3×3"),
    "no number": (lambda f: f.opencv_yaml().replace("1000.0", "many", 1), "does not hold numbers"),
    "not a number": (lambda f: f.opencv_yaml().replace("1000.0", ".Nan", 1), "not.* numbers"),
    "infinite": (lambda f: f.opencv_yaml().replace("1000.0", "inf", 1), "not finite"),
    "no rotation": (lambda f: f.opencv_yaml().replace("R: ", "Rx: "), "no rotation R"),
    "a rotation that is none": (lambda f: f.opencv_yaml().replace("0.96", "0.5"), "rotation"),
    "a mirror": (lambda f: f.opencv_yaml().replace("0.0, 1.0, 0.0, 0.28", "0.0, -1.0, 0.0, 0.28"),
                 "rotation"),
    "no focal length": (lambda f: f.opencv_yaml().replace("1000.0", "0.0"), "intrinsics"),
    "both in one place": (lambda f: f.opencv_yaml().replace("-5.0, 0.0, 1.0", "0.0, 0.0, 0.0"),
                          "same place"),
    "six coefficients": (lambda f: f.opencv_yaml().replace("cols: 5", "cols: 6").replace(
        "0.01 ]", "0.01, 0 ]").replace("0.0, 0.0, 0.0, 0.0 ]", "0.0, 0.0, 0.0, 0.0, 0.0 ]"),
        "4, 5, 8, 12 or 14"),
    "half a picture": (lambda f: f.opencv_yaml().replace("640, 480", "640.5, 480"), "no sides"),
    "one sided": (lambda f: f.stereomis_ini().replace("T_2", "U_2"), "t_2 is missing"),
    "no pixel spacing": (lambda f: f.RTK, "--pixel-spacing"),
    "no pitch": (lambda f: json.dumps(f.two_view()), "--pitch"),
    "one camera of two": (lambda f: f.mayacam(f.K_A, f.R, f.T), "give both files"),
    "one camera_info of two": (lambda f: f.ros(f.K_A, f.D_A, f.R, [[1, 0, 0, 0]] * 3), "both"),
    "a project of XMALab alone": (lambda f: "<Project><Camera/></Project>", "no calibration"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKEN)
def test_mistaken_files(refused, calibration_files, name):
    make, says = MISTAKEN[name]
    assert re.search(says, refused(make(calibration_files)))


def test_wrong_words_of_the_caller(refused, calibration_files):
    files = calibration_files
    assert "inch" not in refused(files.opencv_yaml(), units="furlong")
    assert "3 files" in refused(*[files.opencv_yaml()] * 3)
    maya = files.mayacam(files.K_A, files.R, files.T)
    assert "different formats" in refused(maya, files.opencv_yaml())
    ros = files.ros(files.K_A, files.D_A, files.R, [[900, 0, 330, 0], [0, 900, 245, 0],
                                                    [0, 0, 1, 0]])  # fmt: skip
    assert "baseline" in refused(ros, ros)
    fisheye = refused(files.opencv_yaml(), fisheye=True)
    assert "fisheye distortion: must be 4" in fisheye


def test_missing_files_and_folders(tmp_path):
    for path, says in ((tmp_path / "no.yml", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(InputError, match=says):
            read_calibration(path)


# ---- MATLAB files are read in a child ------------------------------------------------


def mat_of_one_variable(rows, columns, data=b""):
    """A level 5 .mat file by its public description: one compressed double matrix."""
    name = b"KK_left\0"
    array = struct.pack("<IIIIII", 6, 8, 6, 0, 5, 8) + struct.pack("<ii", rows, columns)
    array += struct.pack("<II", 1, 7) + name + struct.pack("<II", 9, len(data)) + data
    element = struct.pack("<II", 14, len(array)) + array
    packed = zlib.compress(element)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2s", 0x0100, b"IM")
    return head + struct.pack("<II", 15, len(packed)) + packed


HOSTILE_MAT = {
    "garbage": b"MATLAB 5.0 MAT-file" + b"\xff" * 1000,
    "cut": b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2sII", 0x0100, b"IM", 14, 1 << 30),
    "negative counts": mat_of_one_variable(-1, -3),
    "absurd counts": mat_of_one_variable(1 << 30, 1 << 30),
    "a zlib bomb": mat_of_one_variable(8192, 8192, b"\0" * (64 << 20)),
}


@pytest.mark.parametrize("name", HOSTILE_MAT)
def test_hostile_mat_files(refused, name):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused(HOSTILE_MAT[name])
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert grown < 300 << 10  # KiB: what is read is read elsewhere


@pytest.mark.parametrize("seed", range(6))
def test_mutated_mat_files_end_in_a_line_or_a_rig(tmp_path, calibration_files, seed):
    path = tmp_path / "Calib_Results_stereo.mat"
    io.savemat(path, calibration_files.bouguet())
    data, chance = bytearray(path.read_bytes()), random.Random(seed)
    for _ in range(20):
        data[chance.randrange(128, len(data))] = chance.randrange(256)
    path.write_bytes(data)
    only_refused(path)


# ---- a folder or zip of XMALab -------------------------------------------------------

PROJECT = """<Project Version="0.3">
<Camera Name="Camera 1" CameraMatrix="{0}"><CalibrationImage Filename="a.jpg">
<RotationMatrix Filename="r.csv"/><TranslationVector Filename="t.csv"/></CalibrationImage></Camera>
<Camera Name="Camera 2" CameraMatrix="k.csv"><CalibrationImage Filename="a.jpg">
<RotationMatrix Filename="r2.csv"/><TranslationVector Filename="t.csv"/></CalibrationImage></Camera>
</Project>"""
TABLES = {"k.csv": "900, 0, 310\n0, 900, 250\n0, 0, 1\n", "r.csv": "1,0,0\n0,1,0\n0,0,1\n",
          "r2.csv": "0,0,-1\n0,1,0\n1,0,0\n", "t.csv": "0\n0\n700\n"}  # fmt: skip


def xma(path, matrix="k.csv", **tables):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("project.xml", PROJECT.format(matrix))
        for name, text in (TABLES | tables).items():
            archive.writestr(name, text)
    return path


def test_a_zipped_project_without_a_grid_is_a_rig(tmp_path):
    found = read_calibration(xma(tmp_path / "trial.xma"), image_size=(640, 480))
    # Both look at the origin from 700 mm, at right angles: 700 √2.
    assert found.rigs[0].baseline == pytest.approx(700 * 2**0.5)
    assert found.rigs[0].convergence_deg == pytest.approx(90)


@pytest.mark.parametrize(
    ("matrix", "tables", "says"),
    [
        ("../../etc/passwd", {}, "is no file of the project"),
        ("/etc/passwd", {}, "is no file of the project"),
        ("C:\\k.csv", {}, "is no file of the project"),
        ("k.csv", {"r.csv": "1,2\n"}, "rotation"),
        ("k.csv", {"t.csv": "0\n" * 20_000_000}, "too large"),
        ("missing.csv", {}, "has no missing.csv"),
    ],
)
def test_hostile_projects(tmp_path, matrix, tables, says):
    with pytest.raises(InputError, match=says):
        read_calibration(xma(tmp_path / "trial.xma", matrix, **tables), image_size=(640, 480))


# ---- bytes at random -----------------------------------------------------------------


def only_refused(*paths, **said):
    line = ""
    try:
        read_calibration(paths, **said)
    except InputError as error:
        line = str(error)
    assert "\n" not in line


def test_mutations_end_in_a_line_or_a_rig(tmp_path, calibration_files):
    files, chance = calibration_files, random.Random(4)
    maya = files.mayacam(files.K_B, files.R, files.T)
    ros = files.ros(files.K_B, files.D_B, files.R, [[900, 0, 330, -4.5], [0, 900, 245, 0],
                                                    [0, 0, 1, 0]])  # fmt: skip
    texts = [files.opencv_yaml(), files.opencv_xml(), files.opencv_json(), files.stereomis_ini(),
             files.scared_frame_data(), json.dumps(files.matlab_struct()), files.RTK, maya, ros,
             json.dumps(files.two_view())]  # fmt: skip
    other = tmp_path / "other"
    for text in texts:
        pair = text in (maya, ros)
        other.write_text(text)
        for _ in range(30):
            data = bytearray(text.encode())
            for _ in range(chance.choice([1, 1, 2, 8])):
                place = chance.randrange(len(data))
                match chance.randrange(3):
                    case 0:
                        data[place] = chance.randrange(256)
                    case 1:
                        del data[place : place + chance.randrange(1, 40)]
                    case 2:
                        data[place:place] = bytes(chance.choices(b"0123456789-.e[]{}<>:,", k=4))
                if not data:
                    break
            (tmp_path / "mutated").write_bytes(data)
            paths = [tmp_path / "mutated", other] if pair else [tmp_path / "mutated"]
            only_refused(*paths, image_size=(640, 480), pixel_spacing=0.4, pitch=1.82)


# ---- the command ---------------------------------------------------------------------


def test_the_command_converts_and_says_what_it_understood(tmp_path, calibration_files, capsys):
    source, made = tmp_path / "stereo.yml", tmp_path / "rig.json"
    source.write_text(calibration_files.opencv_yaml())
    assert main(["rig", str(source), "--output", str(made)]) == 0
    said = capsys.readouterr().out
    assert "recognized: OpenCV FileStorage, YAML" in said
    assert "baseline 5.10 mm, views 16.3° apart" in said
    assert "radial-tangential lens of 5 coefficients" in said
    assert main(["rig", str(made), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["recognized"] == "rig.json"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "0 files were given"),
        (["stereo.yml", "--output", "rig.txt"], "is no .json"),
        (["stereo.yml", "--image-size", "640"], "not WIDTHxHEIGHT"),
        (["stereo.yml", "--image-size", "1280x720"], "is for pictures of 640×480"),
        (["stereo.yml", "--units", "furlong"], "invalid choice"),
        (["--calibrate", "left", "right"], "needs --board"),
        (["--calibrate", "left", "right", "--board", "9x6", "--square", "5"], "is no folder"),
    ],
)
def test_the_command_refuses_in_one_line(tmp_path, monkeypatch, capsys, calibration_files, words,
                                         says):  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stereo.yml").write_text(calibration_files.opencv_yaml())
    assert main(["rig", *words]) == 2
    line = capsys.readouterr().err
    assert says in line
    assert line.count("\n") == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["stereo.yml"]
