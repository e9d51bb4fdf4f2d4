"""What a result takes over from the run it was made of: the patient, the study, references."""

from __future__ import annotations

import io
import uuid
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from stereosom_plugin.acquisition import Acquisition, SourceFrame
from stereosom_plugin.errors import InputError, require
from stereosom_plugin.polydata import generator

pydicom = require("pydicom", "fluoroscopy")
highdicom = require("highdicom", "fluoroscopy")

# Patient, General Study and Patient Study modules (PS3.3 C.7.1.1, C.7.2.1, C.7.2.2): whatever of
# them a source has is taken over as it stands. Those of the first two lines may be empty, but
# must be there.
DEMANDED = (
    *("PatientName", "PatientID", "PatientBirthDate", "PatientSex"),
    *("StudyDate", "StudyTime", "ReferringPhysicianName", "StudyID", "AccessionNumber"),
)
TAKEN_OVER = (
    *DEMANDED,
    *("SpecificCharacterSet", "StudyInstanceUID", "StudyDescription"),
    *("IssuerOfPatientID", "OtherPatientIDs", "PatientBirthTime", "EthnicGroup"),
    *("PatientComments", "PatientIdentityRemoved", "DeidentificationMethod"),
    *("PatientAge", "PatientSize", "PatientWeight", "TimezoneOffsetFromUTC"),
)
IDENTITY = (
    *("SOPClassUID", "SOPInstanceUID", "SeriesInstanceUID"),
    *("NumberOfFrames", "Modality", "PatientOrientation"),
)


@dataclass(frozen=True, eq=False)
class Origin:
    """Where the frames of a run come from, as DICOM objects.

    Parameters
    ----------
    datasets : dict of Path to pydicom.Dataset
        Patient, study and identity of each file; no pixels.
    frames_a, frames_b : sequence of SourceFrame
        Of each frame of the run.
    """

    datasets: dict[Path, Any]
    frames_a: tuple[SourceFrame, ...]
    frames_b: tuple[SourceFrame, ...]

    @property
    def first(self) -> Any:
        """The dataset that patient and study are taken over from."""
        return self.datasets[self.frames_a[0].path]

    @property
    def uids(self) -> tuple[str, ...]:
        """SOP Instance UIDs of all files."""
        return tuple(str(dataset.SOPInstanceUID) for dataset in self.datasets.values())


def read_origin(acquisition: Acquisition) -> Origin:
    """Read who and what a run shows from its files.

    Parameters
    ----------
    acquisition : Acquisition
        Of DICOM objects.

    Raises
    ------
    InputError
        Where it was not read from DICOM, or a file's own words cannot be taken over.
    """
    if acquisition.source_frames is None:
        raise InputError("DICOM output", "the frames were not read from DICOM", "leave it out")
    frames_a, frames_b = (tuple(frames) for frames in acquisition.source_frames)
    paths = dict.fromkeys(frame.path for frame in (*frames_a, *frames_b))
    return Origin({path: _read(path) for path in paths}, frames_a, frames_b)


def new_uid(*parts: Any) -> Any:
    """Make a UID that is the same for the same parts, and for no others.

    UIDs from name-based UUIDs: ITU-T X.667, PS3.5 B.2.

    Examples
    --------
    >>> new_uid("series", "1.2.3") == new_uid("series", "1.2.3") != new_uid("series", "1.2.4")
    True
    """
    name = "\0".join(map(str, parts))
    return highdicom.UID(f"2.25.{uuid.uuid5(uuid.NAMESPACE_OID, name).int}")


def reference(dataset: Any, frames: Sequence[int]) -> dict[str, Any]:
    """Arguments of highdicom's references to frames, numbered from zero, of a source."""
    many = int(dataset.get("NumberOfFrames") or 1) > 1
    return {
        "referenced_sop_class_uid": str(dataset.SOPClassUID),
        "referenced_sop_instance_uid": str(dataset.SOPInstanceUID),
        "referenced_frame_numbers": [frame + 1 for frame in frames] if many else None,
    }


def stub(dataset: Any) -> Any:
    """Copy the identity of a source only, with nothing that highdicom could stumble over."""
    copy = pydicom.Dataset()
    for keyword in DEMANDED:
        setattr(copy, keyword, "")
    for keyword in ("StudyInstanceUID", *IDENTITY):
        if keyword in dataset:
            setattr(copy, keyword, dataset[keyword].value)
    return copy


def finish(document: Any, source: Any, created: datetime) -> None:
    """Give a new object the patient and study of its source, word for word, and its own date."""
    for keyword in TAKEN_OVER:
        if keyword in source:
            document[keyword] = source[keyword]
        elif keyword in DEMANDED:
            setattr(document, keyword, "")
    date, time = created.strftime("%Y%m%d"), created.strftime("%H%M%S")
    for name in ("InstanceCreation", "Content", "Series"):
        setattr(document, f"{name}Date", date)
        setattr(document, f"{name}Time", time)
    for library in document.get("ContributingEquipmentSequence", []):
        library.ContributionDateTime = date + time


def described() -> dict[str, str]:
    """Equipment module: what made the object."""
    name, _, version = generator().partition(" ")
    return {
        "manufacturer": "stereosom",
        "manufacturer_model_name": name,
        "software_versions": version or "unknown",
        "device_serial_number": "none",
    }


def save(document: Any, path: Path, source: Path) -> None:
    """Write an object to an open, empty file.

    Raises
    ------
    InputError
        Where what was taken over from the source cannot be written.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # odd values stay as the source has them
            document.save_as(path)
    except OSError:
        raise
    except Exception as error:  # pydicom raises many kinds on malformed values
        raise _unusable(source, error) from None


def _read(path: Path) -> Any:
    tags = [pydicom.datadict.tag_for_keyword(keyword) for keyword in (*TAKEN_OVER, *IDENTITY)]
    kept = pydicom.Dataset()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=tags)
            read.decode()
            for keyword in (*TAKEN_OVER, *IDENTITY):
                if keyword in read:
                    kept[keyword] = read[keyword]  # makes a value of the bytes, or raises
            pydicom.dcmwrite(io.BytesIO(), kept, implicit_vr=False, little_endian=True)
    except OSError as error:
        raise InputError(path, error.strerror or "cannot be read", "check the file") from None
    except Exception as error:
        raise _unusable(path, error) from None
    for keyword in ("SOPClassUID", "SOPInstanceUID", "StudyInstanceUID", "SeriesInstanceUID"):
        uid = str(kept.get(keyword, ""))
        if not pydicom.uid.UID(uid, pydicom.config.IGNORE).is_valid:
            raise InputError(
                path, f"its {keyword} is no UID, so nothing can refer to it", "export it again"
            )
    return kept


def _unusable(path: Path, error: Exception) -> InputError:
    why = " ".join(str(error).split())[:120]
    return InputError(
        path, f"its patient and study cannot be taken over ({why})", "export the objects again"
    )
