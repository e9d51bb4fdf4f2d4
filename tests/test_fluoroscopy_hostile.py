"""Headers that are wrong on purpose: refused in one line, or read with the assumption named.

Never a traceback, and never another geometry in silence: whatever differs from the truth must
come with a note.
"""

from __future__ import annotations

import itertools
import resource
import time
import warnings

import numpy as np
import pydicom
import pytest
from pydicom.datadict import dictionary_VR, tag_for_keyword
from pydicom.dataelem import RawDataElement

from stereosom_plugin.cli import main
from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane

POINTS = np.array([[0.0, 0, 0], [20, -10, 15], [-12, 25, -8]])

CLASSIC = (
    *("PositionerPrimaryAngle", "PositionerSecondaryAngle", "PositionerMotion"),
    *("PositionerPrimaryAngleIncrement", "PositionerSecondaryAngleIncrement"),
    *("DistanceSourceToDetector", "DistanceSourceToPatient", "ImagerPixelSpacing"),
    *("EstimatedRadiographicMagnificationFactor", "FieldOfViewRotation"),
    *("FieldOfViewHorizontalFlip", "PatientPosition", "Rows", "Columns", "NumberOfFrames"),
    *("DetectorPrimaryAngle", "TableAngle", "PatientOrientation"),
)
GROUPED = {
    "PositionerPositionSequence": ("PositionerPrimaryAngle", "PositionerSecondaryAngle"),
    "IsocenterReferenceSystemSequence": (
        *("PositionerIsocenterPrimaryAngle", "PositionerIsocenterSecondaryAngle"),
        *("PositionerIsocenterDetectorRotationAngle", "TableXPositionToIsocenter"),
        *("TableZPositionToIsocenter", "TableHeadTiltAngle", "TableHorizontalRotationAngle"),
    ),
    "XRayGeometrySequence": ("DistanceSourceToIsocenter", "DistanceSourceToDetector"),
    "FieldOfViewSequence": ("FieldOfViewRotation", "FieldOfViewHorizontalFlip"),
    "FramePixelDataPropertiesSequence": ("ImagerPixelSpacing", "PixelIntensityRelationshipSign"),
}
TEXTS = [b"one ", b"nan ", b"-inf", b"1e999 ", b"400 ", b"-400", b"0 ", b"-1", b"1e9 ", b"1\\2\\3 "]


@pytest.fixture(autouse=True)
def the_same_files_every_time(monkeypatch, dicom_files, enhanced_dicom):
    """Damage falls on the same bytes in every run of the tests."""
    numbers = itertools.count(10**9)
    for module in (dicom_files, enhanced_dicom):
        monkeypatch.setattr(module, "generate_uid", lambda: f"1.2.826.0.1.{next(numbers)}")


def said(given):
    """What reading ends in: cameras by frame, notes, or the one line of a refusal."""
    try:
        run = read_biplane(*given)
        pair = run[0]  # and its pictures
    except InputError as error:
        line = str(error)
        assert "\n" not in line
        assert line.count(": ") >= 1
        assert line.count("; ") >= 1
        return None, line
    assert np.isfinite(pair.image_a).all()
    seen = [(run.rig(i).a.project(POINTS), run.rig(i).b.project(POINTS)) for i in range(len(run))]
    assert np.isfinite(seen).all()
    return np.array(seen), run.notes


def spoil(dataset, keyword, value):
    """Put raw bytes into an element, whatever its kind; None removes it."""
    tag = pydicom.tag.Tag(tag_for_keyword(keyword))
    if value is None:
        dataset.pop(tag, None)
        return
    kind = dictionary_VR(tag)
    if kind in ("FL", "US", "SS"):  # numbers in binary: the text stands for one where it can
        try:
            number = float(value.split(b"\\")[0])
            value = {
                "FL": lambda: np.float32(number).tobytes(),
                "US": lambda: np.uint16(number % 65536).tobytes(),
                "SS": lambda: np.int16(number % 32768).tobytes(),
            }[kind]()
        except (ValueError, OverflowError):
            value = value[:3]  # no whole number of numbers
    dataset[tag] = RawDataElement(tag, kind, len(value), value, 0, False, True)


