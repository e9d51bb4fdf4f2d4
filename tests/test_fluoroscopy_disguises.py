"""One run as different laboratories would store it: every time the same device comes out.

The study that ships is stored anew: turned and flipped, as a logarithm, inverted, as Enhanced
XA, as single frames, both planes in one file, with a mask to subtract. Its truth stays as it is.
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pydicom
import pytest
import SimpleITK
from pydicom.uid import generate_uid
from scipy.spatial import cKDTree

import stereosom
from stereosom_plugin import fluoroscopy, segmentation

FRAMES = (0, 1)
ONE_PIXEL = 0.27  # mm at the isocenter


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


def curves(given):
    """Each frame by itself: what is tried here is the reading, not the tracking."""
    run = fluoroscopy.read_biplane(given)
    return [stereosom.reconstruct(seen).backbone for seen in segmentation.observe(run)]


@pytest.fixture(scope="module")
def expected(planes, tmp_path_factory):
    return curves(plain(planes, tmp_path_factory.mktemp("plain")))


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


@pytest.mark.parametrize(
    ("disguise", "within"),
    [
        (turned, ONE_PIXEL),  # what finds the device may decide a pixel at its edge otherwise
        (logarithm, ONE_PIXEL),  # and so may rounding
        (inverted, 1e-6),
        (single_frames, 1e-6),
        (one_file, 1e-6),
    ],
)
def test_the_same_device_comes_out(planes, expected, tmp_path, disguise, within):
    found = curves(disguise(planes, tmp_path))
    assert len(found) == len(FRAMES)
    for curve, truth in zip(found, expected, strict=True):
        apart = np.linalg.norm(curve.sample(50) - truth.sample(50), axis=1)
        assert apart.max() < within  # mm


def test_as_enhanced_objects(planes, expected, tmp_path, enhanced_dicom):
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
    for curve, truth in zip(curves(paths), expected, strict=True):
        apart = np.linalg.norm(curve.sample(50) - truth.sample(50), axis=1)
        assert apart.max() < 1e-3  # mm: lengths have 7 digits there


def test_the_truth_that_ships(planes, expected, sample):
    """And that device is the true one."""
    for number, curve in zip(FRAMES, expected, strict=True):
        truth = np.loadtxt(sample / f"truth_{number:03d}.csv", delimiter=",", skiprows=1)
        distances, _ = cKDTree(truth).query(curve.sample(100))
        assert distances.mean() < 0.3  # mm
