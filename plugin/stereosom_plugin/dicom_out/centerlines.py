"""The centerlines of a run as one Comprehensive 3D SR (TID 1500), a polyline in space per frame.

One document holds the run: an archive lists documents, and a reader compares the frames of one
run, which it would otherwise have to gather from hundreds of objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydicom.sr.codedict import codes

from stereosom.camera import StereoRig
from stereosom_plugin.centerline import Centerline
from stereosom_plugin.errors import InputError
from stereosom_plugin.files import write_whole
from stereosom_plugin.polydata import generator

from .source import Origin, described, finish, highdicom, new_uid, reference, save, stub

SERIES_NUMBER = 9001  # apart from what an X-ray system counts; numbers need not be unique

COORDINATES = {
    "isocenter_lps": "Coordinates are mm about the point that lay in the isocenter of the C-arms "
    "in the first frame, not in the coordinate system of another examination: x to the patient's "
    "left, y to the back, z to the head, as positioner, table and patient position say.",
    "patient_lps": "Coordinates are mm in the patient: x to the left, y to the back, z to the "
    "head.",
}


def write_centerlines(
    lines: Sequence[Centerline],
    origin: Origin,
    rigs: Sequence[StereoRig],
    path: str | Path,
    *,
    predicted: Sequence[int] = (),
    notes: Sequence[str] = (),
    created: datetime | None = None,
) -> None:
    """Write the centerlines of a run as a Comprehensive 3D SR document.

    Each is a measurement group (TID 1501) of the same tracked device: the path from base to
    tip (SCOORD3D, polyline), its length, the standard deviation of the tip, and the pictures
    that it was made of.

    Parameters
    ----------
    lines : sequence of Centerline
        At least one.
    origin : Origin
    rigs : sequence of StereoRig
        The geometry that was used. The same pictures with the same geometry share a frame of
        reference; any other run has one of its own.
    path : path
    predicted : sequence of int
        Numbers of the frames in which the device was not seen; their lengths are marked as
        estimated.
    notes : sequence of str
        What was assumed; it stands in the document.
    created : datetime, optional
        Default: now. The same content at the same time gives the same bytes.

    Raises
    ------
    InputError
        Where there is no line, or what is taken over from the source cannot be written.
    """
    path = Path(path)
    if not lines:
        raise InputError(path, "no frame has a centerline", "see centerlines.csv for the reasons")
    created = created or datetime.now()
    geometry = [matrix for rig in rigs for matrix in (rig.a.projection, rig.b.projection)]
    space = new_uid("frame of reference", *origin.uids, np.asarray(geometry).tobytes().hex())
    device = new_uid("device", *origin.uids)
    groups = [_group(line, origin, space, device, line.frame in predicted) for line in lines]
    content = highdicom.sr.MeasurementReport(
        highdicom.sr.ObservationContext(
            observer_device_context=highdicom.sr.ObserverContext(
                codes.DCM.Device,
                highdicom.sr.DeviceObserverIdentifyingAttributes(
                    new_uid("observer", generator()), name=generator()
                ),
            )
        ),
        procedure_reported=codes.SCT.Fluoroscopy,
        imaging_measurements=groups,
        title=codes.DCM.ImagingMeasurementReport,
    )
    for note in (COORDINATES.get(rigs[0].frame, COORDINATES["patient_lps"]), *notes):
        content[0].ContentSequence.append(
            highdicom.sr.TextContentItem(
                codes.DCM.Comment,
                note.encode("ascii", "replace").decode(),
                highdicom.sr.RelationshipTypeValues.CONTAINS,
            )
        )
    curves = [line.points.tobytes().hex() for line in lines]
    document = highdicom.sr.Comprehensive3DSR(
        [stub(dataset) for dataset in origin.datasets.values()],
        content[0],
        new_uid("centerlines", *origin.uids),
        SERIES_NUMBER,
        new_uid("centerlines", *origin.uids, created.isoformat(), *notes, *curves),
        1,
        is_complete=True,
        series_description="Device centerlines, mm",
        **described(),
    )
    finish(document, origin.first, created)
    with write_whole(path) as part:
        save(document, part, origin.frames_a[0].path)


def _group(line: Centerline, origin: Origin, space: Any, device: Any, predicted: bool) -> Any:
    """One frame: where the device is, how long, how sure, from which pictures."""
    sources = [
        reference(origin.datasets[frame.path], [frame.number])
        for frame in (origin.frames_a[line.frame], origin.frames_b[line.frame])
    ]
    derivation = codes.DCM.Estimated if predicted else None
    measured = [
        highdicom.sr.Measurement(
            codes.SCT.Length,
            float(line.backbone.length),
            codes.UCUM.Millimeter,
            derivation=derivation,
            referenced_images=[highdicom.sr.SourceImageForMeasurement(**one) for one in sources],
            referenced_coordinates=[_coordinates("POLYLINE", line.points, space, codes.DCM.Path)],
        )
    ]
    if (sigma := line.arrays.get("StandardDeviation")) is not None:
        tip = _coordinates("POINT", line.points[-1:], space, codes.DCM.PathVertex)
        measured.append(
            highdicom.sr.Measurement(
                codes.SCT.StandardDeviation,
                float(sigma[-1]),
                codes.UCUM.Millimeter,
                derivation=derivation,
                referenced_coordinates=[tip],
            )
        )
    seen = "predicted, the device was not seen" if predicted else "seen"
    return highdicom.sr.MeasurementsAndQualitativeEvaluations(
        highdicom.sr.TrackingIdentifier(device, "device"),
        time_point_context=highdicom.sr.TimePointContext(
            f"frame {line.frame} at {line.time:.4f} s, {seen}"
        ),
        finding_type=codes.SCT.InstrumentDevice,
        measurements=measured,
    )


def _coordinates(kind: str, points: Any, space: Any, purpose: Any) -> Any:
    return highdicom.sr.CoordinatesForMeasurement3D(kind, points, space, purpose=purpose)
