"""What a DICOM file says about itself, read without its pixels and without trusting it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

from stereosom_plugin.errors import InputError, require

pydicom = require("pydicom", "fluoroscopy")

DEFLATED = "1.2.840.10008.1.2.1.99"

# No real header comes near it: ten thousand frames with a kilobyte of geometry each.
MOST_HEADER_BYTES = 16 << 20
# Every item of a sequence costs microseconds and a kilobyte once it is parsed.
MOST_ITEMS, MOST_READS = 100_000, 500_000
ITEM_MARK = b"\xfe\xff\x00\xe0"

# Only these are read; whatever else a file holds is stepped over, however large it is.
KEYWORDS = (
    # what it is, and whose partner
    *("SOPClassUID", "SOPInstanceUID", "StudyInstanceUID", "SeriesInstanceUID", "ImageType"),
    *("InstanceNumber", "ReferencedImageSequence", "ReferencedOtherPlaneSequence"),
    *("PlaneIdentification", "SharedFunctionalGroupsSequence", "PerFrameFunctionalGroupsSequence"),
    # times
    *("AcquisitionDateTime", "AcquisitionDate", "AcquisitionTime", "ContentDate", "ContentTime"),
    *("FrameTime", "FrameTimeVector", "FrameIncrementPointer", "CineRate"),
    *("RecommendedDisplayFrameRate",),
    # geometry
    *("PositionerPrimaryAngle", "PositionerSecondaryAngle", "PositionerMotion"),
    *("PositionerPrimaryAngleIncrement", "PositionerSecondaryAngleIncrement"),
    *("DetectorPrimaryAngle", "DetectorSecondaryAngle"),
    *("DistanceSourceToDetector", "DistanceSourceToPatient", "DistanceSourceToIsocenter"),
    *("EstimatedRadiographicMagnificationFactor", "ImagerPixelSpacing", "IntensifierSize"),
    *("FieldOfViewShape", "FieldOfViewDimensions", "FieldOfViewOrigin", "FieldOfViewRotation"),
    *("FieldOfViewHorizontalFlip", "DetectorElementSpacing", "PositionOfIsocenterProjection"),
    *("PatientPosition", "PatientOrientation", "PatientOrientationCodeSequence"),
    *("PatientGantryRelationshipCodeSequence", "TableMotion", "TableAngle"),
    # shutters and collimators
    *(
        keyword.format(kind)
        for kind in ("Shutter", "Collimator")
        for keyword in (
            *("{}Shape", "{}LeftVerticalEdge", "{}RightVerticalEdge", "{}UpperHorizontalEdge"),
            *("{}LowerHorizontalEdge", "CenterOfCircular{}", "RadiusOfCircular{}"),
            "VerticesOfThePolygonal{}",
        )
    ),
    # pixels
    *("Rows", "Columns", "NumberOfFrames", "SamplesPerPixel", "PhotometricInterpretation"),
    *("BitsAllocated", "BitsStored", "HighBit", "PixelRepresentation", "RescaleSlope"),
    *("RescaleIntercept", "ModalityLUTSequence", "PixelIntensityRelationship"),
    *("PixelIntensityRelationshipSign", "WindowCenter", "WindowWidth"),
    *("MaskSubtractionSequence", "PlanarConfiguration", "StereoPairsPresent"),
)


# The functional groups that are asked. What an unknown sequence holds may be about anything.
GROUPS = (
    *("FrameContentSequence", "XAXRFFrameCharacteristicsSequence", "PositionerPositionSequence"),
    *("TablePositionSequence", "XRayGeometrySequence", "FieldOfViewSequence"),
    *("FramePixelDataPropertiesSequence", "PixelValueTransformationSequence"),
    *("PatientOrientationInFrameSequence", "FrameDisplayShutterSequence"),
    *("CollimatorShapeSequence", "FrameVOILUTSequence"),
)


@dataclass(frozen=True, eq=False)
class Header:
    """The wanted elements of one DICOM file, as they hold for all of it or for one frame.

    Parameters
    ----------
    path : Path
    places : dict of int to pydicom.Dataset
        In which dataset the element of each tag lies: in everything before the pixels that
        `KEYWORDS` lists, or in the functional groups of a frame.
    transfer_syntax : str
        Its UID.
    pixel_position : int
        Byte at which the element after the header, Pixel Data, begins.
    """

    path: Path
    places: Mapping[int, Any]
    transfer_syntax: str
    pixel_position: int

    def refuse(self, why: str, mend: str) -> InputError:
        """The error to raise about this file."""
        return InputError(self.path, why, mend)

    def value(self, keyword: str) -> Any:
        """An element's value as pydicom gives it, None where it is absent or empty."""
        tag = _tag(keyword)
        if (place := self.places.get(tag)) is None:
            return None
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # odd values are judged here, not by pydicom
                self._check_items(place, keyword)
                value = place[tag].value
        except InputError:
            raise
        except Exception:  # pydicom raises many kinds on malformed values
            raise self._malformed(keyword) from None
        return None if value is None or value == "" or value == [] else value

    def text(self, keyword: str) -> str:
        """An element as text, empty where it is absent; values are joined by a backslash."""
        return "\\".join(str(part).strip() for part in self._parts(keyword))

    def numbers(self, keyword: str) -> tuple[float, ...]:
        """An element's finite numbers, none where it is absent."""
        try:
            numbers = tuple(float(part) for part in self._parts(keyword))
        except (TypeError, ValueError):
            raise self._malformed(keyword) from None
        if not all(map(math.isfinite, numbers)):
            raise self._malformed(keyword)
        return numbers

    def number(self, keyword: str) -> float | None:
        """An element's one finite number, None where it is absent."""
        numbers = self.numbers(keyword)
        if len(numbers) > 1:
            raise self._malformed(keyword)
        return numbers[0] if numbers else None

    def whole(self, keyword: str, default: int | None = None) -> int:
        """An element's one whole number; where it is absent, the default, else an error."""
        number = self.number(keyword)
        if number is None:
            if default is None:
                raise self.missing(keyword)
            return default
        if number != int(number):
            raise self._malformed(keyword)
        return int(number)

    def items(self, keyword: str) -> tuple[Header, ...]:
        """A sequence's items, to be asked like the header itself; none where it is absent."""
        value = self.value(keyword)
        if value is None:
            return ()
        if not isinstance(value, pydicom.Sequence):
            raise self._malformed(keyword)
        return tuple(replace(self, places=_places(item)) for item in value)

    def frames(self, count: int) -> tuple[Header, ...]:
        """The header as it holds for each frame: its functional groups, the shared ones, the rest.

        Groups lie one deep: each is a sequence of one item. An element stands in one place only
        (PS3.3 C.7.6.16), so that the order matters to broken files alone. Without functional
        groups, all frames have the header itself.
        """
        per_frame = self.items("PerFrameFunctionalGroupsSequence")
        shared = self.items("SharedFunctionalGroupsSequence")
        if not per_frame and not shared:
            return (self,) * count
        if len(per_frame) not in (0, count):
            raise self.refuse(
                f"{label('PerFrameFunctionalGroupsSequence')} holds {len(per_frame)} items "
                f"for {count} frames",
                "export the object again",
            )
        common = {**self.places, **(shared[0]._group_places() if shared else {})}
        if not per_frame:
            return (replace(self, places=common),) * count
        return tuple(
            replace(self, places={**common, **group._group_places()}) for group in per_frame
        )

    def _group_places(self) -> dict[int, Any]:
        """Elements of a functional groups item: of the first items of its groups, and these."""
        places = dict(self.places)
        for keyword in GROUPS:
            for item in self.items(keyword)[:1]:
                places |= item.places
        return places

    def _check_items(self, place: Any, keyword: str) -> None:
        """Refuse a sequence of too many items before it is parsed."""
        raw = getattr(place.get_item(_tag(keyword)), "value", None)
        if isinstance(raw, bytes) and raw.count(ITEM_MARK) > MOST_ITEMS:
            raise self.refuse(
                f"{label(keyword)} holds more than {MOST_ITEMS} items", "export a shorter run"
            )

    def missing(self, *keywords: str) -> InputError:
        """The error to raise where elements that nothing can stand in for are absent."""
        names = " or ".join(map(label, keywords))
        return self.refuse(f"has no {names}", "export the original objects, with their geometry")

    def _parts(self, keyword: str) -> list[Any]:
        value = self.value(keyword)
        if value is None:
            return []
        return [value] if isinstance(value, (str, bytes)) or not _listed(value) else list(value)

    def _malformed(self, keyword: str) -> InputError:
        return self.refuse(f"{label(keyword)} holds no usable value", "export the objects again")


