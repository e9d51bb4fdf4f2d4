"""One polyline with its arrays as `vtkPolyData`, and that as the text of a `.vtp`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stereosom.arrays import Floats

from .centerline import Centerline
from .errors import require
from .vtp_decoder import vtk_messages

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

vtk_core = require("vtkmodules.vtkCommonCore", "vtk")
vtk_data = require("vtkmodules.vtkCommonDataModel", "vtk")
vtk_xml = require("vtkmodules.vtkIOXML", "vtk")
numpy_support = require("vtkmodules.util.numpy_support", "vtk")

_OF_CELLS = ("Length", "Tortuosity")


def make_polydata(
    points: Floats, point_data: Mapping[str, Any], described: Mapping[str, Any]
) -> vtkPolyData:
    """Make one polyline.

    Parameters
    ----------
    points : (n, 3) array
        Base to tip, mm.
    point_data : mapping of str to (n,) or (n, k) array
        `Abscissas`, `FrenetTangent` and `ParallelTransportNormals` become the active scalars,
        vectors and normals.
    described : mapping of str to numbers or sequence of str
        `Length` and `Tortuosity` become cell data, the others field data.
    """
    polydata: vtkPolyData = vtk_data.vtkPolyData()
    polydata.SetPoints(vtk_core.vtkPoints())
    polydata.GetPoints().SetData(_array("Points", points))
    polydata.SetLines(vtk_data.vtkCellArray())
    polydata.GetLines().InsertNextCell(len(points), range(len(points)))
    to = polydata.GetPointData()
    for name, values in point_data.items():
        to.AddArray(_array(name, values))
    to.SetActiveScalars("Abscissas")
    to.SetActiveVectors("FrenetTangent")
    to.SetActiveNormals("ParallelTransportNormals")
    for name, values in described.items():
        data = polydata.GetCellData() if name in _OF_CELLS else polydata.GetFieldData()
        is_text = isinstance(values, (list, tuple)) and all(isinstance(v, str) for v in values)
        data.AddArray(_strings(name, values) if is_text else _array(name, values))
    return polydata


def polydata_of(line: Centerline) -> vtkPolyData:
    """Make a polyline of what was read from a file; its space is LPS."""
    described = {**line.field, "SPACE": ("LPS",), "TimeValue": [line.time], "Frame": [line.frame]}
    return make_polydata(line.points, line.arrays, described)


def vtp_text(polydata: vtkPolyData) -> str:
    """Polydata as the text of a `.vtp`."""
    writer = vtk_xml.vtkXMLPolyDataWriter()
    writer.SetInputData(polydata)
    writer.WriteToOutputStringOn()
    # Compressed, numbers that all differ are a sixth shorter, and take twice as long.
    writer.SetCompressorTypeToNone()
    with vtk_messages() as messages:
        writer.Write()
    if messages:
        raise RuntimeError(f"VTK could not make a .vtp: {messages[0]}")
    return str(writer.GetOutputString())


def _array(name: str, values: Any) -> Any:
    array = numpy_support.numpy_to_vtk(np.array(values, dtype=np.float64, order="C"), deep=True)
    array.SetName(name)
    return array


def _strings(name: str, values: Iterable[str]) -> Any:
    array = vtk_core.vtkStringArray()
    array.SetName(name)
    for value in values:
        array.InsertNextValue(value)
    return array
