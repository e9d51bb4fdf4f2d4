"""Stereo recordings in every layout, paired by time, and checked against their calibration."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.encaps import encapsulate
from pydicom.uid import ExplicitVRLittleEndian

pytest.importorskip("cv2")
from stereosom_plugin.endoscopy import read_stereo

FRAMES = 4


@pytest.fixture
def rig(stereo_films, tmp_path):
    path = tmp_path / "calibration.yaml"
    path.write_text(stereo_films.calibration())
    return path


def levels(acquisition):
    """How bright each eye's pictures are, a pair per frame: what `marked` has put there."""
    return [
        tuple(round(float(eye.mean())) for eye in acquisition.read(index))
        for index in range(len(acquisition))
    ]


EXPECTED = [(10 * k + 10, 10 * k + 15) for k in range(FRAMES)]


def eyes(stereo_films):
    return [tuple(stereo_films.marked(level) for level in pair) for pair in EXPECTED]


def test_a_film_of_each_eye(stereo_films, tmp_path, rig):
    for name, side in (("left", 0), ("right", 1)):
        pictures = [pair[side] for pair in eyes(stereo_films)]
        stereo_films.write_film(tmp_path / f"{name}.mkv", pictures, rate=25)
    found = read_stereo(tmp_path / "left.mkv", tmp_path / "right.mkv", rig, check=False)
    assert levels(found) == EXPECTED
    assert found.times == pytest.approx([0, 0.04, 0.08, 0.12])
    assert found.read(1)[0].shape == (180, 320, 3)
    assert levels(found)[::-1] == EXPECTED[::-1]  # read again, from the beginning


@pytest.mark.parametrize("layout", ["side-by-side", "top-bottom", "interleaved"])
@pytest.mark.parametrize("right_first", [False, True])
def test_both_eyes_in_each_picture(stereo_films, tmp_path, rig, layout, right_first):
    pictures = [stereo_films.stacked(*pair, layout) for pair in eyes(stereo_films)]
    film = stereo_films.write_film(tmp_path / "both.mkv", pictures)
    found = read_stereo(film, None, rig, layout=layout, right_first=right_first, check=False)
    assert levels(found) == [pair[::-1] if right_first else pair for pair in EXPECTED]
    assert found.read(0)[0].shape == (180, 320, 3)


def test_the_eyes_in_turn(stereo_films, tmp_path, rig):
    pictures = [picture for pair in eyes(stereo_films) for picture in pair]
    film = stereo_films.write_film(tmp_path / "turns.mkv", [*pictures, pictures[0]], rate=40)
    found = read_stereo(film, None, rig, layout="interleaved-frames", check=False)
    assert levels(found) == EXPECTED
    assert found.times == pytest.approx([0, 0.05, 0.1, 0.15])
    assert any("last of 9 frames has no other eye" in note for note in found.notes)


def test_eyes_that_were_squeezed_side_by_side_are_widened(stereo_films, tmp_path, rig):
    left, right = stereo_films.wall()
    halves = np.hstack([left[:, ::2], right[:, ::2]])
    film = stereo_films.write_film(tmp_path / "squeezed.mkv", [halves])
    found = read_stereo(film, None, rig, layout="side-by-side", check=False)
    assert found.read(0)[0].shape == (180, 320, 3)
    assert any("widened to 320×180" in note for note in found.notes)


def test_folders_of_pictures(stereo_films, tmp_path, rig):
    from PIL import Image

    for side, name in enumerate(("left", "right")):
        (tmp_path / name).mkdir()
        for number, pair in enumerate(eyes(stereo_films)):
            Image.fromarray(pair[side]).save(tmp_path / name / f"{number:03d}.png")
    found = read_stereo(tmp_path / "left", tmp_path / "right", rig, rate_hz=10, check=False)
    assert levels(found) == EXPECTED
    assert found.times == pytest.approx([0, 0.1, 0.2, 0.3])


def write_dicom(path, syntax, data, frames, compressed=False, **elements):
    described = Dataset()
    described.file_meta = FileMetaDataset()
    described.file_meta.TransferSyntaxUID = syntax
    described.SOPClassUID = "1.2.840.10008.5.1.4.1.1.77.1.1.1"  # Video Endoscopic Image
    described.file_meta.MediaStorageSOPClassUID = described.SOPClassUID
    described.SOPInstanceUID = described.file_meta.MediaStorageSOPInstanceUID = "1.2.3.4"
    described.Rows, described.Columns, described.NumberOfFrames = 180, 320, frames
    described.SamplesPerPixel, described.PlanarConfiguration = 3, 0
    described.BitsAllocated, described.BitsStored, described.HighBit = 8, 8, 7
    described.PixelRepresentation, described.PhotometricInterpretation = 0, "RGB"
    described.FrameTime = "20"
    for keyword, value in elements.items():
        setattr(described, keyword, value)
    described.PixelData = encapsulate([data], has_bot=False) if compressed else data
    if compressed:
        described["PixelData"].VR = "OB"
    described.save_as(path, enforce_file_format=True)
    return path


