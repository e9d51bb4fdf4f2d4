"""From stored numbers to light, and subtraction of masks."""

from __future__ import annotations

import numpy as np
import pydicom
import pytest

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane

# A device that lets a quarter of the light pass, before a background that doubles in the middle.
BACKGROUND = np.where(np.arange(32) < 16, 500.0, 1000.0) * np.ones((24, 1))
DEVICE = np.where(np.abs(np.arange(24) - 12) < 2, 0.25, 1.0)[:, None] * np.ones((1, 32))


def table(values, function=""):
    """A lookup table from the number 0 on, as DICOM holds it."""
    item = pydicom.Dataset()
    item.LUTDescriptor = [len(values), 0, 16]
    item.ModalityLUTType = "US"
    item.add_new("LUTData", "OW", np.asarray(values, "<u2").tobytes())
    if function:
        item.LUTFunction = function
    return item


def first(paths, **options):
    return read_biplane(*paths, **options)[0].image_a


def share(picture):
    """What the device lets pass of what comes beside it, in both halves of the picture."""
    picture = np.asarray(picture, dtype=float)
    return [picture[12, column] / picture[2, column] for column in (4, 28)]


def stored(values):
    return np.repeat(np.round(values).astype(np.uint16)[None], 3, axis=0)


def test_linear_pixels_are_left_as_they_are(write_pair):
    frames = stored(BACKGROUND * DEVICE)
    acquisition = read_biplane(*write_pair(frames_a=frames))
    np.testing.assert_array_equal(acquisition[0].image_a, frames[0])
    assert acquisition[0].image_a.dtype == np.uint16
    assert share(acquisition[0].image_a) == [0.25, 0.25]


def test_a_logarithm_is_undone_by_its_table(write_pair):
    """The table is the inverse of how these pixels were made: 300 times the logarithm."""
    frames = stored(300 * np.log(BACKGROUND * DEVICE))
    inverse = np.exp(np.arange(4096) / 300).clip(0, 65535)
    changes = {"PixelIntensityRelationship": "LOG", "ModalityLUTSequence": [table(inverse)]}
    acquisition = read_biplane(*write_pair(frames_a=frames, a=changes))
    np.testing.assert_allclose(share(acquisition[0].image_a), 0.25, rtol=0.01)
    assert acquisition.notes == ()


def test_a_logarithm_without_a_table_is_taken_to_span_the_range(write_pair):
    full = 4095 / np.log(4096)
    frames = stored(full * np.log1p(BACKGROUND * DEVICE))
    changes = {"PixelIntensityRelationship": "LOG"}
    acquisition = read_biplane(*write_pair(frames_a=frames, a=changes))
    np.testing.assert_allclose(acquisition[0].image_a, BACKGROUND * DEVICE, rtol=0.002)
    assert "LOG" in acquisition.notes[0]


@pytest.mark.parametrize("relationship", ["DISP", "SQRT", None])
def test_what_is_not_in_proportion_is_said(write_pair, relationship):
    acquisition = read_biplane(*write_pair(a={"PixelIntensityRelationship": relationship}))
    assert (relationship or "is absent") in acquisition.notes[0]


def test_rescaling(write_pair):
    frames = stored((BACKGROUND * DEVICE + 100) * 2)  # a dark current of 100
    changes = {"RescaleSlope": "0.5", "RescaleIntercept": "-100", "RescaleType": "US"}
    picture = first(write_pair(frames_a=frames, a=changes))
    np.testing.assert_allclose(picture, BACKGROUND * DEVICE)


def test_the_sign_of_an_enhanced_object_decides(enhanced_dicom, tmp_path):
    frames = stored(4095 - BACKGROUND * DEVICE)
    groups = enhanced_dicom.groups("A", (-30.0, 0.0), PixelIntensityRelationshipSign=-1)
    paths = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames, a=[groups] * 3)
    np.testing.assert_allclose(first(paths), BACKGROUND * DEVICE)


def test_a_table_to_linear_among_others(enhanced_dicom, tmp_path):
    """A picture stored as the square root; the second table undoes it, the first does not."""
    frames = stored(100 * np.sqrt(BACKGROUND * DEVICE))
    groups = enhanced_dicom.groups("A", (-30.0, 0.0), PixelIntensityRelationship="SQRT")
    paths = enhanced_dicom.write_enhanced_pair(tmp_path, frames, frames, a=[groups] * 3)
    dataset = pydicom.dcmread(paths[0])
    dataset.SharedFunctionalGroupsSequence[0].PixelIntensityRelationshipLUTSequence = [
        table(np.zeros(4096), "TO_LOG"),
        table((np.arange(4096) / 100.0) ** 2, "TO_LINEAR"),
    ]
    dataset.save_as(paths[0])
    np.testing.assert_allclose(share(first(paths)), 0.25, rtol=0.01)


def test_a_torn_table_is_refused(write_pair):
    torn = table(np.arange(10))
    torn.LUTDescriptor = [4096, 0, 16]
    changes = {"PixelIntensityRelationship": "LOG", "ModalityLUTSequence": [torn]}
    with pytest.raises(InputError, match="torn"):
        read_biplane(*write_pair(a=changes))


