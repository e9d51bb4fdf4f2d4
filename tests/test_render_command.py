"""`stereosom render`: every picture and film that can be asked for, and every refusal."""

import shutil

import numpy as np
import pytest
from PIL import Image

from stereosom_plugin.cli import main
from stereosom_plugin.commands import drawing
from stereosom_plugin.output import COLUMNS

av = pytest.importorskip("av", reason="films need PyAV")
SMALL = ("--size", "160x120", "--quiet")


@pytest.fixture(scope="module")
def run_of_masks(tmp_path_factory):
    """Four frames of a bending arc; of the third, view b shows nothing."""
    from stereosom.synthetic import arc, converging_rig, silhouette
    from stereosom_plugin.calibration import write_rig

    folder, rig = tmp_path_factory.mktemp("run"), converging_rig(60)
    for view, camera in (("a", rig.a), ("b", rig.b)):
        (folder / view).mkdir()
        for frame in range(4):
            mask = silhouette(arc(60, 70 + 8 * frame), 1.0, camera).astype(np.uint8) * 255
            if (view, frame) == ("b", 2):
                mask[:] = 0
            Image.fromarray(mask).save(folder / view / f"{frame}.png")
    write_rig([rig], folder / "rig.json")
    words = ["masks", folder / "a", folder / "b", "--rig", folder / "rig.json", "--rate", "8"]
    main([*map(str, words), "--output", str(folder / "out"), "--quiet"])
    return folder / "out"


def render(*words):
    return main(["render", *map(str, words)])


def refused(capsys, *words):
    """The one line that a call ends in; what it wrote is checked by whoever asks."""
    assert render(*words) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    lines = [line for line in printed.err.splitlines() if "error:" in line]
    assert len(lines) == 1
    assert ";" in lines[0]
    return lines[0]


def frames_of(path):
    with av.open(str(path)) as film:
        rate = float(film.streams.video[0].average_rate)
        return [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)], rate


def test_the_masks_are_a_run_with_a_hole(run_of_masks):
    rows = (run_of_masks / "centerlines.csv").read_text().splitlines()[1:]
    assert [row.split(",")[2] for row in rows[:2]] == ["ok", "ok"]
    assert len(rows) == 4


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--view", "best", "--color-by", "StandardDeviation"),
        ("--view", "a", "--frame", "3", "--ghosts", "2"),
        ("--view", "b", "--color-by", "Time"),
        ("--overlay", "both", "--outline"),
        ("--overlay", "b"),
    ],
    ids=" ".join,
)
def test_pictures(run_of_masks, tmp_path, capsys, words):
    assert render(run_of_masks, "--output", tmp_path / "p.png", *SMALL, *words) == 0
    with Image.open(tmp_path / "p.png") as picture:
        assert picture.size == (160, 120)
        assert np.ptp(np.asarray(picture)) > 100
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("name", ["film.mp4", "FILM.GIF"])
def test_a_film_has_a_picture_per_frame_at_the_rate_of_the_run(run_of_masks, tmp_path, name):
    assert render(run_of_masks, "--output", tmp_path / name, *SMALL, "--ghosts", 2) == 0
    pictures, rate = frames_of(tmp_path / name)
    assert (len(pictures), pictures[0].shape) == (4, (120, 160, 3))
    assert rate == pytest.approx(8, rel=0.1)  # a GIF counts hundredths of a second
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_a_film_over_the_pictures_shows_each_frame_of_the_source(run_of_masks, tmp_path):
    words = ("--overlay", "a", "--outline", "--quiet", "--fps", "5")
    assert render(run_of_masks, "--output", tmp_path / "f.mp4", *words) == 0
    pictures, rate = frames_of(tmp_path / "f.mp4")
    assert rate == 5
    for k, drawn in enumerate(pictures):
        with Image.open(run_of_masks.parent / "a" / f"{k}.png") as source:
            mask = np.asarray(source)
        factor = drawn.shape[0] // mask.shape[0]
        bright = drawn[::factor, ::factor].min(axis=-1) > 128
        # Words and line lie over a part of it: below them is the source's own frame.
        free = slice(mask.shape[0] // 8, -mask.shape[0] // 8)
        agree = (bright == (mask > 128))[free].mean()
        assert agree > 0.9
        assert drawn[free].std() > 0


def test_a_turntable_goes_around_once(run_of_masks, tmp_path):
    words = (*SMALL, "--turntable", "--view", "best", "--fps", "2")
    assert render(run_of_masks / "centerline_0001.vtp", "--output", tmp_path / "t.mp4", *words) == 0
    pictures, _ = frames_of(tmp_path / "t.mp4")
    assert len(pictures) == 12
    apart = [np.abs(picture.astype(int) - pictures[0]).mean() for picture in pictures[1:]]
    assert min(apart) > 0.05


def test_frames_without_a_curve_are_in_the_film_and_say_why(run_of_masks):
    results = drawing.Results(run_of_masks)
    lost = [frame for frame in results.frames if frame not in results.with_curve]
    for frame in lost:
        assert results.line(frame) is None
        assert results.state(frame).startswith(("lost: ", "failed: "))
    assert results.rate() == pytest.approx(8)
    assert results.images(0)[0].shape == results.rig(0).a.image_size[::-1]
    assert results.images(99) is None


def test_pictures_that_are_gone_are_told_once(run_of_masks, tmp_path, capsys):
    moved = tmp_path / "moved"
    shutil.copytree(run_of_masks, moved)
    (moved / "run.json").unlink()
    assert render(moved, "--output", tmp_path / "p.png", "--size", "160x120") == 0
    assert "are not found: it is drawn without them" in capsys.readouterr().err
    says = refused(capsys, moved, "--output", tmp_path / "o.png", "--overlay", "a")
    assert "not in their place" in says
    assert not (tmp_path / "o.png").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--output", "f.avi"), "is no .png, .mp4 or .gif"),
        (("--output", "no/f.png"), "cannot be written (No such file or directory)"),
        (("--output", "no/f.mp4"), "cannot be written (No such file or directory)"),
        (("--output", "f.png", "--size", "big"), "'big' is not WxH"),
        (("--output", "f.png", "--size", "20x20"), "between 64 and 8192"),
        (("--output", "f.png", "--size", "99999x99999"), "between 64 and 8192"),
        (("--output", "f.mp4", "--size", "641x480"), "give --size 640x480"),
        (("--output", "f.png", "--frame", "9"), "give one from 0 to 3"),
        (("--output", "f.png", "--turntable"), "makes a film"),
        (("--output", "f.png", "--fps", "5"), "is for films"),
        (("--output", "f.mp4", "--fps", "nan"), "'nan' is not a rate"),
        (("--output", "f.mp4", "--frame", "1"), "is one picture, no film"),
        (("--output", "f.png", "--outline"), "needs --overlay"),
        (("--output", "f.mp4", "--overlay", "a", "--ghosts", "3"), "does not go with --overlay"),
        (("--output", "f.png", "--overlay", "c"), "invalid choice"),
        (("--output", "f.png", "--ghosts", "-1"), "not a number from 0 to 1000"),
        (("--output", "f.png", "--color-by", "Beauty"), "invalid choice"),
    ],
)
def test_what_cannot_be_drawn_is_one_line_and_leaves_nothing(
    run_of_masks, tmp_path, capsys, monkeypatch, words, says
):
    monkeypatch.chdir(tmp_path)
    assert says in refused(capsys, run_of_masks, *words)
    assert not list(tmp_path.iterdir())


