"""Results as DICOM: read back by highdicom and pydicom, they say what was put in."""

import shutil
import subprocess
import warnings
from datetime import datetime

import highdicom
import numpy as np
import pydicom
import pytest

from stereosom.synthetic import arc
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.centerline import Centerline
from stereosom_plugin.cli import main
from stereosom_plugin.dicom_out import read_origin, write_centerlines, write_masks
from stereosom_plugin.dicom_out.source import new_uid
from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane

NOON = datetime(2026, 1, 5, 12)


@pytest.fixture
def run(write_pair):
    """Three frames of 24 rows and 32 columns, and where they come from."""
    acquisition = read_biplane(*write_pair(both={"PatientName": "Döe^Jane",
                                                 "SpecificCharacterSet": "ISO_IR 192",
                                                 "PatientAge": "061Y"}))  # fmt: skip
    return acquisition, read_origin(acquisition)


def lines(count=3):
    """A quarter circle that grows by 10 mm a frame: its length is π/2 of the radius."""
    found = []
    for frame in range(count):
        curve = arc(50.0 + 10 * frame, 90)
        sigma = {"StandardDeviation": np.full(100, 0.25)}
        found.append(Centerline(curve.sample(100), curve, frame / 15, frame, sigma, {}))
    return found


def written(run, path, **described):
    acquisition, origin = run
    write_centerlines(lines(), origin, acquisition.rigs, path, created=NOON, **described)
    return highdicom.sr.srread(path)


def groups(document):
    found = document.content.get_image_measurement_groups()
    assert found
    return found


def of_kind(item, kind):
    """All content items of a value type below an item."""
    for child in item.get("ContentSequence", []):
        if child.ValueType == kind:
            yield child
        yield from of_kind(child, kind)


def test_the_polyline_is_the_curve(run, tmp_path):
    document = written(run, tmp_path / "c.dcm")
    paths = [item for item in of_kind(document, "SCOORD3D") if item.GraphicType == "POLYLINE"]
    assert len(paths) == 3
    for item, line in zip(paths, lines(), strict=True):
        points = np.reshape(item.GraphicData, (-1, 3))
        np.testing.assert_array_equal(points, line.points.astype(np.float32))


def test_length_deviation_and_tip_are_measured(run, tmp_path):
    document = written(run, tmp_path / "c.dcm")
    for frame, group in enumerate(groups(document)):
        length, deviation = group.get_measurements()
        assert length.name.meaning == "Length"
        assert length.value == pytest.approx((50 + 10 * frame) * np.pi / 2, rel=1e-4)
        assert length.unit.value == deviation.unit.value == "mm"
        assert deviation.value == 0.25
        (tip,) = (item for item in of_kind(deviation[0], "SCOORD3D"))
        np.testing.assert_allclose(tip.GraphicData, [50 + 10 * frame, 0, 50 + 10 * frame],
                                   atol=1e-3)  # fmt: skip


def test_each_frame_refers_to_its_two_pictures(run, tmp_path):
    acquisition, _ = run
    document = written(run, tmp_path / "c.dcm")
    for frame, group in enumerate(groups(document)):
        images = [item.ReferencedSOPSequence[0] for item in of_kind(group[0], "IMAGE")]
        uids = tuple(image.ReferencedSOPInstanceUID for image in images)
        assert uids == acquisition.source_uids
        assert [image.ReferencedFrameNumber for image in images] == [frame + 1] * 2
    (study,) = document.CurrentRequestedProcedureEvidenceSequence
    evidence = {
        image.ReferencedSOPInstanceUID
        for series in study.ReferencedSeriesSequence
        for image in series.ReferencedSOPSequence
    }
    assert evidence == set(acquisition.source_uids)


def test_one_device_is_tracked_through_the_run(run, tmp_path):
    tracked = {group.tracking_uid for group in groups(written(run, tmp_path / "c.dcm"))}
    assert len(tracked) == 1


def test_a_predicted_frame_is_marked(run, tmp_path):
    document = written(run, tmp_path / "c.dcm", predicted=[1])
    marks = [
        [item.ConceptCodeSequence[0].CodeMeaning for item in of_kind(group[0], "CODE")]
        for group in groups(document)
    ]
    assert ["Estimated" in mark for mark in marks] == [False, True, False]


def test_the_document_says_what_its_coordinates_are_and_what_was_assumed(run, tmp_path):
    document = written(run, tmp_path / "c.dcm", notes=["head first is assumed"])
    texts = [item.TextValue for item in of_kind(document, "TEXT")]
    assert any("mm about" in text and "isocenter" in text for text in texts)
    assert "head first is assumed" in texts


