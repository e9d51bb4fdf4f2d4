"""What was taken for the device in one plane as one DICOM Segmentation, a frame per picture."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydicom.sr.codedict import codes

from stereosom_plugin.acquisition import SourceFrame
from stereosom_plugin.errors import InputError
from stereosom_plugin.files import write_whole
from stereosom_plugin.polydata import generator

from .source import Origin, described, finish, highdicom, new_uid, pydicom, reference, save, stub

SERIES_NUMBER = 9002
ALGORITHM = "xray"
SINGLE_PICTURE = "1.2.840.10008.5.1.4.1.1.1"  # Computed Radiography Image Storage


def write_masks(
    masks: Iterable[npt.NDArray[np.bool_]],
    frames: Iterable[SourceFrame],
    origin: Origin,
    path: str | Path,
    *,
    algorithm: str = ALGORITHM,
    created: datetime | None = None,
) -> None:
    """Write masks of one plane as a binary DICOM Segmentation, for the pictures as stored.

    A projection has no place in space, so there is no frame of reference; each frame refers to
    the picture that it was made of.

    Parameters
    ----------
    masks : iterable of (rows, columns) arrays of bool
    frames : iterable of SourceFrame
        Of each mask.
    origin : Origin
    path : path
    algorithm : str
        Name of what segmented, as `--segmenter` takes it; at most 64 characters are kept.
    created : datetime, optional
        Default: now. The same content at the same time gives the same bytes.

    Raises
    ------
    InputError
        Where there is no mask, or what is taken over from the source cannot be written.
    """
    path, frames = Path(path), list(frames)
    created = created or datetime.now()
    bits, shape = [], (0, 0)
    for mask in masks:
        bits.append(np.packbits(mask, axis=None, bitorder="little"))
        shape = mask.shape
    if not frames or len(bits) != len(frames):
        raise InputError(path, f"{len(bits)} masks for {len(frames)} frames", "give one each")
    source = origin.datasets[frames[0].path]
    pictures = (f"{frame.path.name} {frame.number}" for frame in frames)
    uids = (str(source.SOPInstanceUID), algorithm, *pictures)
    image = _first_frame(
        source,
        shape,
        new_uid("masks", *uids),
        new_uid("masks", *uids, created.isoformat(), *(part.tobytes().hex() for part in bits)),
        algorithm,
    )
    image.PatientOrientation = source.get("PatientOrientation") or ""
    _add_frames(image, [(origin.datasets[frame.path], frame.number) for frame in frames])
    if shape[0] * shape[1] % 8 == 0:
        pixels = np.concatenate(bits)
    else:  # frames follow each other without padding, PS3.5 8.1.1
        count = shape[0] * shape[1]
        pixels = np.packbits(
            np.concatenate([np.unpackbits(part, count=count, bitorder="little") for part in bits]),
            bitorder="little",
        )
    image.PixelData = pixels.tobytes() + bytes(len(pixels) % 2)
    finish(image, source, created)
    with write_whole(path) as part:
        save(image, part, frames[0].path)


def _first_frame(source: Any, shape: tuple[int, ...], series: Any, uid: Any, algorithm: str) -> Any:
    """Make the object for a single picture: more are beyond highdicom without coordinates."""
    picture = stub(source)
    if "NumberOfFrames" in picture:
        del picture.NumberOfFrames
    picture.SOPClassUID = SINGLE_PICTURE  # all references are made anew for the frames
    picture.Rows, picture.Columns = shape
    algorithm = algorithm.encode("ascii", "replace").decode().replace("\\", "/")[-64:]
    learned = algorithm.lower().endswith(".onnx")
    family = codes.cid7162.ArtificialIntelligence if learned else codes.DCM.ImageProcessing
    name = highdicom.AlgorithmIdentificationSequence(algorithm, family, generator())
    kind = highdicom.seg.SegmentDescription(
        1, "device", codes.SCT.PhysicalObject, codes.SCT.InstrumentDevice, "AUTOMATIC", name
    )
    return highdicom.seg.Segmentation(
        [picture],
        np.ones(shape, dtype=np.uint8),
        "BINARY",
        [kind],
        series,
        SERIES_NUMBER,
        uid,
        1,
        content_label="DEVICE",
        content_description="Pixels that show the device",
        series_description="Device masks",
        **described(),
    )


def _add_frames(image: Any, sources: list[tuple[Any, int]]) -> None:
    """Extend the object over time: one frame per source picture, in order."""
    template = image.PerFrameFunctionalGroupsSequence[0]
    organization = new_uid("dimensions", image.SOPInstanceUID)
    image.DimensionOrganizationSequence[0].DimensionOrganizationUID = organization
    image.DimensionIndexSequence[0].DimensionOrganizationUID = organization
    when = pydicom.Dataset()
    when.DimensionOrganizationUID = organization
    when.DimensionIndexPointer = pydicom.datadict.tag_for_keyword("TemporalPositionIndex")
    when.FunctionalGroupPointer = pydicom.datadict.tag_for_keyword("FrameContentSequence")
    when.DimensionDescriptionLabel = "Frame of the run"
    image.DimensionIndexSequence.append(when)
    groups = []
    for position, (dataset, number) in enumerate(sources, start=1):
        group = pydicom.Dataset()
        content = pydicom.Dataset()
        content.DimensionIndexValues = [1, position]
        content.TemporalPositionIndex = position
        group.FrameContentSequence = [content]
        group.DerivationImageSequence = [_derived(template, dataset, number)]
        groups.append(group)
    image.PerFrameFunctionalGroupsSequence = groups
    image.NumberOfFrames = len(groups)
    del image.SourceImageSequence  # each frame has its own
    by_series: dict[str, dict[str, Any]] = {}
    for dataset, _ in sources:
        instance = pydicom.Dataset()
        instance.ReferencedSOPClassUID = dataset.SOPClassUID
        instance.ReferencedSOPInstanceUID = dataset.SOPInstanceUID
        of_series = by_series.setdefault(str(dataset.SeriesInstanceUID), {})
        of_series[str(dataset.SOPInstanceUID)] = instance
    image.ReferencedSeriesSequence = [
        _series(uid, list(instances.values())) for uid, instances in by_series.items()
    ]


def _derived(template: Any, dataset: Any, number: int) -> Any:
    like = template.DerivationImageSequence[0]
    derived, picture = pydicom.Dataset(), pydicom.Dataset()
    derived.DerivationCodeSequence = like.DerivationCodeSequence
    named = reference(dataset, [number])
    picture.ReferencedSOPClassUID = named["referenced_sop_class_uid"]
    picture.ReferencedSOPInstanceUID = named["referenced_sop_instance_uid"]
    if named["referenced_frame_numbers"]:
        picture.ReferencedFrameNumber = named["referenced_frame_numbers"]
    picture.PurposeOfReferenceCodeSequence = like.SourceImageSequence[
        0
    ].PurposeOfReferenceCodeSequence
    picture.SpatialLocationsPreserved = "YES"
    derived.SourceImageSequence = [picture]
    return derived


def _series(uid: str, instances: list[Any]) -> Any:
    series = pydicom.Dataset()
    series.SeriesInstanceUID = uid
    series.ReferencedInstanceSequence = instances
    return series
