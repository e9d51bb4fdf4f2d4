"""A backbone as `vtkPolyData`, and in files: `.vtp`, `.pvd`, `.mrk.json`.

Needs only VTK and numpy, so that it runs inside 3D Slicer. The names of the arrays are a
contract with VMTK (`Abscissas`, `MaximumInscribedSphereRadius`, ...), SlicerVMTK (`Radius`),
3D Slicer (`SPACE`) and ParaView (`TimeValue`).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.reconstruction import Reconstruction

from .centerline import Centerline, from_polydata, read_vtp
from .files import write_whole
from .version import generator
from .vtp_text import vtp_text
from .vtp_writer import make_polydata

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

_MOST_POINTS = 1_000_000

__all__ = [
    "Centerline",
    "from_polydata",
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
    return make_polydata(*_content(result, samples, spacing, source_uids))


def _content(
    result: Reconstruction,
    samples: int = 200,
    spacing: float | None = None,
    source_uids: Sequence[str] = (),
) -> tuple[Floats, dict[str, Any], dict[str, Any]]:
    """Points, point data, and cell and field data of a result."""
    backbone, s = _sampled(result, samples, spacing)
    arrays = _point_arrays(result, backbone, s)
    points = backbone(s)
    # A closed curve has no chord to compare with.
    chord = float(np.linalg.norm(points[-1] - points[0]))
    described: dict[str, Any] = {
        "Length": [backbone.length],
        "Tortuosity": [backbone.length / chord - 1 if chord > 0 else 0.0],
        "SPACE": ["LPS"],
        "TimeValue": [result.time],
        "Frame": [result.index],
        "ReprojectionError": result.residuals,
        "Method": [result.method],
        "Generator": [generator()],
    }
    if source_uids:
        described["SourceSOPInstanceUID"] = list(source_uids)
    return points, arrays, described


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
    text = vtp_text(*_content(result, **described))
    with write_whole(path) as part:
        part.write_text(text, encoding="utf-8")


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

    Standard deviation and, where known, radius go along: `exports.write_markups`.
    """
    from .exports import markups

    markups.write_markups(to_centerline(result, samples=samples), path, most_points=samples)


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
    deviation = result.standard_deviation_at(s)
    covariance = result.covariance_at(s).reshape(-1, 9)
    arrays = {
        "ArcLength": s,
        "Abscissas": s,
        "FrenetTangent": frames[:, 0],
        "ParallelTransportNormals": frames[:, 1],
        "Curvature": backbone.curvature(s),
        "Torsion": backbone.torsion(s),
        "Covariance": covariance[:, [0, 4, 8, 1, 5, 2]],
        "StandardDeviation": deviation,
        "Determined": deviation <= result.most_determined,
    }
    if result.radius is not None:
        radius = np.full(len(s), result.radius)
        arrays |= {"Radius": radius, "MaximumInscribedSphereRadius": radius}
    return arrays