def label(keyword: str) -> str:
    """Name an element as people look it up.

    Examples
    --------
    >>> label("ImagerPixelSpacing")
    'ImagerPixelSpacing (0018,1164)'
    """
    tag = pydicom.datadict.tag_for_keyword(keyword)
    return f"{keyword} ({tag >> 16:04X},{tag & 0xFFFF:04X})"


def uid_name(uid: str) -> str:
    """What a UID stands for, short; the UID itself where that is not known.

    Examples
    --------
    >>> uid_name("1.2.840.10008.1.2.5")
    'RLE Lossless'
    """
    return str(pydicom.uid.UID(uid, pydicom.config.IGNORE).name)[:80]


def read_header(path: Path) -> Header:
    """Read the header of one DICOM file; its pixels stay on the disk.

    Raises
    ------
    InputError
        Where the file is absent, is not DICOM, or is packed as a whole.
    """
    if not path.exists():
        raise InputError(path, "no such file", "check the path")
    try:
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            meta = pydicom.filereader.read_file_meta_info(path)
            syntax = str(meta.get("TransferSyntaxUID", ""))
            if syntax == DEFLATED:  # a small file of this kind may unpack to gigabytes
                raise InputError(path, "is a deflated DICOM file", "store it uncompressed")
            tags = [pydicom.datadict.tag_for_keyword(keyword) for keyword in KEYWORDS]
            dataset = pydicom.dcmread(_Bounded(file), stop_before_pixels=True, specific_tags=tags)
            position = file.tell()
    except InputError:
        raise
    except _TooLarge:
        raise InputError(
            path,
            "has a header of more than 16 MiB or of too many items, or a torn one",
            "export the object again",
        ) from None
    except OSError as error:
        raise InputError(path, error.strerror or "cannot be read", "check the file") from None
    except Exception:  # pydicom raises many kinds, RecursionError among them
        raise InputError(path, "is not a readable DICOM file", "give two XA objects") from None
    if not syntax:
        raise InputError(path, "is not a readable DICOM file", "give two XA objects")
    return Header(path, _places(dataset), syntax, position)


class _TooLarge(Exception):
    """A header wants more memory than a header may take."""


class _Bounded:
    """A file of which no more is read than a header may hold; what is stepped over is free."""

    def __init__(self, file: BinaryIO) -> None:
        self.file, self.left, self.reads = file, MOST_HEADER_BYTES, 0
        self.seek, self.tell, self.name = file.seek, file.tell, file.name

    def read(self, size: int = -1) -> bytes:
        self.reads += 1
        if not 0 <= size <= self.left or self.reads > MOST_READS:
            raise _TooLarge
        self.left -= size
        return self.file.read(size)


@cache
def _tag(keyword: str) -> Any:
    return pydicom.tag.Tag(pydicom.datadict.tag_for_keyword(keyword))


def _places(dataset: Any) -> dict[int, Any]:
    return dict.fromkeys(dataset.keys(), dataset)


def _listed(value: Any) -> bool:
    return hasattr(value, "__iter__")
