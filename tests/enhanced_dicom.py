"""Write Enhanced X-ray angiography as a standard-abiding device would (PS3.3 A.47)."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, generate_uid

ENHANCED_XA = "1.2.840.10008.5.1.4.1.1.12.1.1"
EVENT = generate_uid()
START = datetime(2026, 1, 5, 10, 15, 0, 250_000)

ELEMENTS = {
    "StudyDate": "20260105",
    "StudyTime": "101500",
    "ContentDate": "20260105",
    "ContentTime": "101500.250000",
    "AccessionNumber": "",
    "Modality": "XA",
    "Manufacturer": "Phantom",
    "ManufacturerModelName": "Tube",
    "DeviceSerialNumber": "1",
    "SoftwareVersions": "1",
    "ReferringPhysicianName": "",
    "PatientName": "Phantom^Tube",
    "PatientID": "TUBE1",
    "PatientBirthDate": "",
    "PatientSex": "O",
    "StudyID": "1",
    "InstanceNumber": "1",
    "AcquisitionNumber": 1,
    "AcquisitionProtocolName": "Cine",
    "ContentQualification": "RESEARCH",
    "SamplesPerPixel": 1,
    "PhotometricInterpretation": "MONOCHROME2",
    "PresentationLUTShape": "IDENTITY",
    "BitsAllocated": 16,
    "BitsStored": 12,
    "HighBit": 11,
    "PixelRepresentation": 0,
    "BurnedInAnnotation": "NO",
    "LossyImageCompression": "00",
    # acquisition
    "KVP": "75",
    "RadiationSetting": "GR",
    "XRayTubeCurrentInmA": 100.0,
    "ExposureTimeInms": 8.0,
    "AveragePulseWidth": 8.0,
    "AcquisitionDuration": 200.0,
    "RadiationMode": "PULSED",
    "FocalSpots": "0.6",
    "XRayReceptorType": "DIGITAL_DETECTOR",
    "DistanceReceptorPlaneToDetectorHousing": 10.0,
    "PositionerType": "CARM",
    "CArmPositionerTabletopRelationship": "YES",
    "AcquiredImageAreaDoseProduct": 1.0,
    # detector
    "DetectorType": "SCINTILLATOR",
    "DetectorConfiguration": "AREA",
    "DetectorConditionsNominalFlag": "YES",
    "DetectorElementSpacing": ["0.2", "0.2"],
    "AcquisitionContextSequence": [],
    "AcquisitionTimeSynchronized": "Y",
    "SynchronizationTrigger": "NO TRIGGER",
}


def code(value: str, scheme: str, meaning: str) -> Dataset:
    item = Dataset()
    item.CodeValue, item.CodingSchemeDesignator, item.CodeMeaning = value, scheme, meaning
    return item


def of(**elements) -> Dataset:
    """A dataset of elements by keyword."""
    item = Dataset()
    for keyword, value in elements.items():
        setattr(item, keyword, value)
    return item


def groups(letter: str, angles: tuple[float, float], **changes) -> dict[str, dict]:
    """Functional groups of a frame, by sequence; `changes` go into whichever has the keyword."""
    described = {
        "PositionerPositionSequence": {
            "PositionerPrimaryAngle": angles[0],
            "PositionerSecondaryAngle": angles[1],
        },
        "IsocenterReferenceSystemSequence": {
            "PositionerIsocenterPrimaryAngle": angles[0],
            "PositionerIsocenterSecondaryAngle": angles[1],
            "PositionerIsocenterDetectorRotationAngle": 0.0,
            "TableXPositionToIsocenter": 0.0,
            "TableYPositionToIsocenter": 100.0,
            "TableZPositionToIsocenter": -200.0,
            "TableHorizontalRotationAngle": 0.0,
            "TableHeadTiltAngle": 0.0,
            "TableCradleTiltAngle": 0.0,
        },
        "XRayGeometrySequence": {
            "DistanceSourceToIsocenter": 750.0,
            "DistanceSourceToDetector": 1100.0,
        },
        "FieldOfViewSequence": {
            "FieldOfViewShape": "RECTANGLE",
            "FieldOfViewOrigin": [0.0, 0.0],
            "FieldOfViewRotation": "0",
            "FieldOfViewHorizontalFlip": "NO",
        },
        "FramePixelDataPropertiesSequence": {
            "FrameType": ["ORIGINAL", "PRIMARY", f"BIPLANE {letter}", "NONE"],
            "PixelIntensityRelationship": "LIN",
            "PixelIntensityRelationshipSign": 1,
            "ImagerPixelSpacing": [0.4, 0.4],
            "GeometricalProperties": "UNIFORM",
            "ImageProcessingApplied": "NONE",
        },
        "FrameVOILUTSequence": {"WindowCenter": 2048.0, "WindowWidth": 4096.0},
        "PatientOrientationInFrameSequence": {"PatientOrientation": ["L", "F"]},
        "IrradiationEventIdentificationSequence": {"IrradiationEventUID": EVENT},
        "FrameDetectorParametersSequence": {"DetectorActiveTime": 8.0},
        "ProjectionPixelCalibrationSequence": {
            "DistanceObjectToTableTop": 100.0,
            "ObjectPixelSpacingInCenterOfBeam": [0.273, 0.273],
            "TableHeight": 800.0,
            "BeamAngle": 0.0,
        },
        "TablePositionSequence": {
            "TableTopVerticalPosition": 0.0,
            "TableTopLongitudinalPosition": 0.0,
            "TableTopLateralPosition": 0.0,
            "TableHorizontalRotationAngle": 0.0,
            "TableHeadTiltAngle": 0.0,
            "TableCradleTiltAngle": 0.0,
        },
        "CollimatorShapeSequence": {
            "CollimatorShape": "RECTANGULAR",
            "CollimatorLeftVerticalEdge": "-100",
            "CollimatorRightVerticalEdge": "5000",
            "CollimatorUpperHorizontalEdge": "-100",
            "CollimatorLowerHorizontalEdge": "5000",
        },
    }
    for keyword, value in changes.items():
        for group in described.values():
            if keyword in group:
                group[keyword] = value
    return described


def enhanced(
    letter: str,
    uids: dict[str, str],
    pictures: np.ndarray,
    *,
    frames: list[dict[str, dict]],
    starts_ms: float = 0.0,
    step_ms: float = 66.667,
    codes: bool = True,
) -> Dataset:
    """One plane. `frames` holds each frame's functional groups; those alike are shared."""
    count, rows, columns = pictures.shape
    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    dataset.file_meta.MediaStorageSOPClassUID = dataset.SOPClassUID = ENHANCED_XA
    dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID = uids[letter]
    dataset.StudyInstanceUID = uids["study"]
    dataset.SeriesInstanceUID = generate_uid()
    dataset.FrameOfReferenceUID = uids.setdefault("space", generate_uid())
    dataset.SynchronizationFrameOfReferenceUID = uids.setdefault("clock", generate_uid())
    dataset.PositionReferenceIndicator = ""
    dataset.SeriesNumber = "1" if letter == "A" else "2"
    dataset.ImageType = ["ORIGINAL", "PRIMARY", f"BIPLANE {letter}", "NONE"]
    for keyword, value in ELEMENTS.items():
        setattr(dataset, keyword, value)
    dataset.PlaneIdentification = f"PLANE {letter}"
    dataset.PlanesInAcquisition = "BIPLANE"
    dataset.Rows, dataset.Columns, dataset.NumberOfFrames = rows, columns, count
    start = START + timedelta(milliseconds=starts_ms)
    dataset.AcquisitionDateTime = stamp(start)
    dataset.PhysicalDetectorSize = [rows * 0.4, columns * 0.4]
    dataset.DetectorActiveDimensions = [f"{rows * 0.4:.2f}", f"{columns * 0.4:.2f}"]
    dataset.DetectorBinning = ["2", "2"]
    if codes:
        supine = code("102538003", "SCT", "recumbent")
        supine.PatientOrientationModifierCodeSequence = [code("40199007", "SCT", "supine")]
        dataset.PatientOrientationCodeSequence = [supine]
        dataset.PatientGantryRelationshipCodeSequence = [code("102540001", "SCT", "headfirst")]
    other = of(
        ReferencedSOPClassUID=ENHANCED_XA,
        ReferencedSOPInstanceUID=uids["B" if letter == "A" else "A"],
    )
    dataset.ReferencedOtherPlaneSequence = [other]
    organization = generate_uid()
    dataset.DimensionOrganizationSequence = [of(DimensionOrganizationUID=organization)]
    dataset.DimensionIndexSequence = [
        of(
            DimensionOrganizationUID=organization,
            DimensionIndexPointer=0x00209057,  # In-Stack Position Number
            FunctionalGroupPointer=0x00209111,
        )
    ]
    shared = {
        name: group
        for name, group in frames[0].items()
        if all(frame.get(name) == group for frame in frames)
    }
    anatomy = of(
        FrameLaterality="U",
        AnatomicRegionSequence=[code("51185008", "SCT", "Chest")],
    )
    dataset.SharedFunctionalGroupsSequence = [
        of(
            FrameAnatomySequence=[anatomy],
            **{name: [of(**group)] for name, group in shared.items()},
        )
    ]
    per_frame = []
    for index, frame in enumerate(frames):
        taken = stamp(start + timedelta(milliseconds=index * step_ms))
        content = of(
            FrameReferenceDateTime=taken,
            FrameAcquisitionDateTime=taken,
            FrameAcquisitionDuration=8.0,
            StackID="1",
            InStackPositionNumber=index + 1,
            DimensionIndexValues=[index + 1],
        )
        own = {name: [of(**group)] for name, group in frame.items() if name not in shared}
        per_frame.append(of(FrameContentSequence=[content], **own))
    dataset.PerFrameFunctionalGroupsSequence = per_frame
    dataset.add_new("PixelData", "OW", pictures.astype("<u2").tobytes())
    return dataset


