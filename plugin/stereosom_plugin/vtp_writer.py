"""One polyline with its arrays as `vtkPolyData`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from stereosom.arrays import Floats

from .errors import require
from .vtp_text import ACTIVE, OF_CELLS, is_text

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

vtk_core = require("vtkmodules.vtkCommonCore", "vtk")
vtk_data = require("vtkmodules.vtkCommonDataModel", "vtk")
numpy_support = require("vtkmodules.util.numpy_support", "vtk")


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
    for role, name in ACTIVE.items():
        getattr(to, f"SetActive{role}")(name)
    for name, values in described.items():
        data = polydata.GetCellData() if name in OF_CELLS else polydata.GetFieldData()
        data.AddArray(_strings(name, values) if is_text(values) else _array(name, values))
    return polydata


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
