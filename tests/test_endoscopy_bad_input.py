"""What cannot be a stereo recording is refused in one line, and leaves nothing behind."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("cv2")
from stereosom_plugin.cli import main


@pytest.fixture
def folder(stereo_films, tmp_path, monkeypatch):
    """A pair of films that agree with `calibration.yaml`."""
    monkeypatch.chdir(tmp_path)
    left, right = stereo_films.wall()
    stereo_films.write_film(tmp_path / "left.mkv", [left, left])
    stereo_films.write_film(tmp_path / "right.mkv", [right, right])
    (tmp_path / "calibration.yaml").write_text(stereo_films.calibration())
    return tmp_path


def refused(capsys, *words):
    """The line that a call ends with."""
    assert main(["endoscopy", *map(str, words), "--output", "out"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    assert said[0].startswith("stereosom: error: ")
    return said[0]


def test_a_calibration_for_another_size(folder, capsys, stereo_films):
    (folder / "calibration.yaml").write_text(stereo_films.calibration(size=(640, 400)))
    line = refused(capsys, "left.mkv", "right.mkv", "--rig", "calibration.yaml")
    assert "640×400" in line
    assert "320×180" in line
    assert not (folder / "out").exists()


def test_left_and_right_exchanged(folder, capsys):
    line = refused(capsys, "right.mkv", "left.mkv", "--rig", "calibration.yaml")
    assert "left and right are exchanged" in line
    assert not (folder / "out").exists()


def test_left_and_right_exchanged_in_one_film(folder, capsys, stereo_films):
    both = stereo_films.stacked(*stereo_films.wall(), "side-by-side")
    stereo_films.write_film(folder / "both.mkv", [both])
    call = ("both.mkv", "--layout", "side-by-side", "--rig", "calibration.yaml")
    line = refused(capsys, *call, "--right-first")
    assert "left and right are exchanged" in line


@pytest.mark.parametrize(("bend", "turned"), [(-0.3, 5), (-0.1, 1)])
def test_rectified_pictures_and_a_calibration_that_is_not(
    folder, capsys, stereo_films, bend, turned
):
    text = stereo_films.calibration(lens=(bend, 0, 0, 0, 0), turned_deg=turned)
    (folder / "calibration.yaml").write_text(text)
    line = refused(capsys, "left.mkv", "right.mkv", "--rig", "calibration.yaml")
    assert "which are rectified" in line
    assert "P1 and P2" in line


def test_what_is_no_film(folder, capsys):
    (folder / "noise.mp4").write_bytes(np.random.default_rng(0).bytes(5000))
    line = refused(capsys, "noise.mp4", "right.mkv", "--rig", "calibration.yaml")
    assert "noise.mp4: is no film" in line
    assert "ffmpeg" in line


def test_a_codec_that_nobody_knows(folder, capsys):
    film = bytearray((folder / "left.mkv").read_bytes())
    at = film.find(b"FFV1")
    assert at > 0
    codec = film.find(b"V_MS/VFW/FOURCC")
    if codec < 0:
        codec = film.find(b"V_FFV1")
    film[codec : codec + 6] = b"V_XXXX"
    film[at : at + 4] = b"XXXX"
    (folder / "unknown.mkv").write_bytes(film)
    line = refused(capsys, "unknown.mkv", "right.mkv", "--rig", "calibration.yaml")
    assert "codec" in line or "decode" in line


def test_a_torn_film_fails_in_the_frames_that_it_lacks(folder, capsys, stereo_films):
    rng = np.random.default_rng(0)
    noise = [rng.integers(0, 255, (180, 320, 3), dtype=np.uint8) for _ in range(6)]
    whole = stereo_films.write_film(folder / "noise.mkv", noise).read_bytes()
    (folder / "torn.mkv").write_bytes(whole[: len(whole) // 2])
    code = main(["endoscopy", "torn.mkv", "noise.mkv", "--rig", "calibration.yaml",
                 "--output", "out"])  # fmt: skip
    said = capsys.readouterr().err
    assert code in (1, 2)
    assert "Traceback" not in said


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("bomb.yaml", "%YAML:1.0\n---\na: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n"),
        ("deep.yaml", "%YAML:1.0\n---\nM1: " + "[" * 5000),
        ("code.yaml", "!!python/object/apply:os.system ['touch owned']\n"),
        ("noise.mat", "MATLAB 5.0 MAT-file" + " " * 105 + "\x00\x01IM" + "\x0f" * 400),
        ("empty.yaml", ""),
    ],
)
def test_a_hostile_calibration(folder, capsys, name, content):
    (folder / name).write_bytes(content.encode("latin-1"))
    line = refused(capsys, "left.mkv", "right.mkv", "--rig", name)
    assert name in line
    assert not (folder / "owned").exists()


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("left.mkv",), "where it holds the two eyes is not said"),
        (("left.mkv", "absent.mkv"), "no such file"),
        (("left.mkv", "right.mkv", "--layout", "top-bottom"), "is for one film"),
        (("left.mkv", "right.mkv", "left.mkv"), "3 inputs"),
        (("left.mkv", "."), "holds no pictures"),
        (("left.mkv", "right.mkv", "--rate", "0"), "no frame rate"),
    ],
)
def test_a_call_that_makes_no_sense(folder, capsys, words, what):
    assert what in refused(capsys, *words, "--rig", "calibration.yaml")


def test_eyes_of_two_sizes(folder, capsys, stereo_films):
    stereo_films.write_film(folder / "small.mkv", [stereo_films.marked(5, (160, 90))])
    line = refused(capsys, "left.mkv", "small.mkv", "--rig", "calibration.yaml")
    assert "320×180 and 160×90" in line
