"""Wrong inputs: each is refused in one clear line."""

from __future__ import annotations

import os
import shutil
import zlib

import numpy as np
import pydicom
import pytest

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane


def refusal(*given):
    """The one line with which something is refused."""
    with pytest.raises(InputError) as raised:
        read_biplane(*given)
    line = str(raised.value)
    assert "\n" not in line
    assert line.count("; ") >= 1
    return line


def test_missing_file(write_pair):
    a, b = write_pair()
    assert "no such file" in refusal(a, b.with_name("c.dcm"))
    assert "no such file" in refusal(b.with_name("nowhere"))


def test_not_dicom(write_pair, tmp_path):
    a, _ = write_pair()
    text = tmp_path / "text.dcm"
    for content in (b"", b"no DICOM" * 100, bytes(128) + b"DICM", bytes(128) + b"DICM\2\0junk"):
        text.write_bytes(content)
        refusal(a, text)
    assert "DICOM" in refusal(tmp_path / "text.dcm")


def test_a_folder_in_place_of_a_file(write_pair):
    a, b = write_pair()
    assert read_biplane(a, a.parent).sources == (a, b)
    _, d = write_pair("other")
    assert "3 runs or planes" in refusal(a.parent, d)


@pytest.mark.parametrize(
    ("uid", "name"),
    [
        ("1.2.840.10008.5.1.4.1.1.2", "CT Image Storage"),
        ("1.2.840.10008.5.1.4.1.1.12.2", "X-Ray Radiofluoroscopic Image Storage"),
        ("1.2.3", "1.2.3"),
    ],
)
def test_other_objects(write_pair, uid, name):
    a, b = write_pair(b={"SOPClassUID": uid})
    assert name in refusal(a, b)
    assert name in refusal(b)


def test_one_plane_only(write_pair):
    a, b = write_pair()
    assert "one plane only" in refusal(a)
    assert "one plane only" in refusal([a])
    assert "0 files were given" in refusal([])
    b.unlink()
    assert "no biplane pair (1 X-ray angiograms: plane_a.dcm (A))" in refusal(a.parent)


def test_planes_of_different_studies(write_pair, dicom_files):
    a, b = write_pair()
    dicom_files.rewrite(b, StudyInstanceUID="1.2.3")
    assert "different studies" in refusal(a, b)


def test_planes_of_different_runs_of_one_study(write_pair):
    a, _ = write_pair(study="1.2.3")
    _, d = write_pair("later", study="1.2.3")
    assert "its other plane is another object" in refusal(a, d)


def test_same_plane_twice(write_pair):
    a, b = write_pair()
    assert "same plane twice" in refusal(a, a)
    assert "same plane twice" in refusal(a, shutil.copy(a, a.with_name("copy.dcm")))
    c, d = write_pair("letters", both={"ImageType": ["ORIGINAL", "PRIMARY", "BIPLANE A"]})
    assert "both plane A" in refusal(c, d)
    assert len(read_biplane(a, b)) == 3


def test_two_single_plane_runs(write_pair):
    single = {
        "ImageType": ["ORIGINAL", "PRIMARY", "SINGLE PLANE"],
        "ReferencedImageSequence": None,
    }
    assert "nothing in them says" in refusal(*write_pair(both=single))


@pytest.mark.parametrize("keyword", ["StudyInstanceUID", "SOPInstanceUID"])
def test_missing_identity(write_pair, keyword):
    a, b = write_pair()
    dataset = pydicom.dcmread(b)
    del dataset[keyword]
    dataset.save_as(b)
    assert f"has no {keyword}" in refusal(a, b)


def test_folder_without_angiograms(tmp_path, write_pair):
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "no biplane pair (0 X-ray angiograms)" in refusal(empty)
    a, _ = write_pair("ct", both={"SOPClassUID": "1.2.840.10008.5.1.4.1.1.2"})
    assert "0 X-ray angiograms" in refusal(a.parent)


def test_folder_with_two_pairs(write_pair, tmp_path):
    write_pair("first")
    write_pair("second")
    line = refusal(tmp_path)
    assert "2 possible biplane pairs (4 X-ray angiograms: " in line
    assert os.path.join("second", "plane_b.dcm") + " (B)" in line


def test_folder_names_what_it_could_not_read(write_pair):
    a, b = write_pair()
    b.write_bytes(bytes(128) + b"DICM\2\0junk")
    assert "not readable: " in refusal(a.parent)


def test_a_deflated_file_is_refused_before_it_is_unpacked(write_pair):
    a, b = write_pair()
    bomb = zlib.compressobj(9, wbits=-15)
    data = b.read_bytes()
    mark = b"1.2.840.10008.1.2.1\0"
    head, rest = data.split(mark, 1)
    head = head[:-2] + (22).to_bytes(2, "little")
    packed = bomb.compress(rest) + bomb.flush()
    b.write_bytes(head + b"1.2.840.10008.1.2.1.99" + packed)
    assert "deflated" in refusal(a, b)


def test_deeply_nested_sequences_are_refused(write_pair):
    a, b = write_pair()
    open_sequence = b"\x08\x00\x40\x11SQ\0\0\xff\xff\xff\xff\xfe\xff\x00\xe0\xff\xff\xff\xff"
    data = a.read_bytes()
    start = data.index(b"\x08\x00\x08\x00CS")
    a.write_bytes(data[:start] + open_sequence * 50_000)
    refusal(a, b)


def test_a_malformed_reference_is_refused(write_pair):
    a, b = write_pair()
    dataset = pydicom.dcmread(a)
    dataset.add_new("ReferencedImageSequence", "LO", "no sequence")
    dataset.save_as(a)
    assert "ReferencedImageSequence" in refusal(a, b)


def test_mutated_headers_raise_nothing_else(write_pair):
    a, b = write_pair()
    data = np.frombuffer(a.read_bytes(), np.uint8)
    random = np.random.default_rng(3)
    lines = []
    for _ in range(300):
        mutated = data.copy()
        mutated[random.integers(132, 2000, 4)] = random.integers(0, 256, 4)
        a.write_bytes(mutated.tobytes())
        try:
            read_biplane(a, b)[0]
        except InputError as error:
            lines.append(str(error))
    assert lines
    assert not any("\n" in line for line in lines)


def test_missing_extra_is_named(monkeypatch):
    import sys

    from stereosom_plugin.errors import require

    monkeypatch.setitem(sys.modules, "pydicom", None)
    with pytest.raises(ImportError, match=r"stereosom\[fluoroscopy\]"):
        require("pydicom", "fluoroscopy")
