"""One run as different laboratories would store it: every time the same device is seen.

The study that ships is stored anew: turned and flipped, as a logarithm, inverted, as Enhanced
XA, as single frames, both planes in one file. Its truth stays as it is: found pixels are held
against the true curve, seen by the cameras that were read.
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pydicom
import pytest
import SimpleITK
from pydicom.uid import generate_uid
from scipy.spatial import cKDTree

from stereosom_plugin import fluoroscopy, segmentation

FRAMES = (0, 1)


@pytest.fixture(scope="module")
def planes(sample):
    """Both objects of the study, with only two of their frames."""
    read = []
    for letter in "ab":
        dataset = pydicom.dcmread(sample / f"plane_{letter}.dcm")
        picture = SimpleITK.ReadImage(str(sample / f"plane_{letter}.dcm"))
        pictures = SimpleITK.GetArrayFromImage(picture)[list(FRAMES)].astype(np.uint16)
        dataset.file_meta.TransferSyntaxUID = "1.2.840.10008.1.2.1"
        store(dataset, pictures)
        dataset.FrameTime = "100"
        read.append((dataset, pictures))
    return read


def store(dataset, pictures):
    dataset.NumberOfFrames = len(pictures)
    dataset.Rows, dataset.Columns = pictures.shape[1:]
    dataset.PixelData = np.ascontiguousarray(pictures).tobytes()
    dataset["PixelData"].VR = "OW"
    dataset["PixelData"].is_undefined_length = False


@pytest.fixture(scope="module")
def truths(sample):
    """The device in space, frame by frame, (n, 3) mm."""
    return [
        np.loadtxt(sample / f"truth_{number:03d}.csv", delimiter=",", skiprows=1)
        for number in FRAMES
    ]


def misses(given, truths):
    """Mean distance, px, between the found pixels and the true curve, by frame and view.

    Both ways: of the pixels from the curve, and of the curve from the pixels.
    """
    run = fluoroscopy.read_biplane(given)
    assert len(run) == len(FRAMES)
    measured = []
    for seen, truth in zip(segmentation.observe(run), truths, strict=True):
        for camera, pixels in ((seen.rig.a, seen.pixels_a), (seen.rig.b, seen.pixels_b)):
            curve = camera.project(truth)
            curve = curve[np.all((curve >= 0) & (curve < camera.image_size), axis=1)]
            across, _ = cKDTree(curve).query(pixels)
            along, _ = cKDTree(pixels).query(curve)
            measured.append((across.mean(), along.mean(), len(pixels)))
    return np.array(measured)


@pytest.fixture(scope="module")
def as_shipped(planes, truths, tmp_path_factory):
    found = misses(plain(planes, tmp_path_factory.mktemp("plain")), truths)
    assert found[:, 0].max() < 2.5  # the device is 8 pixels wide
    assert found[:, 1].max() < 0.6  # and nowhere missed
    return found


def plain(planes, folder):
    for dataset, _ in planes:
        dataset.save_as(folder / f"{dataset.ImageType[2][-1]}.dcm")
    return folder


def turned(planes, folder):
    """Plane A turned clockwise by 90 degrees and flipped, plane B upside down."""
    for (dataset, pictures), turn, flip in zip(planes, (1, 2), ("YES", "NO"), strict=True):
        dataset = deepcopy(dataset)
        pictures = np.rot90(pictures, -turn, (1, 2))
        store(dataset, pictures[:, :, ::-1] if flip == "YES" else pictures)
        dataset.FieldOfViewRotation, dataset.FieldOfViewHorizontalFlip = str(90 * turn), flip
        dataset.save_as(folder / f"{dataset.ImageType[2][-1]}.dcm")
    return folder


def logarithm(planes, folder):
    for dataset, pictures in planes:
        dataset = deepcopy(dataset)
        store(dataset, np.round(4095 / np.log(4096) * np.log1p(pictures)).astype(np.uint16))
        dataset.PixelIntensityRelationship = "LOG"
        dataset.save_as(folder / f"{dataset.ImageType[2][-1]}.dcm")
    return folder


def inverted(planes, folder):
    for dataset, pictures in planes:
        dataset = deepcopy(dataset)
        store(dataset, 4095 - pictures)
        dataset.PhotometricInterpretation = "MONOCHROME1"
        dataset.save_as(folder / f"{dataset.ImageType[2][-1]}.dcm")
    return folder


def single_frames(planes, folder):
    for dataset, pictures in planes:
        for number, picture in enumerate(pictures):
            one = deepcopy(dataset)
            store(one, picture[None])
            for keyword in ("NumberOfFrames", "FrameTime", "FrameIncrementPointer"):
                del one[keyword]
            if number:
                one.SOPInstanceUID = generate_uid()
            one.InstanceNumber, one.AcquisitionTime = number + 1, f"10150{number}.5"
            one.save_as(folder / f"{dataset.ImageType[2][-1]}{9 - number}.dcm")
    return folder


def one_file(planes, folder):
    (dataset, first), (other, second) = planes
    dataset = deepcopy(dataset)
    store(dataset, np.concatenate([first, second]))
    del dataset.ReferencedImageSequence
    dataset.ImageType = ["ORIGINAL", "PRIMARY", "SINGLE PLANE"]
    dataset.PositionerMotion = "DYNAMIC"
    for keyword in ("PositionerPrimaryAngle", "PositionerSecondaryAngle"):
        step = str(other[keyword].value - dataset[keyword].value)
        setattr(dataset, f"{keyword}Increment", ["0", "0", step, step])
    dataset.save_as(folder / "both.dcm")
    return folder / "both.dcm"


@pytest.mark.parametrize("disguise", [turned, logarithm, inverted, single_frames, one_file])
def test_the_same_device_is_seen(planes, truths, as_shipped, tmp_path, disguise):
    found = misses(disguise(planes, tmp_path), truths)
    np.testing.assert_allclose(found[:, :2], as_shipped[:, :2], atol=0.05)
    # Turning and rounding may decide a pixel at the device's edge otherwise.
    np.testing.assert_allclose(found[:, 2], as_shipped[:, 2], rtol=0.01)


def test_as_enhanced_objects(planes, truths, as_shipped, tmp_path, enhanced_dicom):
    (first, pictures_a), (second, pictures_b) = planes
    groups = [
        [
            enhanced_dicom.groups(
                letter,
                (float(dataset.PositionerPrimaryAngle), float(dataset.PositionerSecondaryAngle)),
                DistanceSourceToIsocenter=float(dataset.DistanceSourceToPatient),
                DistanceSourceToDetector=float(dataset.DistanceSourceToDetector),
                ImagerPixelSpacing=[float(step) for step in dataset.ImagerPixelSpacing],
                PatientOrientation=None,
            )
        ]
        * len(FRAMES)
        for letter, dataset in (("A", first), ("B", second))
    ]
    paths = enhanced_dicom.write_enhanced_pair(
        tmp_path, pictures_a, pictures_b, a=groups[0], b=groups[1]
    )
    np.testing.assert_allclose(misses(paths, truths), as_shipped, atol=1e-3)
