"""Write biplane X-ray angiography runs as a standard-abiding device would."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.encaps import encapsulate
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

XA = "1.2.840.10008.5.1.4.1.1.12.1"

ELEMENTS = {
    "StudyDate": "20260105",
    "AcquisitionDate": "20260105",
    "ContentDate": "20260105",
    "StudyTime": "101500",
    "AcquisitionTime": "101500",
    "ContentTime": "101500",
    "AccessionNumber": "",
    "Modality": "XA",
    "Manufacturer": "Phantom",
    "ReferringPhysicianName": "",
    "PatientName": "Phantom^Tube",
    "PatientID": "TUBE1",
    "PatientBirthDate": "",
    "PatientSex": "O",
    "PatientPosition": "HFS",
    "BodyPartExamined": "CHEST",
    "KVP": "75",
    "ExposureTime": "8",
    "XRayTubeCurrent": "100",
    "RadiationSetting": "GR",
    "StudyID": "1",
    "InstanceNumber": "1",
    "PatientOrientation": "",
    "DistanceSourceToDetector": "1100",
    "DistanceSourceToPatient": "750",
    "ImagerPixelSpacing": ["0.4", "0.4"],
    "PositionerMotion": "STATIC",
    "PositionerSecondaryAngle": "0",
    "SamplesPerPixel": 1,
    "PhotometricInterpretation": "MONOCHROME2",
    "PixelIntensityRelationship": "LIN",
    "LossyImageCompression": "00",
    "BitsAllocated": 16,
    "BitsStored": 12,
    "HighBit": 11,
    "PixelRepresentation": 0,
}


def gray_frames(frames: int = 3, rows: int = 24, columns: int = 32, seed: int = 0) -> np.ndarray:
    """Random 12-bit pictures, (frames, rows, columns)."""
    return np.random.default_rng(seed).integers(0, 4096, (frames, rows, columns), dtype=np.uint16)


def plane(letter: str, uids: dict[str, str], frames: int, shape: tuple[int, int]) -> Dataset:
    """One plane without pixels. `uids` holds those of the study, of plane A and of plane B."""
    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset.file_meta.MediaStorageSOPClassUID = dataset.SOPClassUID = XA
    dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID = uids[letter]
    dataset.StudyInstanceUID = uids["study"]
    dataset.SeriesInstanceUID = generate_uid()
    dataset.SeriesNumber = "1" if letter == "A" else "2"
    dataset.ImageType = ["ORIGINAL", "PRIMARY", f"BIPLANE {letter}"]
    for keyword, value in ELEMENTS.items():
        setattr(dataset, keyword, value)
    dataset.PositionerPrimaryAngle = "-30" if letter == "A" else "60"
    dataset.Rows, dataset.Columns = shape
    if frames > 1:
        dataset.NumberOfFrames = frames
        dataset.FrameIncrementPointer = 0x00181063
        dataset.FrameTime = "66.667"
    purpose = Dataset()
    purpose.CodeValue, purpose.CodingSchemeDesignator = "121314", "DCM"
    purpose.CodeMeaning = "Other image of biplane pair"
    other = Dataset()
    other.ReferencedSOPClassUID = XA
    other.ReferencedSOPInstanceUID = uids["B" if letter == "A" else "A"]
    other.PurposeOfReferenceCodeSequence = [purpose]
    dataset.ReferencedImageSequence = [other]
    return dataset


def edit(dataset: Dataset, changes: dict) -> None:
    """Set elements by keyword; None takes one away."""
    for keyword, value in changes.items():
        if value is None:
            if keyword in dataset:
                del dataset[keyword]
        else:
            setattr(dataset, keyword, value)


def write_pair(
    folder: Path,
    *,
    a: dict | None = None,
    b: dict | None = None,
    both: dict | None = None,
    frames_a: np.ndarray | None = None,
    frames_b: np.ndarray | None = None,
    study: str | None = None,
) -> tuple[Path, Path]:
    """Write `plane_a.dcm` and `plane_b.dcm`, uncompressed; the changes go by keyword."""
    folder.mkdir(parents=True, exist_ok=True)
    uids = {"study": study or generate_uid(), "A": generate_uid(), "B": generate_uid()}
    paths = []
    for letter, changes, frames in (("A", a, frames_a), ("B", b, frames_b)):
        if frames is None:
            frames = gray_frames(seed=ord(letter))
        dataset = plane(letter, uids, len(frames), frames.shape[1:])
        dataset.add_new("PixelData", "OW" if frames.itemsize == 2 else "OB", frames.tobytes())
        edit(dataset, {**(both or {}), **(changes or {})})
        paths.append(folder / f"plane_{letter.lower()}.dcm")
        dataset.save_as(paths[-1], enforce_file_format=True)
    return paths[0], paths[1]


def write_series(
    folder: Path, frames: int = 4, *, step: float = 0.1, b_later: float = 0.0, **both
) -> list[Path]:
    """Write both planes as series of single-frame files, their names in no order of time.

    Every picture is of one gray: 100 for the first of plane A, 101 for the next; 200 on for B.
    """
    folder.mkdir(parents=True, exist_ok=True)
    uids = {"study": generate_uid(), "A": generate_uid(), "B": generate_uid()}
    paths = []
    for letter, first, later in (("A", 100, 0.0), ("B", 200, b_later)):
        series = generate_uid()
        for number in range(frames):
            dataset = plane(letter, uids, 1, (24, 32))
            uid = generate_uid() if number else uids[letter]
            dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID = uid
            dataset.SeriesInstanceUID = series
            dataset.InstanceNumber = str(number + 1)
            dataset.AcquisitionTime = f"1015{number * step + later:09.6f}"
            picture = np.full((24, 32), first + number, dtype=np.uint16)
            dataset.add_new("PixelData", "OW", picture.tobytes())
            edit(dataset, both)
            paths.append(folder / f"{letter}{(number * 7) % 10}_{number}.dcm")
            dataset.save_as(paths[-1], enforce_file_format=True)
    return paths


def write_both(path: Path, frames_a: np.ndarray, frames_b: np.ndarray, *, turns: bool) -> Path:
    """Write one file with the frames of both planes: in turns, or one plane after the other.

    Plane A stands at RAO 30, plane B at LAO 60: the angle increments say which frame is whose.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    uids = {"study": generate_uid(), "A": generate_uid(), "B": generate_uid()}
    count = len(frames_a) + len(frames_b)
    dataset = plane("A", uids, count, frames_a.shape[1:])
    in_b = np.arange(count) % 2 == 1 if turns else np.arange(count) >= len(frames_a)
    pictures = np.empty((count, *frames_a.shape[1:]), frames_a.dtype)
    pictures[~in_b], pictures[in_b] = frames_a, frames_b
    dataset.ImageType = ["ORIGINAL", "PRIMARY", "SINGLE PLANE"]
    del dataset.ReferencedImageSequence
    dataset.PositionerMotion = "DYNAMIC"
    dataset.PositionerPrimaryAngleIncrement = [str(90 * int(b)) for b in in_b]
    dataset.PositionerSecondaryAngleIncrement = ["0"] * count
    dataset.add_new("PixelData", "OW", pictures.tobytes())
    dataset.save_as(path, enforce_file_format=True)
    return path


