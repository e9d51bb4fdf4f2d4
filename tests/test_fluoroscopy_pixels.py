"""Pictures: every layout and transfer syntax bit by bit, and what is broken."""

from __future__ import annotations

import shutil
import struct
import subprocess

import numpy as np
import pydicom
import pytest

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import codec, read_biplane

RLE = "1.2.840.10008.1.2.5"
# file of the development data, transfer syntax
LOSSLESS = {"JLSL": "80", "JPLL": "70", "J2KR": "90"}


def test_uncompressed_frames(write_pair, dicom_files):
    frames_a, frames_b = dicom_files.gray_frames(4), dicom_files.gray_frames(4, 16, 40, seed=1)
    acquisition = read_biplane(*write_pair(frames_a=frames_a, frames_b=frames_b))
    assert acquisition.rigs[0].b.image_size == (40, 16)
    for index, pair in enumerate(acquisition):
        np.testing.assert_array_equal(pair.image_a, frames_a[index])
        np.testing.assert_array_equal(pair.image_b, frames_b[index])


def test_implicit_value_representations(write_pair, dicom_files):
    frames = dicom_files.gray_frames(2)
    a, b = write_pair(frames_a=frames, frames_b=frames)
    dataset = pydicom.dcmread(a)
    dataset.file_meta.TransferSyntaxUID = "1.2.840.10008.1.2"
    dataset.save_as(a, implicit_vr=True, little_endian=True, enforce_file_format=True)
    np.testing.assert_array_equal(read_biplane(a, b)[1].image_a, frames[1])


def test_eight_bits_and_an_odd_number_of_bytes(write_pair):
    frames = np.arange(3 * 5 * 7, dtype=np.uint8).reshape(3, 5, 7)
    bits = {"BitsAllocated": 8, "BitsStored": 8, "HighBit": 7}
    acquisition = read_biplane(*write_pair(both=bits, frames_a=frames, frames_b=frames))
    np.testing.assert_array_equal(acquisition[2].image_b, frames[2])


def test_monochrome1_is_inverted(write_pair, dicom_files):
    frames = dicom_files.gray_frames(2)
    paths = write_pair(
        both={"PhotometricInterpretation": "MONOCHROME1"}, frames_a=frames, frames_b=frames
    )
    np.testing.assert_array_equal(read_biplane(*paths)[0].image_a, 4095 - frames[0])


def test_signed_pixels_and_what_lies_above_the_stored_bits(write_pair):
    values = np.arange(-2048, 2048, dtype=np.int16).reshape(2, 32, 64)
    overlaid = (values.view(np.uint16) & 0x0FFF) | 0x5000  # an old overlay in the high bits
    signed = {"PixelRepresentation": 1}
    pair = read_biplane(*write_pair(both=signed, frames_a=overlaid, frames_b=overlaid))[1]
    np.testing.assert_array_equal(pair.image_a, values[1])
    signed["PhotometricInterpretation"] = "MONOCHROME1"
    pair = read_biplane(*write_pair("dark", both=signed, frames_a=overlaid, frames_b=overlaid))[1]
    np.testing.assert_array_equal(pair.image_a, -1 - values[1].astype(int))


def test_a_mask_that_is_meant_to_be_subtracted_is_noted(write_pair):
    item = pydicom.Dataset()
    item.MaskOperation = "AVG_SUB"
    acquisition = read_biplane(*write_pair(a={"MaskSubtractionSequence": [item]}))
    assert "taken as stored" in acquisition.notes[0]


@pytest.mark.parametrize("table", [True, False])
def test_rle(write_pair, dicom_files, table):
    frames = dicom_files.gray_frames(3)
    a, b = write_pair(frames_a=frames, frames_b=frames)
    dicom_files.compress(a, RLE, rle_fragments(frames), table)
    for index, pair in enumerate(read_biplane(a, b)):
        np.testing.assert_array_equal(pair.image_a, frames[index])


@pytest.mark.parametrize("name", LOSSLESS)
@pytest.mark.parametrize("pieces", [1, 3])
@pytest.mark.parametrize("table", [True, False])
def test_jpeg_family(write_pair, dicom_files, shared_data, name, pieces, table):
    """Three frames, each of one or more fragments, with and without an offset table."""
    fragment, picture = sample(shared_data, name)
    a, b = write_pair()
    large(dicom_files, a, LOSSLESS[name], [fragment] * 3)
    if pieces > 1:
        dataset = pydicom.dcmread(a)
        dataset.PixelData = pydicom.encaps.encapsulate([fragment] * 3, pieces, table)
        dataset.save_as(a, enforce_file_format=True)
    else:
        large(dicom_files, a, LOSSLESS[name], [fragment] * 3, table)
    acquisition = read_biplane(a, b)
    for index in (2, 0):
        np.testing.assert_array_equal(acquisition[index].image_a, picture)