def plausible(keyword, value):
    """Whether a value is another geometry that may well be: nobody can know better."""
    try:
        number = float(value.split(b"\\")[0])
    except ValueError:
        return False
    if b"\\" in value and dictionary_VR(keyword) not in ("FL", "US", "SS"):
        return False
    if "Angle" in keyword:
        return abs(number) <= (180 if "Primary" in keyword else 90)
    if keyword == "EstimatedRadiographicMagnificationFactor":
        return 1 < number < 10
    if keyword in ("DistanceSourceToPatient", "DistanceSourceToIsocenter"):
        return 200 <= number < 1100
    return keyword.endswith("PositionToIsocenter") and abs(number) <= 5000


def never_silent(truth, given, what):
    seen, told = said(given)
    if seen is None:
        return "refused"
    if told:
        return "noted"
    same = len(seen) == len(truth) and np.allclose(seen, truth, atol=1e-3)
    assert same, f"{what}: another geometry, and not a word"
    return "same"


@pytest.mark.parametrize("keyword", CLASSIC)
def test_every_classic_element_spoiled(write_pair, keyword):
    a, b = write_pair()
    truth, notes = said((a, b))
    assert notes == ()
    dataset = pydicom.dcmread(a)
    ends = set()
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for value in (None, b"", *TEXTS):
            if value and plausible(keyword, value):
                continue
            spoil(dataset, keyword, value)
            dataset.save_as(a)
            ends.add(never_silent(truth, (a, b), f"{keyword} = {value!r}"))
    if keyword not in ("PositionerMotion", "PatientOrientation"):
        assert "refused" in ends


@pytest.mark.parametrize("group", GROUPED)
def test_every_grouped_element_spoiled(enhanced_dicom, dicom_files, tmp_path, group):
    frames = dicom_files.gray_frames(3)
    a, b = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames)
    truth, notes = said((a, b))
    assert notes == ()
    whole = a.read_bytes()
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for keyword in GROUPED[group]:
            ends = set()
            for value in (None, b"", *TEXTS):
                if value and plausible(keyword, value):
                    continue
                a.write_bytes(whole)
                dataset = pydicom.dcmread(a)
                item = dataset.SharedFunctionalGroupsSequence[0][group][0]
                spoil(item, keyword, value)
                dataset.save_as(a)
                ends.add(never_silent(truth, (a, b), f"{keyword} = {value!r}"))
            assert ends & {"refused", "noted"}
        for spoiled in ("missing", "empty", "no sequence"):
            a.write_bytes(whole)
            dataset = pydicom.dcmread(a)
            shared = dataset.SharedFunctionalGroupsSequence[0]
            if spoiled == "empty":
                shared[group].value = pydicom.Sequence([])
            else:
                del shared[group]
            if spoiled == "no sequence":
                shared.add_new(group, "LO", "text")
            dataset.save_as(a)
            never_silent(truth, (a, b), f"{group} {spoiled}")


@pytest.mark.parametrize(
    "keyword", ["SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"]
)
@pytest.mark.parametrize("spoiled", ["missing", "empty", "text", "bytes"])
def test_functional_groups_spoiled(enhanced_dicom, dicom_files, tmp_path, keyword, spoiled):
    frames = dicom_files.gray_frames(3)
    a, b = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames)
    truth, _ = said((a, b))
    dataset = pydicom.dcmread(a)
    del dataset[keyword]
    if spoiled == "empty":
        dataset.add_new(keyword, "SQ", [])
    elif spoiled == "text":
        dataset.add_new(keyword, "LO", "text")
    elif spoiled == "bytes":
        tag = pydicom.tag.Tag(tag_for_keyword(keyword))
        dataset[tag] = RawDataElement(tag, "SQ", 6, b"\xfe\xff\x00\xe0\xff\x7f", 0, False, True)
    dataset.save_as(a)
    never_silent(truth, (a, b), f"{keyword} {spoiled}")


def test_planes_that_are_named_the_other_way_round(write_pair, dicom_files):
    """The letters decide which view is which; the geometry stays with its pictures."""
    a, b = write_pair()
    right = read_biplane(a, b)
    dicom_files.rewrite(a, ImageType=["ORIGINAL", "PRIMARY", "BIPLANE B"])
    dicom_files.rewrite(b, ImageType=["ORIGINAL", "PRIMARY", "BIPLANE A"])
    swapped = read_biplane(a, b)
    np.testing.assert_array_equal(swapped.rigs[0].a.projection, right.rigs[0].b.projection)
    np.testing.assert_array_equal(swapped[0].image_a, right[0].image_b)


