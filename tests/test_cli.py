"""The command as people use it: what it leaves, what it says, how it ends."""

import csv
import json
import shutil
import subprocess
import sys
import time
from importlib.metadata import version

import numpy as np
import pydicom
import pytest
from PIL import Image

from stereosom_plugin import fluoroscopy
from stereosom_plugin.cli import main


def refused(words, capsys, output=None):
    """Run a call that must be refused; return its one line."""
    assert main([str(word) for word in words]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("stereosom: error: ")
    if output is not None:
        assert not output.exists(), "something half-written was left behind"
    return lines[0]


def rows(folder):
    with open(folder / "centerlines.csv", encoding="utf-8", newline="") as table:
        return list(csv.DictReader(table))


# ---- the main job ------------------------------------------------------------------------


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    output = tmp_path_factory.mktemp("demo") / "out"
    assert main(["demo", "--output", str(output), "--quiet"]) == 0
    return output


def test_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out == f"stereosom {version('stereosom')}\n"


def test_callers_can_show_progress_in_their_own_way(mask_case, tmp_path, capsys):
    begun = []

    def told(frames):
        for frame in frames:
            begun.append(frame)
            yield frame

    masks = [str(mask_case / name) for name in ("a.png", "b.png")]
    words = ["--rig", str(mask_case / "rig.json"), "--output", str(tmp_path / "out"), "--quiet"]
    assert main(["masks", *masks, *words], progress=told) == 0
    assert begun == [0]


def test_a_text_is_no_centerline_and_the_message_says_so(tmp_path, capsys):
    (tmp_path / "some.txt").write_text("hello\n")
    assert main(["render", str(tmp_path / "some.txt"), "--output", str(tmp_path / "x.png")]) == 2
    assert "some.txt: is no .vtp, for it is no XML" in capsys.readouterr().err


def test_demo_leaves_centerlines_a_table_a_series_and_pictures(demo):
    names = {file.name for file in demo.iterdir()}
    assert names == {f"centerline_{n:04d}.vtp" for n in range(6)} | {
        "centerlines.csv", "centerlines.pvd", "rig.json", "run.json",
        "scene.png", "overlay_a.png", "overlay_b.png",
    }  # fmt: skip
    table = rows(demo)
    assert [row["status"] for row in table] == ["ok"] * 6
    assert [float(row["time_s"]) for row in table] == pytest.approx(np.arange(6) * 0.133334)


def test_demo_is_near_the_truth_by_means_that_share_no_code_with_it(demo, sample):
    """Points read by VTK, distances and projections in this test's own words."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    planes = json.loads((sample / "truth.json").read_text())["planes"]
    for frame in range(6):
        reader = vtkXMLPolyDataReader()
        reader.SetFileName(str(demo / f"centerline_{frame:04d}.vtp"))
        reader.Update()
        found = vtk_to_numpy(reader.GetOutput().GetPoints().GetData())
        truth = np.loadtxt(sample / f"truth_{frame:03d}.csv", delimiter=",", skiprows=1)
        distance = np.linalg.norm(found[:, None] - truth, axis=2)
        assert distance.min(axis=1).mean() < 0.2
        assert np.linalg.norm(found[-1] - truth[-1]) < 1.5  # mm, of a tube of radius 1
        # Visible in both pictures, by the true matrices:
        visible = np.ones(len(truth), dtype=bool)
        for plane in "ab":
            u, v, w = (
                np.array(planes[plane][frame]) @ np.column_stack([truth, np.ones(len(truth))]).T
            )
            visible &= (u / w > -0.5) & (u / w < 511.5) & (v / w > -0.5) & (v / w < 511.5)
        shown = np.flatnonzero(visible)
        nearest = distance.argmin(axis=1)
        assert nearest[0] < nearest[-1], "base and tip are the wrong way round"
        covered = (min(nearest[-1], shown[-1]) - max(nearest[0], shown[0])) / np.ptp(shown)
        assert covered > 0.95


def test_rig_json_holds_the_true_geometry(demo, sample):
    cameras = json.loads((demo / "rig.json").read_text())["cameras"]
    truth = json.loads((sample / "truth.json").read_text())["planes"]
    points = np.column_stack([np.random.default_rng(0).uniform(-60, 60, (50, 3)), np.ones(50)])
    for camera in cameras:
        pixels = [
            (points @ np.array(matrix).T)[:, :2] / (points @ np.array(matrix).T)[:, 2:]
            for matrix in (camera["projection"], truth[camera["name"]][0])
        ]
        assert np.abs(pixels[0] - pixels[1]).max() < 1e-6


@pytest.mark.parametrize(
    ("study", "distance", "tip"),  # mm, what an X-ray laboratory asks
    [("cannula", 0.3, 0.5), ("guidewire", 0.3, 0.5), ("cluttered", 0.5, 0.5)],
)
def test_every_frame_of_the_studies(shared_data, tmp_path, study, distance, tip, capsys):
    folder = shared_data / "biplane_xa" / study
    assert main(["fluoroscopy", str(folder), "--output", str(tmp_path), "--quiet"]) == 0
    assert main(["evaluate", str(tmp_path), "--truth", str(folder), "--json"]) == 0
    frames = json.loads(capsys.readouterr().out)
    assert len(frames) == {"cannula": 12, "guidewire": 8, "cluttered": 12}[study]
    for frame in frames:
        assert frame["distance"] < distance, frame
        assert frame["tip"] < tip, frame
        assert frame["covered"] > 0.95


def test_every_frame_of_the_study_that_ships(sample, demo, capsys):
    # Its tip points at a source: ends some radii apart look much alike there.
    assert main(["evaluate", str(demo), "--truth", str(sample), "--json"]) == 0
    frames = json.loads(capsys.readouterr().out)
    assert len(frames) == 6
    for frame in frames:
        assert frame["distance"] < 0.3, frame
        assert frame["tip"] < 0.5, frame


def test_planes_in_the_other_order_give_the_same(sample, demo, tmp_path):
    words = ["fluoroscopy", sample / "plane_b.dcm", sample / "plane_a.dcm", "--quiet"]
    assert main([*map(str, words), "--frames", ":1", "--output", str(tmp_path / "out")]) == 0
    assert rows(tmp_path / "out")[0] == rows(demo)[0]


def test_masks_and_evaluate(mask_case, tmp_path, capsys):
    words = ["masks", mask_case / "a.png", mask_case / "b.png", "--rig", mask_case / "rig.json"]
    assert main([*map(str, words), "--output", str(tmp_path / "out"), "--spacing", "0.5"]) == 0
    assert "1 frame: 1 ok" in capsys.readouterr().out
    assert main(["evaluate", str(tmp_path / "out"), "--truth", str(mask_case / "truth.csv")]) == 0
    header, values = capsys.readouterr().out.splitlines()
    assert header.split()[:2] == ["frame", "distance"]
    assert float(values.split()[1]) < 1.5


def test_render_draws_a_folder_and_a_file(demo, tmp_path, capsys):
    for source in (demo, demo / "centerline_0002.vtp"):
        picture = tmp_path / f"{source.name}.png"
        assert main(["render", str(source), "--output", str(picture)]) == 0
        with Image.open(picture) as drawn:
            assert drawn.size == (1600, 1200)
    assert capsys.readouterr().err == ""


def test_json_prints_the_table(mask_case, tmp_path, capsys):
    words = ["masks", mask_case / "a.png", mask_case / "b.png", "--rig", mask_case / "rig.json"]
    assert main([*map(str, words), "--output", str(tmp_path / "out"), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["frames"] == rows(tmp_path / "out")


def test_a_negative_base_needs_no_equals_sign(mask_case, tmp_path):
    words = ["masks", mask_case / "a.png", mask_case / "b.png", "--rig", mask_case / "rig.json"]
    words += ["--base", "-0.5,0,0", "--output", tmp_path / "out", "--quiet"]
    assert main([str(word) for word in words]) == 0
    assert "nearest to the given one" in rows(tmp_path / "out")[0]["reason"]


# ---- runs that fail in part, stop, and go on ---------------------------------------------


def blank_frame(path, frame):
    """Replace a frame's pixels by plain gray, uncompressed."""
    from stereosom_plugin.fluoroscopy import read_biplane

    plane = 0 if path.name == "plane_a.dcm" else 1
    run = read_biplane(path.parent)
    pictures = np.stack([run.read(index)[plane] for index in range(len(run))]).astype(np.uint16)
    pictures[frame] = 2000
    dataset = pydicom.dcmread(path)
    dataset.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    dataset.PixelData = pictures.tobytes()
    dataset["PixelData"].VR = "OW"
    dataset["PixelData"].is_undefined_length = False
    return dataset


def test_a_frame_without_a_device_is_carried_over_and_the_others_are_written(
    sample, tmp_path, capsys
):
    study = tmp_path / "study"
    shutil.copytree(sample, study)
    blank_frame(study / "plane_b.dcm", 2).save_as(study / "plane_b.dcm")
    assert main(["fluoroscopy", str(study), "--output", str(tmp_path / "out")]) == 0
    table = rows(tmp_path / "out")
    assert [row["status"] for row in table] == ["ok", "ok", "predicted", "ok", "ok", "ok"]
    assert table[2]["reason"].endswith("no device in the picture; carried on from frame 1")
    assert float(table[2]["sigma_mm"]) > float(table[1]["sigma_mm"])
    series = (tmp_path / "out" / "centerlines.pvd").read_text()
    assert series.count("<DataSet") == 6


def test_the_same_call_goes_on_where_it_stopped(sample, demo, tmp_path, monkeypatch):
    from stereosom_plugin.output import OutputFolder

    output, commit = tmp_path / "out", OutputFolder.commit

    def stop_after_three(folder, result, **described):
        if len(folder.rows) == 3:
            raise KeyboardInterrupt
        commit(folder, result, **described)

    words = ["fluoroscopy", str(sample), "--output", str(output), "--quiet"]
    with monkeypatch.context() as patched:
        patched.setattr(OutputFolder, "commit", stop_after_three)
        assert main(words) == 130
    assert len(rows(output)) == 3
    with open(output / "centerlines.csv", "a") as table:
        table.write("3,0.4,ok,torn")  # as if killed within the write
    before = (output / "centerline_0001.vtp").stat().st_mtime_ns
    assert main(words) == 0
    assert (output / "centerline_0001.vtp").stat().st_mtime_ns == before
    again = rows(output)
    assert [row["frame"] for row in again] == list("012345")
    for one, other in zip(again, rows(demo), strict=True):
        assert float(one["length_mm"]) == pytest.approx(float(other["length_mm"]), abs=0.5)


@pytest.mark.slow
def test_a_killed_run_leaves_whole_files_and_the_same_call_completes_it(sample, tmp_path):
    output = tmp_path / "out"
    words = [sys.executable, "-m", "stereosom_plugin.cli", "fluoroscopy", str(sample)]
    words += ["--output", str(output), "--quiet"]
    for frames in (1, 2, 4):
        running = subprocess.Popen(words)
        while len(list(output.glob("centerline_*.vtp"))) < frames and running.poll() is None:
            time.sleep(0.002)
        running.kill()
        running.wait()
        for file in output.glob("centerline_*.vtp"):
            assert file.read_text().rstrip().endswith("</VTKFile>")
        assert len(rows(output)) < 6
    assert subprocess.run(words).returncode == 0
    assert [row["frame"] for row in rows(output)] == list("012345")
    assert not list(output.glob(".*"))


def test_another_call_is_refused_until_overwrite_is_given(mask_case, tmp_path, capsys):
    words = ["masks", mask_case / "a.png", mask_case / "b.png", "--rig", mask_case / "rig.json"]
    words = [*map(str, words), "--output", str(tmp_path / "out"), "--quiet"]
    assert main(words) == 0
    other = [*words, "--nodes", "40"]
    before = sorted(file.name for file in (tmp_path / "out").iterdir())
    assert "another call" in refused(other, capsys)
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == before
    (tmp_path / "out" / "notes.txt").write_text("mine")
    assert main([*other, "--overwrite"]) == 0
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"


def test_a_folder_with_other_files_is_not_written_into(mask_case, tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("mine")
    words = ["masks", mask_case / "a.png", mask_case / "b.png", "--rig", mask_case / "rig.json"]
    assert "other files" in refused([*words, "--output", tmp_path], capsys)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.tex"]


# ---- bad input ---------------------------------------------------------------------------


def test_a_missing_file(tmp_path, sample, capsys):
    words = ["fluoroscopy", sample / "plane_a.dcm", tmp_path / "gone.dcm"]
    assert "no such file" in refused(
        [*words, "--output", tmp_path / "out"], capsys, tmp_path / "out"
    )


def test_a_file_that_is_not_dicom(tmp_path, sample, capsys):
    words = ["fluoroscopy", sample / "plane_a.dcm", sample / "truth_000.csv"]
    line = refused([*words, "--output", tmp_path / "out"], capsys, tmp_path / "out")
    assert "truth_000.csv" in line
    assert "DICOM" in line


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"b": {"SOPClassUID": "1.2.840.10008.5.1.4.1.1.2", "Modality": "CT"}}, "CT"),
        ({"b": {"StudyInstanceUID": "1.2.3"}}, "stud"),
        ({"a": {"PositionerSecondaryAngle": None}}, "PositionerSecondaryAngle"),
        ({"a": {"PositionerPrimaryAngle": None}}, "PositionerPrimaryAngle"),
        ({"a": {"ImagerPixelSpacing": None}}, "ImagerPixelSpacing"),
    ],
)
def test_planes_that_are_no_biplane_run(write_pair, tmp_path, capsys, changes, says):
    a, b = write_pair(**changes)
    line = refused(["fluoroscopy", a, b, "--output", tmp_path / "out"], capsys, tmp_path / "out")
    assert says in line