def test_patient_and_study_are_the_source_s_word_for_word(run, tmp_path):
    acquisition, origin = run
    written(run, tmp_path / "c.dcm")
    write_masks([np.eye(24, 32, dtype=bool)], origin.frames_a[:1], origin, tmp_path / "m.dcm")
    source = pydicom.dcmread(acquisition.sources[0])
    for name in ("c.dcm", "m.dcm"):
        found = pydicom.dcmread(tmp_path / name)
        for keyword in ("PatientName", "PatientID", "PatientSex", "PatientAge", "StudyDate",
                        "StudyInstanceUID", "StudyID", "PatientBirthDate"):  # fmt: skip
            assert found[keyword].value == source[keyword].value, keyword
        assert found.PatientName == "Döe^Jane"


def test_no_uid_of_the_source_is_used_again(run, tmp_path):
    acquisition, origin = run
    written(run, tmp_path / "c.dcm")
    write_masks([np.eye(24, 32, dtype=bool)], origin.frames_a[:1], origin, tmp_path / "m.dcm")
    write_masks([np.eye(24, 32, dtype=bool)], origin.frames_b[:1], origin, tmp_path / "n.dcm")
    objects = [pydicom.dcmread(path) for path in (*acquisition.sources, *tmp_path.glob("?.dcm"))]
    assert len(objects) == 5
    for keyword in ("SOPInstanceUID", "SeriesInstanceUID"):
        assert len({one[keyword].value for one in objects}) == 5, keyword


def test_the_same_content_at_the_same_time_gives_the_same_bytes(run, tmp_path):
    _, origin = run
    for name in ("1", "2"):
        written(run, tmp_path / f"c{name}.dcm")
        masks = [np.eye(24, 32, dtype=bool)]
        write_masks(masks, origin.frames_a[:1], origin, tmp_path / f"m{name}.dcm", created=NOON)
    for kind in "cm":
        first, second = ((tmp_path / f"{kind}{name}.dcm").read_bytes() for name in "12")
        assert first == second


def test_other_content_is_another_instance_in_the_same_series(run, tmp_path):
    acquisition, origin = run
    one = written(run, tmp_path / "1.dcm")
    write_centerlines(
        lines(2), origin, acquisition.rigs, tmp_path / "2.dcm", created=NOON
    )  # fmt: skip
    two = pydicom.dcmread(tmp_path / "2.dcm")
    assert one.SOPInstanceUID != two.SOPInstanceUID
    assert one.SeriesInstanceUID == two.SeriesInstanceUID


def test_other_geometry_is_another_frame_of_reference(run, tmp_path):
    """Points that were found with another rig must not be overlaid as if they agreed."""
    acquisition, origin = run
    turned = read_biplane(*acquisition.sources).rigs[0]
    turned = type(turned)(turned.b, turned.a, turned.frame)
    for name, rig in (("1", acquisition.rigs[0]), ("2", acquisition.rigs[0]), ("3", turned)):
        write_centerlines(lines(1), origin, [rig], tmp_path / f"{name}.dcm")
    one, two, three = (
        next(of_kind(pydicom.dcmread(tmp_path / f"{name}.dcm"), "SCOORD3D"))
        .ReferencedFrameOfReferenceUID
        for name in "123"
    )  # fmt: skip
    assert one == two != three


@pytest.mark.parametrize("shape", [(24, 32), (23, 31)])
def test_masks_come_back_pixel_for_pixel(write_pair, dicom_files, tmp_path, shape):
    """An odd number of pixels too: frames follow each other without padding."""
    frames = dicom_files.gray_frames(5, *shape)
    acquisition = read_biplane(*write_pair(frames_a=frames, frames_b=frames))
    origin = read_origin(acquisition)
    masks = np.random.default_rng(0).random((5, *shape)) < 0.3
    masks[2] = False  # a frame in which nothing was seen stays a frame
    write_masks(iter(masks), origin.frames_b, origin, tmp_path / "m.dcm")
    found = highdicom.seg.segread(tmp_path / "m.dcm")
    np.testing.assert_array_equal(found.pixel_array.astype(bool), masks)
    for number, group in enumerate(found.PerFrameFunctionalGroupsSequence, start=1):
        picture = group.DerivationImageSequence[0].SourceImageSequence[0]
        assert picture.ReferencedSOPInstanceUID == acquisition.source_uids[1]
        assert picture.ReferencedFrameNumber == number


def test_what_is_no_dicom_is_refused():
    rig = lines()  # never looked at
    plain = Acquisition(lambda index: (None, None), (rig,), [0.0])
    with pytest.raises(InputError, match="not read from DICOM"):
        read_origin(plain)


@pytest.mark.parametrize(
    "change", [{"SeriesInstanceUID": None}, {"SeriesInstanceUID": "1.2.x"}], ids=str
)
def test_what_nothing_can_refer_to_is_refused_in_one_line(write_pair, change):
    with warnings.catch_warnings(action="ignore"):  # pydicom does not like to write this
        paths = write_pair(a=change)
    with pytest.raises(InputError, match="SeriesInstanceUID is no UID"):
        read_origin(read_biplane(*paths))