def test_a_header_of_private_elements_alone(write_pair):
    a, b = write_pair()
    dataset = pydicom.dcmread(a)
    meta, pixels = dataset.file_meta, dataset.PixelData
    private = pydicom.Dataset()
    private.file_meta = meta
    block = private.private_block(0x0019, "PHANTOM", create=True)
    for element in range(0x10, 0x40):
        block.add_new(element, "LO", "secret")
    private.add_new("PixelData", "OW", pixels)
    private.save_as(a, enforce_file_format=True)
    for given in ((a, b), (a,)):
        _, line = said(given)
        assert "has no SOPClassUID" in line


def test_a_header_too_large_to_be_one(write_pair):
    """An element that a header needs, of 100 MB: refused before it is taken to memory."""
    a, b = write_pair()
    data = a.read_bytes()
    mark = data.index(b"\x08\x00\x08\x00CS")
    with a.open("wb") as file:
        file.write(data[:mark] + b"\x08\x00\x08\x00UT\0\0" + (100_000_000).to_bytes(4, "little"))
        file.truncate(file.tell() + 100_000_000)
        file.seek(0, 2)
        file.write(data[mark:])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    _, line = said((a, b))
    assert "more than 16 MiB" in line
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # kB


def test_a_million_empty_items(enhanced_dicom, dicom_files, tmp_path):
    frames = dicom_files.gray_frames(3)
    a, b = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames)
    dataset = pydicom.dcmread(a)
    tag = pydicom.tag.Tag("PerFrameFunctionalGroupsSequence")
    items = b"\xfe\xff\x00\xe0\0\0\0\0" * 1_000_000
    dataset[tag] = RawDataElement(tag, "SQ", len(items), items, 0, False, True)
    dataset.save_as(a)
    begun = time.process_time()
    _, line = said((a, b))
    assert "more than 100000 items" in line
    assert time.process_time() - begun < 1


@pytest.mark.slow
def test_a_million_empty_items_of_no_length(enhanced_dicom, dicom_files, tmp_path):
    """The same in a sequence whose end only its end mark tells, which is parsed at once."""
    frames = dicom_files.gray_frames(3)
    a, b = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames)
    data = a.read_bytes()
    mark = data.index(b"\x00\x52\x29\x92SQ")
    items = b"\xfe\xff\x00\xe0\0\0\0\0" * 1_000_000
    begin = b"\x00\x52\x29\x92SQ\0\0\xff\xff\xff\xff"
    a.write_bytes(data[:mark] + begin + items + b"\xfe\xff\xdd\xe0\0\0\0\0" + data[mark:])
    begun = time.process_time()
    _, line = said((a, b))
    assert "too many items" in line
    assert time.process_time() - begun < 20


def test_the_command_ends_in_one_line(write_pair, capsys):
    a, b = write_pair()
    whole = a.read_bytes()
    random = np.random.default_rng(11)
    codes = set()
    for _ in range(40):
        mutated = np.frombuffer(whole, np.uint8).copy()
        mutated[random.integers(0, 1200, 20)] = random.integers(0, 256, 20)
        a.write_bytes(mutated.tobytes())
        code = main(["fluoroscopy", "--describe", str(a), str(b)])
        printed = capsys.readouterr()
        codes.add(code)
        assert code in (0, 2)
        assert "Traceback" not in printed.err
        assert "fault of stereosom" not in printed.err
        assert len(printed.err.splitlines()) == (1 if code else 0)
    assert 2 in codes


def mutated(whole, random, header):
    """One of many ways in which a file can be damaged."""
    data = bytearray(whole)
    way = random.integers(6)
    for _ in range(random.integers(1, 4)):
        place = int(random.integers(0, header))
        if way <= 2:
            data[place] = random.integers(256)
        elif way == 3:
            data[place : place + 1] = random.bytes(int(random.integers(0, 9)))
        elif way == 4:
            del data[place : place + int(random.integers(1, 40))]
        else:
            data[place] = b"0123456789.-\\ "[random.integers(14)]
    if random.random() < 0.05:
        del data[int(random.integers(0, len(data))) :]
    return bytes(data)