@pytest.mark.parametrize("name", ["J2KI", "JLSN", "JPLY"])
def test_lossy_jpeg_family_is_near(write_pair, dicom_files, shared_data, name):
    fragment, _ = sample(shared_data, name)
    _, picture = sample(shared_data, "JLSL")
    a, b = write_pair()
    syntax = {"J2KI": "91", "JLSN": "81", "JPLY": "51"}[name]
    large(dicom_files, a, syntax, [fragment] * 3)
    difference = read_biplane(a, b)[1].image_a.astype(int) - picture
    assert np.abs(difference).mean() < 3


def test_opening_reads_no_pixels(write_pair):
    """Frames that were torn out after opening show that opening did not read them."""
    a, b = write_pair()
    acquisition = read_biplane(a, b)
    a.write_bytes(a.read_bytes()[:-2000])
    assert acquisition[0].image_a.shape == (24, 32)
    with pytest.raises(InputError, match="frame 2: the file ends within it"):
        acquisition[2]


@pytest.mark.parametrize("syntax", ["rle", "80"])
def test_one_broken_frame_leaves_the_others(write_pair, dicom_files, shared_data, syntax):
    a, b = write_pair()
    if syntax == "rle":
        frames = dicom_files.gray_frames(3)
        good = rle_fragments(frames)
        dicom_files.compress(a, RLE, [good[0], b"\xff" * 400, good[2]])
        picture = frames[2]
    else:
        fragment, picture = sample(shared_data, "JLSL")
        large(dicom_files, a, syntax, [fragment, fragment[:300] + b"\xff" * 400, fragment])
    acquisition = read_biplane(a, b)
    with pytest.raises(InputError, match="frame 1: ") as raised:
        acquisition[1]
    assert "\n" not in str(raised.value)
    np.testing.assert_array_equal(acquisition[2].image_a, picture)


def test_a_dying_decoder_costs_one_frame(write_pair, dicom_files, shared_data, monkeypatch):
    fragment, picture = sample(shared_data, "JLSL")
    a, b = write_pair()
    large(dicom_files, a, "80", [fragment] * 3)
    acquisition = read_biplane(a, b)
    assert acquisition[0].image_a.shape == picture.shape
    codec._child.process.kill()
    with pytest.raises(InputError, match="its decoder died"):
        acquisition[1]
    np.testing.assert_array_equal(acquisition[2].image_a, picture)
    monkeypatch.setattr(codec, "SECONDS_A_FRAME", 0.0)
    with pytest.raises(InputError, match="took too long"):
        acquisition[1]


def test_hostile_fragments_never_end_the_run(write_pair, dicom_files, shared_data):
    random = np.random.default_rng(5)
    lines = []
    for name, syntax in LOSSLESS.items():
        fragment, _ = sample(shared_data, name)
        fragments = []
        for _ in range(8):
            bytes_ = np.frombuffer(fragment, np.uint8).copy()
            places = random.integers(0, 300, 6)
            bytes_[places] = random.integers(0, 256, 6)
            fragments.append(bytes_.tobytes())
        a, b = write_pair(name, frames_b=dicom_files.gray_frames(8))
        large(dicom_files, a, syntax, fragments, NumberOfFrames=8)
        acquisition = read_biplane(a, b)
        for index in range(8):
            try:
                assert acquisition[index].image_a.shape == (1024, 1024)
            except InputError as error:
                lines.append(str(error))
    assert not any("\n" in line for line in lines)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"Rows": 9000}, "more than is read"),
        ({"NumberOfFrames": 10_001}, "more than is read"),
        ({"Rows": 8192, "Columns": 8192, "NumberOfFrames": 17}, "more than is read"),
        ({"Rows": 25}, "is truncated"),
        ({"NumberOfFrames": 4}, "is truncated"),
        ({"Rows": None}, "has no Rows"),
        ({"Rows": 0}, "promises 3 frames of 32×0"),
        ({"NumberOfFrames": -1}, "promises -1 frames"),
        ({"BitsAllocated": 32}, "laid out"),
        ({"BitsStored": 17}, "laid out"),
        ({"HighBit": 15}, "laid out"),
        ({"SamplesPerPixel": 3}, "not a gray one"),
        ({"PhotometricInterpretation": "PALETTE COLOR"}, "not a gray one"),
        ({"PixelData": None}, "holds no pixels"),
    ],
)
def test_impossible_pixels_are_refused_at_opening(write_pair, changes, why):
    with pytest.raises(InputError, match=why) as raised:
        read_biplane(*write_pair(a=changes))
    assert "\n" not in str(raised.value)