def test_odd_patient_data_are_taken_over_as_they_stand(write_pair, tmp_path):
    """What a vendor wrote wrongly is not ours to mend, nor a reason to stop."""
    with warnings.catch_warnings(action="ignore"):
        paths = write_pair(both={"PatientSex": "UNKNOWN", "PatientBirthDate": "1965"})
    acquisition = read_biplane(*paths)
    path = tmp_path / "c.dcm"
    write_centerlines(lines(), read_origin(acquisition), acquisition.rigs, path)
    assert pydicom.dcmread(path).PatientSex == "UNKNOWN"


def test_uids_are_valid():
    assert all(new_uid("part", number).is_valid for number in range(100))


def test_the_command_writes_all_three(sample, tmp_path, capsys):
    code = main(["fluoroscopy", str(sample), "--output", str(tmp_path / "out"), "--frames", "0:2",
                 "--dicom-sr", "--dicom-seg"])  # fmt: skip
    assert code == 0, capsys.readouterr().err
    document = highdicom.sr.srread(tmp_path / "out" / "centerlines.dcm")
    rows = (tmp_path / "out" / "centerlines.csv").read_text().splitlines()[1:]
    measured = [group.get_measurements()[0].value for group in groups(document)]
    np.testing.assert_allclose(measured, [float(row.split(",")[3]) for row in rows], rtol=1e-3)
    for view in "ab":
        masks = highdicom.seg.segread(tmp_path / "out" / f"masks_{view}.dcm").pixel_array
        assert len(masks) == 2
        assert masks.any(axis=(1, 2)).all()


@pytest.fixture(params=["series", "both in one", "enhanced"])
def other_run(request, dicom_files, enhanced_dicom, tmp_path):
    """Three frames of each plane as other vendors store them."""
    pictures = dicom_files.gray_frames(3)
    if request.param == "series":
        dicom_files.write_series(tmp_path / "run", 3)
    elif request.param == "both in one":
        dicom_files.write_both(tmp_path / "run" / "ab.dcm", pictures, pictures, turns=True)
    else:
        enhanced_dicom.write_enhanced_pair(tmp_path / "run", pictures, pictures)
    acquisition = read_biplane(tmp_path / "run")
    return acquisition, read_origin(acquisition)


def test_however_the_run_is_stored_the_pictures_referred_to_are_the_right_ones(other_run, tmp_path):
    acquisition, origin = other_run
    write_masks(np.ones((3, 24, 32), dtype=bool), origin.frames_b, origin, tmp_path / "m.dcm")
    document = written(other_run, tmp_path / "c.dcm")
    seen = [[item.ReferencedSOPSequence[0] for item in of_kind(group[0], "IMAGE")]
            for group in groups(document)]  # fmt: skip
    masks = highdicom.seg.segread(tmp_path / "m.dcm").PerFrameFunctionalGroupsSequence
    for frame, (images, mask) in enumerate(zip(seen, masks, strict=True)):
        pair = acquisition[frame]
        of_mask = mask.DerivationImageSequence[0].SourceImageSequence[0]
        for reference, picture in zip(
            (*images, of_mask), (pair.image_a, pair.image_b, pair.image_b), strict=True
        ):
            assert np.array_equal(stored_picture(acquisition, reference), picture)


def stored_picture(acquisition, reference):
    """What pydicom reads where a reference points."""
    for path in acquisition.sources:
        dataset = pydicom.dcmread(path)
        if dataset.SOPInstanceUID == reference.ReferencedSOPInstanceUID:
            number = reference.get("ReferencedFrameNumber")
            return dataset.pixel_array if number is None else dataset.pixel_array[number - 1]
    raise AssertionError("the reference leads nowhere")


@pytest.mark.interop
def test_dciodvfy_finds_no_error_however_the_run_is_stored(other_run, tmp_path):
    _, origin = other_run
    written(other_run, tmp_path / "c.dcm")
    for name, frames in (("a", origin.frames_a), ("b", origin.frames_b)):
        write_masks(np.ones((3, 24, 32), dtype=bool), frames, origin, tmp_path / f"{name}.dcm")
    check_by_dciodvfy(tmp_path)


@pytest.mark.interop
def test_dciodvfy_finds_no_error(run, tmp_path):
    """David Clunie's validator, package dicom3tools, knows the standard's modules."""
    _, origin = run
    written(run, tmp_path / "c.dcm", predicted=[1], notes=["a note"])
    masks = np.random.default_rng(0).random((3, 24, 32)) < 0.3
    write_masks(masks, origin.frames_a, origin, tmp_path / "a.dcm")
    write_masks(masks[:1], origin.frames_b[:1], origin, tmp_path / "b.dcm")
    check_by_dciodvfy(tmp_path)


def check_by_dciodvfy(folder):
    """All three objects of a folder, by name of one letter."""
    if not (program := shutil.which("dciodvfy")):
        pytest.skip("dciodvfy is not here (Debian: apt-get install dicom3tools)")
    paths = list(folder.glob("?.dcm"))
    assert len(paths) == 3
    for path in paths:
        said = subprocess.run([program, "-new", path], capture_output=True, text=True, timeout=60)
        assert "Error" not in said.stderr + said.stdout, said.stderr
        assert said.returncode == 0
