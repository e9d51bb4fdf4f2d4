"""`Centerline`: what a `.vtp` holds, read with care. Needs only VTK and numpy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone

from .errors import InputError, require
from .vtp_decoder import Content, content_of, decode, vtk_messages

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

require("vtkmodules.vtkIOXML", "vtk")

__all__ = ["Centerline", "from_content", "from_polydata", "read_vtp", "vtk_messages"]

# Far above any backbone, far below what hurts.
_MOST_BYTES, _MOST_POINTS, _MOST_COMPONENTS, _DEEPEST = 64 << 20, 1_000_000, 100, 16
_FARTHEST_MM = 1e6


@dataclass(frozen=True, eq=False)
class Centerline:
    """What a `.vtp` holds: a curve, and what was known along it.

    Parameters
    ----------
    points : (n, 3) array
        Base to tip, mm, LPS.
    backbone : Backbone
        Through the points.
    time : float
        Seconds; 0 where the file does not say.
    frame : int
        Number of the frame; 0 where the file does not say.
    arrays : mapping of str to array
        Point data, (n,) or (n, components).
    field : mapping of str to array or tuple of str
        Cell data and field data.
    """

    points: Floats
    backbone: Backbone
    time: float
    frame: int
    arrays: Mapping[str, Floats]
    field: Mapping[str, Any]


def read_vtp(path: str | Path) -> Centerline:
    """Read one polyline, by this program or another (VMTK, 3D Slicer), as LPS.

    A file in RAS is turned: points and active vectors and normals, as 3D Slicer does.

    Raises
    ------
    InputError
        Where the file is missing, no `.vtp`, broken, or holds no single clean polyline.
    """
    try:
        if Path(path).stat().st_size > _MOST_BYTES:
            raise _refusal(path, f"is larger than {_MOST_BYTES >> 20} MiB")
        data = Path(path).read_bytes()
    except OSError as error:
        why = f"cannot be read ({error.strerror or error})"
        raise InputError(path, why, "give a .vtp that exists") from error
    try:
        _check_header(data)
        return from_content(decode(data))
    except expat.ExpatError as error:
        raise _refusal(path, f"is no .vtp, for it is no XML ({error})") from error
    except ValueError as error:
        raise _refusal(path, str(error)) from error


def _refusal(path: str | Path, why: str) -> InputError:
    return InputError(path, why, "give a .vtp that holds one polyline from base to tip, in mm")


def _check_header(data: bytes) -> None:
    """Refuse, before VTK sees it, the XML that would end the process inside VTK."""
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST:
            raise ValueError("its XML is nested too deep")
        if depth == 1 and (tag, attributes.get("type")) != ("VTKFile", "PolyData"):
            raise ValueError("is no VTK XML PolyData")
        for name, value in attributes.items():
            if name.startswith("NumberOf"):
                most = _MOST_COMPONENTS if name == "NumberOfComponents" else _MOST_POINTS
                if not (value.strip().isdecimal() and int(value) <= most):
                    raise ValueError(f"has {name} = {value[:20]}, not a number from 0 to {most}")

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse(*_: Any) -> None:
        raise ValueError("its XML has a document type declaration")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = refuse
    # What follows may be raw bytes, which are no XML; VTK checks them against the header.
    header, appended, _ = data.partition(b"<AppendedData")
    parser.Parse(header, not appended)
    if depth == 0 and appended:
        raise ValueError("is no VTK XML PolyData")


def from_polydata(polydata: vtkPolyData) -> Centerline:
    """Check one polyline, and turn it into LPS arrays.

    Raises
    ------
    ValueError
        Where it is not one polyline of at least two different, finite points.
    """
    return from_content(content_of(polydata))


def from_content(content: Content) -> Centerline:
    """As `from_polydata`, from plain arrays."""
    points = content.points.astype(np.float64)
    if content.cells != 1 or content.lines != 1:
        raise ValueError(f"holds {content.lines} lines and {content.cells} cells, not one polyline")
    order = content.connectivity.astype(np.intp)
    if tuple(content.offsets) != (0, len(order)):
        raise ValueError("its line's offsets are wrong")
    if np.any((order < 0) | (order >= len(points))):
        raise ValueError("its line runs to points that are not there")
    arrays = {
        name: values.astype(np.float64)[order]
        for name, values in content.point_data.items()
        if len(values) == len(points)
    }
    points = points[order]
    if len(points) < 2 or points.shape[1:] != (3,):
        raise ValueError("its line has fewer than two points")
    if not np.abs(points).max() <= _FARTHEST_MM:  # nor is NaN
        raise ValueError("has points that are not finite, or a kilometre away")
    fields = {
        name: values if isinstance(values, tuple) else values.astype(np.float64)
        for name, values in content.described.items()
    }
    if fields.get("SPACE") == ("RAS",):
        to_lps = np.array([-1.0, -1.0, 1.0])
        points = points * to_lps
        for name in set(content.turning) & set(arrays):
            arrays[name] = arrays[name] * to_lps
        fields["SPACE"] = ("LPS",)
    backbone = Backbone.through(points)  # refuses what is not finite or has no length
    time, frame = (_first_number(fields.get(name)) for name in ("TimeValue", "Frame"))
    return Centerline(points, backbone, time, int(frame), arrays, fields)


def _first_number(values: Any) -> float:
    if not isinstance(values, np.ndarray) or not values.size or not np.isfinite(values.flat[0]):
        return 0.0
    return float(values.flat[0])