def stamp(moment: datetime) -> str:
    """A date and time as DICOM writes it."""
    return moment.strftime("%Y%m%d%H%M%S.%f")


def write_enhanced_pair(
    folder: Path,
    pictures_a: np.ndarray,
    pictures_b: np.ndarray,
    *,
    a: list[dict] | None = None,
    b: list[dict] | None = None,
    b_starts_ms: float = 0.0,
    steps_ms: tuple[float, float] = (66.667, 66.667),
    **elements,
) -> tuple[Path, Path]:
    """Write two planes, RAO 30 and LAO 60 unless their groups are given; elements by keyword."""
    folder.mkdir(parents=True, exist_ok=True)
    uids = {"study": generate_uid(), "A": generate_uid(), "B": generate_uid()}
    paths = []
    for letter, pictures, frames, angles, begins, step in (
        ("A", pictures_a, a, (-30.0, 0.0), 0.0, steps_ms[0]),
        ("B", pictures_b, b, (60.0, 0.0), b_starts_ms, steps_ms[1]),
    ):
        frames = frames or [groups(letter, angles)] * len(pictures)
        dataset = enhanced(letter, uids, pictures, frames=frames, starts_ms=begins, step_ms=step)
        for keyword, value in elements.items():
            if value is None:
                del dataset[keyword]
            else:
                setattr(dataset, keyword, value)
        paths.append(folder / f"enhanced_{letter.lower()}.dcm")
        dataset.save_as(paths[-1], enforce_file_format=True)
    return paths[0], paths[1]