def test_one_plane_only(write_pair, tmp_path, capsys):
    a, _ = write_pair()
    refused(["fluoroscopy", a, "--output", tmp_path / "out"], capsys, tmp_path / "out")


def test_different_frame_counts_without_times(write_pair, dicom_files, tmp_path, capsys):
    a, b = write_pair(
        frames_a=dicom_files.gray_frames(4), both={"AcquisitionTime": None, "ContentTime": None}
    )
    line = refused(["fluoroscopy", a, b, "--output", tmp_path / "out"], capsys, tmp_path / "out")
    assert "frames" in line


def test_a_truncated_file(sample, tmp_path, capsys):
    study = tmp_path / "study"
    shutil.copytree(sample, study)
    whole = (study / "plane_b.dcm").read_bytes()
    (study / "plane_b.dcm").write_bytes(whole[: len(whole) // 2])
    refused(["fluoroscopy", study, "--output", tmp_path / "out"], capsys, tmp_path / "out")


def masks_call(mask_case, tmp_path, **replaced):
    files = {name: mask_case / name for name in ("a.png", "b.png", "rig.json")} | replaced
    return ["masks", files["a.png"], files["b.png"], "--rig", files["rig.json"],
            "--output", tmp_path / "out"]  # fmt: skip


def edited_rig(mask_case, tmp_path, edit):
    described = json.loads((mask_case / "rig.json").read_text())
    edit(described)
    path = tmp_path / "rig.json"
    path.write_text(json.dumps(described))
    return path


def test_masks_of_the_wrong_size(mask_case, tmp_path, capsys):
    small = tmp_path / "small.png"
    Image.fromarray(np.full((512, 512), 255, np.uint8)).save(small)
    words = masks_call(mask_case, tmp_path, **{"b.png": small})
    line = refused(words, capsys, tmp_path / "out")
    assert "512×512" in line
    assert "1024×768" in line


@pytest.mark.parametrize("value", [0, 255])
def test_an_empty_mask(mask_case, tmp_path, capsys, value):
    empty = tmp_path / "empty.png"
    Image.fromarray(np.full((768, 1024), value, np.uint8)).save(empty)
    words = masks_call(mask_case, tmp_path, **{"a.png": empty})
    assert "the mask is empty" in refused(words, capsys, tmp_path / "out")


def test_a_rig_whose_cameras_coincide(mask_case, tmp_path, capsys):
    def coincide(rig):
        rig["cameras"][1]["projection"] = rig["cameras"][0]["projection"]

    words = masks_call(
        mask_case, tmp_path, **{"rig.json": edited_rig(mask_case, tmp_path, coincide)}
    )
    assert "same place" in refused(words, capsys, tmp_path / "out")


def test_a_rig_with_a_3_by_3_projection(mask_case, tmp_path, capsys):
    def cut(rig):
        rig["cameras"][0]["projection"] = [row[:3] for row in rig["cameras"][0]["projection"]]

    words = masks_call(mask_case, tmp_path, **{"rig.json": edited_rig(mask_case, tmp_path, cut)})
    assert "must be 3×4, is 3×3" in refused(words, capsys, tmp_path / "out")


def test_a_folder_of_masks_with_an_empty_frame_first(mask_case, tmp_path, capsys):
    for view in "ab":
        (tmp_path / view).mkdir()
        for frame in range(3):
            shutil.copy(mask_case / f"{view}.png", tmp_path / view / f"{frame}.png")
    Image.fromarray(np.zeros((768, 1024), np.uint8)).save(tmp_path / "b" / "0.png")
    words = ["masks", tmp_path / "a", tmp_path / "b", "--rig", mask_case / "rig.json"]
    words += ["--rate", "20", "--output", tmp_path / "out"]
    assert main([str(word) for word in words]) == 1
    table = rows(tmp_path / "out")
    assert [row["status"] for row in table] == ["failed", "ok", "ok"]
    assert [float(row["time_s"]) for row in table] == pytest.approx([0, 0.05, 0.1])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--method", "stereo-som", "--nodes", "2"], "at least 3"),
        (["--method", "stereo-som", "--nodes", "900"], "cannot train 900"),
        (["--length", "-5"], "positive"),
        (["--direction", "0,0,0"], "must not be zero"),
        (["--base", "1,2"], "not X,Y,Z"),
        (["--base", "a,b,c"], "not X,Y,Z"),
        (["--frames", "7:9"], "chooses none"),
        (["--frames", "3"], "not A:B"),
        (["--samples", "1"], "at least 2"),
        (["--spacing", "0"], "not a positive"),
        (["--method", "magic"], "invalid choice"),
    ],
)
def test_options_that_cannot_be(mask_case, tmp_path, capsys, words, says):
    call = [*masks_call(mask_case, tmp_path), *words]
    assert says in refused(call, capsys, tmp_path / "out")