def test_truncated_files_are_recognized_at_opening(write_pair, dicom_files):
    frames = dicom_files.gray_frames(3)
    a, b = write_pair(frames_a=frames)
    a.write_bytes(a.read_bytes()[:-1])
    with pytest.raises(InputError, match="is truncated"):
        read_biplane(a, b)
    c, d = write_pair("compressed", frames_a=frames)
    dicom_files.compress(c, RLE, rle_fragments(frames))
    whole = c.read_bytes()
    for cut in (20, 3000):
        c.write_bytes(whole[:-cut])
        with pytest.raises(InputError, match="truncated or torn"):
            read_biplane(c, d)
    c.write_bytes(whole[:-8])  # only the end mark is missing: nothing is lost
    np.testing.assert_array_equal(read_biplane(c, d)[2].image_a, frames[2])


def test_fragments_that_make_no_frames_are_refused(write_pair, dicom_files):
    frames = dicom_files.gray_frames(3)
    a, b = write_pair(frames_a=frames)
    dicom_files.compress(a, RLE, rle_fragments(frames)[:2])
    with pytest.raises(InputError, match="promises 3 frames and holds 2 pieces"):
        read_biplane(a, b)
    dicom_files.compress(a, RLE, [*rle_fragments(frames)[:2], b"\0" * 2_000_000])
    with pytest.raises(InputError, match="larger than its picture"):
        read_biplane(a, b)


@pytest.mark.parametrize("syntax", ["1.2.840.10008.1.2.2", "1.2.840.10008.1.2.4.100", "1.2.3"])
def test_other_transfer_syntaxes_are_named(write_pair, syntax):
    a, b = write_pair()
    data = a.read_bytes()
    old = b"1.2.840.10008.1.2.1\0"
    mark = data.index(b"UI\x14\x00" + old)
    # the header's length is not corrected: readers do not rely on it
    new = syntax.encode().ljust(len(old) + 4, b"\0")
    a.write_bytes(data[:mark] + b"UI" + struct.pack("<H", len(new)) + new + data[mark + 24 :])
    with pytest.raises(InputError) as raised:
        read_biplane(a, b)
    assert "\n" not in str(raised.value)


@pytest.mark.interop
def test_written_objects_keep_to_the_standard(write_pair, dicom_files, tmp_path):
    """What these tests read is what a device would write (dicom3tools)."""
    program = shutil.which("dciodvfy")
    if program is None:
        pytest.skip("dciodvfy (dicom3tools) is not installed")
    frames = dicom_files.gray_frames(3)
    turning = {
        "PositionerMotion": "DYNAMIC",
        "PositionerPrimaryAngleIncrement": ["0", "5", "10"],
        "PositionerSecondaryAngleIncrement": ["0", "1", "2"],
    }
    written = [
        *write_pair(a=turning),
        *dicom_files.write_series(tmp_path / "series")[::4],
        dicom_files.write_both(tmp_path / "both" / "run.dcm", frames, frames, turns=True),
    ]
    for path in written:
        found = subprocess.run([program, path], capture_output=True, text=True)
        assert "Error" not in found.stderr + found.stdout


def rle_fragments(frames):
    """Each frame, RLE compressed by pydicom."""
    dataset = pydicom.Dataset()
    dataset.file_meta = pydicom.dataset.FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = "1.2.840.10008.1.2.1"
    dataset.Rows, dataset.Columns = frames.shape[1:]
    dataset.NumberOfFrames, dataset.SamplesPerPixel = len(frames), 1
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit = 16, 12, 11
    dataset.PixelRepresentation, dataset.PhotometricInterpretation = 0, "MONOCHROME2"
    dataset.add_new("PixelData", "OW", frames.tobytes())
    dataset.compress(RLE, encoding_plugin="pydicom", generate_instance_uid=False)
    return list(pydicom.encaps.generate_frames(dataset.PixelData, number_of_frames=len(frames)))


def sample(shared_data, name):
    """One compressed frame of the development data, and its picture, (1024, 1024)."""
    folder = shared_data / "xa_transfer_syntaxes"
    dataset = pydicom.dcmread(folder / f"XA1_{name}.dcm")
    fragment = next(pydicom.encaps.generate_frames(dataset.PixelData, number_of_frames=1))
    picture = pydicom.pixels.pixel_array(folder / "XA1_RLE.dcm", decoding_plugin="pydicom")
    return fragment, picture


def large(dicom_files, path, syntax, fragments, table=True, **changes):
    """Put 1024² fragments of 10 bits into a file."""
    size = {"Rows": 1024, "Columns": 1024, "BitsStored": 10, "HighBit": 9} | changes
    dicom_files.compress(path, f"1.2.840.10008.1.2.4.{syntax}", fragments, table, **size)