@pytest.mark.parametrize("planar", [0, 1])
def test_dicom_frames_that_say_they_are_stereo_pairs(stereo_films, tmp_path, rig, planar):
    pictures = [picture for pair in eyes(stereo_films) for picture in pair]
    data = b"".join((np.moveaxis(one, -1, 0) if planar else one).tobytes() for one in pictures)
    file = write_dicom(
        tmp_path / "pairs.dcm", ExplicitVRLittleEndian, data, 8,
        StereoPairsPresent="YES", PlanarConfiguration=planar,
    )  # fmt: skip
    found = read_stereo(file, None, rig, check=False)
    assert levels(found) == EXPECTED
    assert found.times == pytest.approx([0, 0.04, 0.08, 0.12])


def test_a_film_inside_dicom(stereo_films, tmp_path, rig):
    pictures = [picture for pair in eyes(stereo_films) for picture in pair]
    film = stereo_films.write_film(
        tmp_path / "film.mp4", pictures, codec="libx264", pixels="yuv420p"
    )
    file = write_dicom(
        tmp_path / "film.dcm", "1.2.840.10008.1.2.4.102", film.read_bytes(), 8, compressed=True,
        StereoPairsPresent="YES",
    )  # fmt: skip
    found = read_stereo(file, None, rig, check=False)
    assert np.array(levels(found)) == pytest.approx(np.array(EXPECTED), abs=2)
    assert found.times == pytest.approx([0, 0.1, 0.2, 0.3])


def test_unequal_rates_are_paired_by_time_and_it_is_said(stereo_films, tmp_path, rig):
    left = [stereo_films.marked(10 * k) for k in range(9)]
    right = [stereo_films.marked(10 * k) for k in range(5)]
    stereo_films.write_film(tmp_path / "left.mkv", left, rate=50)
    stereo_films.write_film(tmp_path / "right.mkv", right, rate=25)
    found = read_stereo(tmp_path / "left.mkv", tmp_path / "right.mkv", rig, check=False)
    assert levels(found) == [(0, 0), (20, 10), (40, 20), (60, 30), (80, 40)]
    assert found.times == pytest.approx([0, 0.04, 0.08, 0.12, 0.16])
    assert any("50 and 25 frames per second" in note for note in found.notes)
    assert any("9 frames, the right one 5: 5 pairs" in note for note in found.notes)


def test_a_frame_that_one_eye_has_dropped_has_no_pair(stereo_films, tmp_path, rig):
    pictures = [stereo_films.marked(10 * k) for k in range(6)]
    stereo_films.write_film(tmp_path / "left.mkv", pictures)
    stereo_films.write_film(
        tmp_path / "right.mkv", pictures[:2] + pictures[3:], stamps=[0, 1, 3, 4, 5]
    )
    found = read_stereo(tmp_path / "left.mkv", tmp_path / "right.mkv", rig, check=False)
    assert levels(found) == [(level, level) for level in (0, 10, 30, 40, 50)]


def test_a_film_that_ends_early_is_said(stereo_films, tmp_path, rig):
    pictures = [stereo_films.marked(10 * k) for k in range(10)]
    stereo_films.write_film(tmp_path / "left.mkv", pictures)
    stereo_films.write_film(tmp_path / "right.mkv", pictures[:6])
    found = read_stereo(tmp_path / "left.mkv", tmp_path / "right.mkv", rig, check=False)
    assert len(found) == 6
    assert any("right eye's film ends at 0.30 s, 0.20 s before" in note for note in found.notes)


def two_films(stereo_films, folder, pairs):
    """A film of each eye, `left.mkv` and `right.mkv`."""
    return [
        stereo_films.write_film(folder / f"{name}.mkv", [pair[side] for pair in pairs])
        for side, name in enumerate(("left", "right"))
    ]


def test_pictures_that_agree_with_their_calibration_are_taken_as_they_are(
    stereo_films, tmp_path, rig
):
    films = two_films(stereo_films, tmp_path, [stereo_films.wall()])
    found = read_stereo(*films, rig)
    assert found.notes == ()
    assert found.lenses is not None or found.rigs[0].baseline == pytest.approx(5)


def test_rectified_pictures_are_recognized(stereo_films, tmp_path):
    rig = tmp_path / "calibration.yaml"
    rig.write_text(stereo_films.calibration(lens=(-0.3, 0, 0, 0, 0), rectified=True, turned_deg=5))
    films = two_films(stereo_films, tmp_path, [stereo_films.wall()])
    found = read_stereo(*films, rig)
    assert any("rectified: P1 and P2" in note for note in found.notes)
    assert found.lenses is None
    assert found.rigs[0].convergence_deg == pytest.approx(0, abs=1e-6)


def test_a_long_film_takes_no_more_memory_than_a_short_one(stereo_films, tmp_path, rig):
    def most(frames):
        folder = tmp_path / str(frames)
        folder.mkdir()
        films = two_films(stereo_films, folder, [(stereo_films.marked(7),) * 2] * frames)
        tracemalloc.start()
        for _ in read_stereo(*films, rig, check=False):
            pass
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return peak

    most(3)  # what is imported at first use
    picture = 180 * 320 * 3
    assert most(60) < most(6) + picture