def independently(path):
    """Where the points fall by pydicom's reading of the five elements and the standard's words.

    None where those do not say it in full.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            header = pydicom.dcmread(path, stop_before_pixels=True, force=True)
            primary = np.radians(float(header.PositionerPrimaryAngle))
            secondary = np.radians(float(header.PositionerSecondaryAngle))
            detector = float(header.DistanceSourceToDetector)
            isocenter = float(header.DistanceSourceToPatient)
            rows, columns = (float(step) for step in header.ImagerPixelSpacing)
            center = (header.Columns - 1) / 2, (header.Rows - 1) / 2
    except Exception:
        return None
    return projected(primary, secondary, detector, isocenter, (rows, columns), center)


def of_groups(path):
    """The same from the shared functional groups of an enhanced object, the table left out."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            header = pydicom.dcmread(path, stop_before_pixels=True, force=True)
            shared = header.SharedFunctionalGroupsSequence[0]
            room = shared.IsocenterReferenceSystemSequence[0]
            distances = shared.XRayGeometrySequence[0]
            pitch = shared.FramePixelDataPropertiesSequence[0].ImagerPixelSpacing
            return projected(
                np.radians(float(room.PositionerIsocenterPrimaryAngle)),
                np.radians(float(room.PositionerIsocenterSecondaryAngle)),
                float(distances.DistanceSourceToDetector),
                float(distances.DistanceSourceToIsocenter),
                (float(pitch[0]), float(pitch[1])),
                ((header.Columns - 1) / 2, (header.Rows - 1) / 2),
                float(room.PositionerIsocenterDetectorRotationAngle),
            )
    except Exception:
        return None


def projected(primary, secondary, detector, isocenter, pitch, center, turn=0.0):
    """Where the points fall: the standard's words, not the code under test's matrix."""
    # To the detector: to the left for LAO, to the front, to the head for cranial.
    to_detector = np.array(
        [
            np.sin(primary) * np.cos(secondary),
            -np.cos(primary) * np.cos(secondary),
            np.sin(secondary),
        ]
    )
    right = np.array([np.cos(primary), np.sin(primary), 0])
    down = np.cross(right, to_detector)
    scale = detector / (isocenter + POINTS @ to_detector)
    x, y = scale * (POINTS @ right), scale * (POINTS @ down)
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    rows, columns = pitch
    return np.column_stack(
        [center[0] + (cos * x + sin * y) / columns, center[1] + (cos * y - sin * x) / rows]
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_two_thousand_damaged_files(write_pair, seed):
    """500 damaged files for each of four seeds."""
    a, b = write_pair()
    whole = a.read_bytes()
    header = whole.index(b"\xe0\x7f\x10\x00OW") + 12
    random = np.random.default_rng(seed)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ends = {"refused": 0, "read": 0, "noted": 0}
    for _ in range(500):
        a.write_bytes(mutated(whole, random, header))
        begun = time.process_time()
        seen, told = said((a, b))
        assert time.process_time() - begun < 2
        if seen is None:
            ends["refused"] += 1
        elif told:
            ends["noted"] += 1
        else:
            ends["read"] += 1
            np.testing.assert_allclose(seen[0][0], independently(a), atol=1e-6)
    assert min(ends.values()) > 0
    print(ends)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kB


@pytest.mark.slow
def test_damaged_enhanced_files(enhanced_dicom, dicom_files, tmp_path):
    frames = dicom_files.gray_frames(3)
    a, b = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames)
    whole = a.read_bytes()
    header = whole.index(b"\xe0\x7f\x10\x00OW") + 12
    random = np.random.default_rng(5)
    ends = {"refused": 0, "read": 0, "noted": 0}
    for _ in range(500):
        a.write_bytes(mutated(whole, random, header))
        begun = time.process_time()
        seen, told = said((a, b))
        assert time.process_time() - begun < 2
        ends["refused" if seen is None else "noted" if told else "read"] += 1
        if seen is not None and not told:
            np.testing.assert_allclose(seen[0][0], of_groups(a), atol=1e-3)
    print(ends)
    assert min(ends.values()) > 0