def rewrite(path: Path, **changes) -> None:
    """Change elements of a file; None takes one away."""
    dataset = pydicom.dcmread(path)
    edit(dataset, changes)
    dataset.save_as(path, enforce_file_format=True)


def compress(
    path: Path, syntax: str, fragments: list[bytes], table: bool = True, **changes
) -> None:
    """Replace a file's pixels by compressed ones, one fragment a frame."""
    dataset = pydicom.dcmread(path)
    edit(dataset, changes)
    dataset.file_meta.TransferSyntaxUID = syntax
    dataset.PixelData = encapsulate(fragments, has_bot=table)
    dataset["PixelData"].VR = "OB"
    dataset["PixelData"].is_undefined_length = True
    dataset.save_as(path, enforce_file_format=True)


def write_sparse(path: Path, frames: int, rows: int, columns: int, **changes) -> None:
    """Make a file hold many black 16-bit frames that take no room on the disk."""
    dataset = pydicom.dcmread(path, stop_before_pixels=True)
    edit(dataset, {"NumberOfFrames": frames, "Rows": rows, "Columns": columns, **changes})
    dataset.save_as(path, enforce_file_format=True)
    size = frames * rows * columns * 2
    with path.open("ab") as file:
        file.write(b"\xe0\x7f\x10\x00OW\0\0" + size.to_bytes(4, "little"))
        file.truncate(file.tell() + size)
