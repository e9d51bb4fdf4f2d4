"""A backbone as `vtkPolyData`, and in files: `.vtp`, `.pvd`, `.mrk.json`.

Needs only VTK and numpy, so that it runs inside 3D Slicer. The names of the arrays are a
contract with VMTK (`Abscissas`, `MaximumInscribedSphereRadius`, ...), SlicerVMTK (`Radius`),
3D Slicer (`SPACE`) and ParaView (`TimeValue`).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.reconstruction import Reconstruction

from .centerline import Centerline, from_polydata, read_vtp, vtk_messages
from .errors import require
from .files import write_whole

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

vtk_core = require("vtkmodules.vtkCommonCore", "vtk")
vtk_data = require("vtkmodules.vtkCommonDataModel", "vtk")
vtk_xml = require("vtkmodules.vtkIOXML", "vtk")
numpy_support = require("vtkmodules.util.numpy_support", "vtk")

_MARKUPS_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
    "Resources/Schema/markups-schema-v1.0.3.json#"
)
_MOST_POINTS = 1_000_000

__all__ = [
    "Centerline",
    "generator",
    "read_vtp",
    "to_centerline",
    "to_polydata",
    "write_markups",
    "write_pvd",
    "write_vtp",
]


def to_polydata(
    result: Reconstruction,
    *,
    samples: int = 200,
    spacing: float | None = None,
    source_uids: Sequence[str] = (),
) -> vtkPolyData:
    """Make one polyline, base to tip, at equal steps of arc length, with all that is known.

    Parameters
    ----------
    result : Reconstruction
        One that is ok.
    samples : int
        Number of points, at least two.
    spacing : float, optional
        Longest step between points, mm; overrides `samples`.
    source_uids : sequence of str
        SOP Instance UIDs of the pictures, where DICOM was read.

    Returns
    -------
    vtkPolyData
        Points in mm. Point data (n,): `ArcLength` and `Abscissas` (active scalars), `Radius`
        and `MaximumInscribedSphereRadius` (where known), `StandardDeviation` in mm,
        `Curvature`, `Torsion` in 1/mm, `Determined` (0 or 1); (n, 3): `FrenetTangent` (active
        vectors), `ParallelTransportNormals` (active normals); (n, 6): `Covariance` in mm², in
        the order xx, yy, zz, xy, yz, xz. Cell data: `Length` (mm), `Tortuosity`. Field data:
        `SPACE`, `TimeValue` (s), `Frame`, `ReprojectionError` (px, two), `Method`,
        `Generator`, `SourceSOPInstanceUID`.

    Raises
    ------
    ValueError
        Where the result has no backbone, or fewer than two points are asked for.
    """
    backbone, s = _sampled(result, samples, spacing)
    points = backbone(s)
    polydata: vtkPolyData = vtk_data.vtkPolyData()
    polydata.SetPoints(vtk_core.vtkPoints())
    polydata.GetPoints().SetData(_array("Points", points))
    polydata.SetLines(vtk_data.vtkCellArray())
    polydata.GetLines().InsertNextCell(len(s), range(len(s)))

    point_data = polydata.GetPointData()
    for name, values in _point_arrays(result, backbone, s).items():
        point_data.AddArray(_array(name, values))
    point_data.SetActiveScalars("Abscissas")
    point_data.SetActiveVectors("FrenetTangent")
    point_data.SetActiveNormals("ParallelTransportNormals")

    # A closed curve has no chord to compare with.
    chord = float(np.linalg.norm(points[-1] - points[0]))
    tortuosity = backbone.length / chord - 1 if chord > 0 else 0.0
    polydata.GetCellData().AddArray(_array("Length", [backbone.length]))
    polydata.GetCellData().AddArray(_array("Tortuosity", [tortuosity]))

    field = polydata.GetFieldData()
    field.AddArray(_strings("SPACE", ["LPS"]))
    field.AddArray(_array("TimeValue", [result.time]))
    field.AddArray(_array("Frame", [result.index]))
    field.AddArray(_array("ReprojectionError", result.residuals))
    field.AddArray(_strings("Method", [result.method]))
    field.AddArray(_strings("Generator", [generator()]))
    if source_uids:
        field.AddArray(_strings("SourceSOPInstanceUID", source_uids))
    return polydata


def to_centerline(result: Reconstruction, **described: Any) -> Centerline:
    """What `read_vtp` would read back for a result; `described` as in `to_polydata`."""
    return from_polydata(to_polydata(result, **described))


def write_vtp(result: Reconstruction, path: str | Path, **described: Any) -> None:
    """Write a `.vtp`, whole or not at all; `described` as in `to_polydata`.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    writer = vtk_xml.vtkXMLPolyDataWriter()
    writer.SetInputData(to_polydata(result, **described))
    # Python writes what VTK made: its errors say which of folder, right or room is missing.
    writer.WriteToOutputStringOn()
    with vtk_messages() as messages:
        writer.Write()
    if messages:
        raise RuntimeError(f"{path}: VTK could not make the file: {messages[0]}")
    with write_whole(path) as part:
        part.write_text(writer.GetOutputString(), encoding="utf-8")


