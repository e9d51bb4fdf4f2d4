"""`Centerline`: what a `.vtp` holds, read with care. Needs only VTK and numpy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone

from .errors import InputError, require

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

vtk_core = require("vtkmodules.vtkCommonCore", "vtk")
vtk_xml = require("vtkmodules.vtkIOXML", "vtk")
numpy_support = require("vtkmodules.util.numpy_support", "vtk")

# Far above any backbone, far below what hurts.
_MOST_BYTES, _MOST_POINTS, _MOST_COMPONENTS, _DEEPEST = 64 << 20, 1_000_000, 100, 16


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
        reader = vtk_xml.vtkXMLPolyDataReader()
        reader.ReadFromInputStringOn()
        reader.SetInputString(data)
        with vtk_messages() as messages:
            reader.Update()
        if messages:
            raise ValueError(messages[0])
        return from_polydata(reader.GetOutput())
    except (ValueError, expat.ExpatError) as error:
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
    points = _numpy(polydata.GetPoints().GetData()) if polydata.GetPoints() else np.empty((0, 3))
    lines = polydata.GetLines()
    if polydata.GetNumberOfCells() != 1 or lines.GetNumberOfCells() != 1:
        raise ValueError(
            f"holds {lines.GetNumberOfCells()} lines and {polydata.GetNumberOfCells()} cells, "
            "not one polyline"
        )
    order = numpy_support.vtk_to_numpy(lines.GetConnectivityArray()).astype(np.intp)
    ends = numpy_support.vtk_to_numpy(lines.GetOffsetsArray())
    if len(ends) != 2 or tuple(ends) != (0, len(order)):
        raise ValueError("its line's offsets are wrong")
    if np.any((order < 0) | (order >= len(points))):
        raise ValueError("its line runs to points that are not there")
    point_data = polydata.GetPointData()
    arrays = {}
    for i in range(point_data.GetNumberOfArrays()):
        array = point_data.GetArray(i)
        if array is not None and array.GetName() and array.GetNumberOfTuples() == len(points):
            arrays[array.GetName()] = _numpy(array)[order]
    points = points[order]
    fields = {
        **_plain(polydata.GetCellData()),
        **_plain(polydata.GetFieldData()),
    }
    if fields.get("SPACE") == ("RAS",):
        turned = (point_data.GetVectors(), point_data.GetNormals())
        to_lps = np.array([-1.0, -1.0, 1.0])
        points = points * to_lps
        for name in {array.GetName() for array in turned if array is not None} & set(arrays):
            arrays[name] = arrays[name] * to_lps
        fields["SPACE"] = ("LPS",)
    backbone = Backbone.through(points)  # refuses what is not finite or has no length
    time, frame = (_first_number(fields.get(name)) for name in ("TimeValue", "Frame"))
    return Centerline(points, backbone, time, int(frame), arrays, fields)


def _plain(data: Any) -> dict[str, Any]:
    """Arrays of cell or field data: numbers as numpy arrays, strings as tuples."""
    plain: dict[str, Any] = {}
    for i in range(data.GetNumberOfArrays()):
        array = data.GetAbstractArray(i)
        if isinstance(array, vtk_core.vtkStringArray):
            plain[array.GetName()] = tuple(
                array.GetValue(j) for j in range(array.GetNumberOfValues())
            )
        elif isinstance(array, vtk_core.vtkDataArray):
            plain[array.GetName()] = _numpy(array)
    return plain


def _numpy(array: Any) -> Floats:
    # A copy: VTK's memory goes with the reader.
    return np.array(numpy_support.vtk_to_numpy(array), dtype=np.float64)


def _first_number(values: Any) -> float:
    if not isinstance(values, np.ndarray) or not values.size or not np.isfinite(values.flat[0]):
        return 0.0
    return float(values.flat[0])


@contextmanager
def vtk_messages() -> Iterator[list[str]]:
    """Collect VTK's warnings and errors, a line each, instead of printing them."""
    messages: list[str] = []
    window, previous = vtk_core.vtkStringOutputWindow(), vtk_core.vtkOutputWindow.GetInstance()
    verbosity = vtk_core.vtkLogger.GetCurrentVerbosityCutoff()
    vtk_core.vtkOutputWindow.SetInstance(window)
    vtk_core.vtkLogger.SetStderrVerbosity(vtk_core.vtkLogger.VERBOSITY_OFF)
    try:
        yield messages
    finally:
        vtk_core.vtkOutputWindow.SetInstance(previous)
        vtk_core.vtkLogger.SetStderrVerbosity(verbosity)
        for block in window.GetOutput().split("\n\n\n"):
            # "ERROR: In FILE, line N\nCLASS (ADDRESS): MESSAGE"
            message = block.strip().partition("\n")[2].partition("): ")[2]
            if message:
                messages.append(message.splitlines()[0].rstrip("."))