def test_a_run_of_no_frames_and_a_frame_without_a_curve(tmp_path, run_of_masks, capsys):
    empty = tmp_path / "empty"
    shutil.copytree(run_of_masks, empty)
    header = ",".join(COLUMNS) + "\n"
    (empty / "centerlines.csv").write_text(header)
    says = refused(capsys, empty, "--output", tmp_path / "p.png")
    assert "no curve in any of its 0 frames" in says
    rows = "0,0.0,ok,1,0,0,0,0,0,0,\n1,0.1,lost,,,,,,,,no device was seen\n"
    (empty / "centerlines.csv").write_text(header + rows)
    says = refused(capsys, empty, "--output", tmp_path / "p.png", "--frame", "1")
    assert "has no curve (lost: no device was seen); give another one, such as 0" in says


def test_a_single_shape_is_no_film(run_of_masks, tmp_path, capsys):
    shape = run_of_masks / "centerline_0000.vtp"
    says = refused(capsys, shape, "--output", tmp_path / "f.mp4")
    assert "give --turntable" in says


def test_a_lone_file_is_drawn_but_knows_no_view(run_of_masks, tmp_path, capsys):
    lone = tmp_path / "lone.vtp"
    shutil.copy(run_of_masks / "centerline_0000.vtp", lone)
    assert render(lone, "--output", tmp_path / "p.png", *SMALL) == 0
    assert "without a rig" in refused(capsys, lone, "--output", tmp_path / "q.png", "--view", "a")


def test_polydata_of_others_without_arrays(tmp_path, capsys):
    """What another program writes: one polyline, and nothing along it."""
    import pyvista

    bare = tmp_path / "bare.vtp"
    line = pyvista.MultipleLines(np.cumsum(np.eye(3), axis=0) * 10)
    line.save(bare)
    assert render(bare, "--output", tmp_path / "p.png", *SMALL) == 0
    says = refused(capsys, bare, "--output", tmp_path / "q.png", "--color-by", "Curvature")
    assert "has no array Curvature to color it by; give --color-by one of Time" in says


def test_an_array_of_no_numbers_is_as_good_as_none(run_of_masks, tmp_path, capsys):
    import pyvista

    broken = tmp_path / "nan.vtp"
    line = pyvista.read(run_of_masks / "centerline_0000.vtp")
    for name in ("Curvature", "Radius", "StandardDeviation", "Determined"):
        line.point_data[name] = np.full_like(line.point_data[name], np.nan)
    line.save(broken)
    words = (*SMALL, "--color-by", "Time", "--view", "best")
    assert render(broken, "--output", tmp_path / "p.png", *words) == 0
    says = refused(capsys, broken, "--output", tmp_path / "q.png", "--color-by", "Curvature")
    assert "has no array Curvature" in says