def write_pvd(entries: Iterable[tuple[float, str]], path: str | Path) -> None:
    """Write a ParaView time series: (seconds, name of a `.vtp` relative to `path`) each."""
    lines = [
        f'    <DataSet timestep="{time!r}" part="0" file={quoteattr(str(name))}/>\n'
        for time, name in ((float(time), name) for time, name in entries)
    ]
    with write_whole(path) as part:
        part.write_text(
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
            + "".join(lines)
            + "  </Collection>\n</VTKFile>\n",
            encoding="utf-8",
        )


def write_markups(result: Reconstruction, path: str | Path, *, samples: int = 50) -> None:
    """Write a 3D Slicer markups curve (`.mrk.json`) with `samples` control points.

    Slicer splines the points; fifty keep a device's curve to a few micrometres and can still
    be moved by hand. Standard deviation and, where known, radius go along as measurements.
    """
    backbone, s = _sampled(result, samples, None)
    measured = {"StandardDeviation": result.standard_deviation_at(s)}
    if result.radius is not None:
        measured["Radius"] = np.full(len(s), result.radius)
    curve = {
        "type": "Curve",
        "coordinateSystem": "LPS",
        "coordinateUnits": "mm",
        "controlPoints": [
            {
                "id": str(number),
                "label": {1: "base", len(s): "tip"}.get(number, ""),
                "position": position.tolist(),
                "selected": True,
                "locked": False,
                "visibility": True,
                "positionStatus": "defined",
            }
            for number, position in enumerate(backbone(s), start=1)
        ],
        "measurements": [
            {
                "name": name,
                "enabled": True,
                "units": "mm",
                "printFormat": "%-#4.4g%s",
                "controlPointValues": values.tolist(),
            }
            for name, values in measured.items()
        ],
    }
    with write_whole(path) as part:
        part.write_text(json.dumps({"@schema": _MARKUPS_SCHEMA, "markups": [curve]}, indent=1))


def generator() -> str:
    """Name and version of this program, as files carry it."""
    try:
        return f"stereosom {version('stereosom')}"
    except PackageNotFoundError:  # a checkout on the path, as in 3D Slicer
        return "stereosom"


def _sampled(result: Reconstruction, count: int, spacing: float | None) -> tuple[Backbone, Floats]:
    """The backbone, and its arc lengths at equal steps."""
    if result.backbone is None:
        raise ValueError(f"frame {result.index} has no backbone: {result.reason}")
    if spacing is not None:
        if not spacing > 0:
            raise ValueError(f"spacing: {spacing:g} mm must be positive")
        count = max(2, int(np.ceil(result.backbone.length / spacing - 1e-9)) + 1)
    if not 2 <= count <= _MOST_POINTS:
        raise ValueError(f"samples: {count} must lie between 2 and {_MOST_POINTS}")
    return result.backbone, result.backbone.arc_lengths(count)


def _point_arrays(result: Reconstruction, backbone: Backbone, s: Floats) -> dict[str, Any]:
    frames = backbone.frames(s)
    covariance = result.covariance_at(s).reshape(-1, 9)
    arrays = {
        "ArcLength": s,
        "Abscissas": s,
        "FrenetTangent": frames[:, 0],
        "ParallelTransportNormals": frames[:, 1],
        "Curvature": backbone.curvature(s),
        "Torsion": backbone.torsion(s),
        "Covariance": covariance[:, [0, 4, 8, 1, 5, 2]],
        "StandardDeviation": result.standard_deviation_at(s),
        "Determined": result.determined_at(s),
    }
    if result.radius is not None:
        radius = np.full(len(s), result.radius)
        arrays |= {"Radius": radius, "MaximumInscribedSphereRadius": radius}
    return arrays


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