@pytest.mark.parametrize("bits", [8, 9, 10, 12, 14, 16])
def test_eight_to_sixteen_bits(write_pair, bits):
    kind = np.uint8 if bits == 8 else np.uint16
    frames = np.random.default_rng(0).integers(0, 1 << bits, (2, 24, 32)).astype(kind)
    layout = {"BitsAllocated": 8 * frames.itemsize, "BitsStored": bits, "HighBit": bits - 1}
    paths = write_pair(both=layout, frames_a=frames, frames_b=frames)
    np.testing.assert_array_equal(first(paths), frames[0])
    inverse = layout | {"PhotometricInterpretation": "MONOCHROME1"}
    paths = write_pair("inverse", both=inverse, frames_a=frames, frames_b=frames)
    np.testing.assert_array_equal(first(paths), (1 << bits) - 1 - frames[0].astype(int))


# Frames that dim: 0 and 1 without the device, the others with it, everything one pixel lower.
DIMMED = np.stack([BACKGROUND * factor for factor in (1.1, 0.9)] + [BACKGROUND * DEVICE] * 3)


def mask(**elements):
    item = pydicom.Dataset()
    for keyword, value in elements.items():
        setattr(item, keyword, value)
    return {"MaskSubtractionSequence": [item]}


def subtracted(write_pair, **elements):
    frames = np.round(DIMMED).astype(np.uint16)
    paths = write_pair(both=mask(**elements), frames_a=frames, frames_b=frames)
    return read_biplane(*paths, dsa=True)


def test_an_averaged_mask_leaves_the_device_alone(write_pair):
    run = subtracted(write_pair, MaskOperation="AVG_SUB", MaskFrameNumbers=[1, 2])
    np.testing.assert_allclose(run[3].image_a, 1000 * DEVICE, rtol=0.005)
    assert not any("taken as stored" in note for note in run.notes)


def test_the_operation_applies_to_its_frames_only(write_pair):
    run = subtracted(
        write_pair, MaskOperation="AVG_SUB", MaskFrameNumbers=[1, 2], ApplicableFrameRange=[4, 5]
    )
    np.testing.assert_array_equal(run[2].image_a, np.round(DIMMED[2]))
    np.testing.assert_allclose(run[3].image_a, 1000 * DEVICE, rtol=0.005)


def test_time_interval_differencing(write_pair):
    """Frame 2 (from zero) minus frame 0, frame 3 minus frame 1: PS3.3 C.7.6.10.1.1."""
    run = subtracted(write_pair, MaskOperation="TID", TIDOffset=2)
    np.testing.assert_allclose(run[2].image_a, 1000 * DEVICE / 1.1, rtol=0.01)
    np.testing.assert_allclose(run[3].image_a, 1000 * DEVICE / 0.9, rtol=0.01)
    np.testing.assert_array_equal(run[1].image_a, np.round(DIMMED[1]))  # no frame -1


def test_reversed_time_interval_differencing(write_pair):
    """Contrast frames 3 and 4 (from one) have the masks 2 and 1."""
    run = subtracted(write_pair, MaskOperation="REV_TID", TIDOffset=1, ApplicableFrameRange=[3, 4])
    np.testing.assert_allclose(run[2].image_a, 1000 * DEVICE / 0.9, rtol=0.01)
    np.testing.assert_allclose(run[3].image_a, 1000 * DEVICE / 1.1, rtol=0.01)


def test_a_mask_is_moved_before_it_is_subtracted(write_pair, dicom_files):
    texture = dicom_files.gray_frames(1)[0] // 4 + 1000
    frames = np.stack([texture, np.roll(texture, (2, -3), (0, 1))])
    changes = mask(MaskOperation="AVG_SUB", MaskFrameNumbers=[1], MaskSubPixelShift=[2.0, -3.0])
    run = read_biplane(*write_pair(both=changes, frames_a=frames, frames_b=frames), dsa=True)
    np.testing.assert_allclose(run[1].image_a[3:-3, 4:-4], 1000)


@pytest.mark.parametrize(
    "elements",
    [
        {"MaskOperation": "AVG_SUB", "MaskFrameNumbers": [6]},
        {"MaskOperation": "AVG_SUB", "MaskFrameNumbers": []},
        {"MaskOperation": "AVG_SUB", "MaskFrameNumbers": [1], "ApplicableFrameRange": [1]},
        {"MaskOperation": "AVG_SUB", "MaskFrameNumbers": [1], "ContrastFrameAveraging": 0},
        {"MaskOperation": "REV_TID", "TIDOffset": 9, "ApplicableFrameRange": [1, 5]},
        {"MaskOperation": "OTHER"},
        {"MaskOperation": "NONE"},
    ],
)
def test_impossible_masks_are_refused(write_pair, elements):
    with pytest.raises(InputError, match="leave out --dsa") as raised:
        subtracted(write_pair, **elements)
    assert "\n" not in str(raised.value)


def test_no_mask_to_subtract(write_pair):
    with pytest.raises(InputError, match="prescribes no subtraction"):
        read_biplane(*write_pair(), dsa=True)