@pytest.mark.parametrize(
    ("truth", "says"),
    [("", "columns x, y, z"), ("x,y\n1,2\n", "is no curve"), ("x,y,z\n1,2,3\n", "two different"),
     ("x,y,z\n1,2,oops\n", "is no curve")],
)  # fmt: skip
def test_truth_that_is_no_curve(demo, tmp_path, capsys, truth, says):
    (tmp_path / "truth.csv").write_text(truth)
    words = ["evaluate", demo / "centerline_0000.vtp", "--truth", tmp_path / "truth.csv"]
    assert says in refused(words, capsys)


def test_one_truth_for_many_frames(demo, sample, capsys):
    words = ["evaluate", demo, "--truth", sample / "truth_000.csv"]
    assert "one curve for 6 frames" in refused(words, capsys)


def test_a_picture_that_is_no_png(demo, tmp_path, capsys):
    words = ["render", demo, "--output", tmp_path / "film.avi"]
    assert ".png" in refused(words, capsys, tmp_path / "film.avi")


def test_a_missing_extra_is_named_in_one_line(monkeypatch, sample, tmp_path, capsys):
    def missing(*_, **__):
        raise ImportError("SimpleITK is missing; install it with: pip install 'stereosom[x]'")

    monkeypatch.setattr(fluoroscopy, "read_biplane", missing)
    line = refused(["fluoroscopy", sample, "--output", tmp_path / "out"], capsys)
    assert "pip install" in line


def test_a_fault_of_our_own_is_one_line_too(monkeypatch, sample, tmp_path, capsys):
    monkeypatch.setattr(fluoroscopy, "read_biplane", lambda *_, **__: 1 / 0)
    line = refused(["fluoroscopy", sample, "--output", tmp_path / "out"], capsys)
    assert "ZeroDivisionError" in line
    assert "STEREOSOM_TRACEBACK" in line


def test_every_command_has_help_with_an_example(capsys):
    for command in ("fluoroscopy", "masks", "render", "evaluate", "demo"):
        with pytest.raises(SystemExit) as stopped:
            main([command, "--help"])
        assert stopped.value.code == 0
        assert "Example: stereosom" in " ".join(capsys.readouterr().out.split())
