"""The device as surfaces: its tube, and around it how far it may be from where it is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from stereosom.arrays import Booleans, Floats

from ..centerline import Centerline
from ..errors import InputError, require
from .look import extent
from .style import COLOR_BY

pv = require("pyvista", "vtk")

# Enough for any picture: a point per few pixels, and a circle without corners.
_POINTS, _SIDES = 400, 24
# Where no radius is known, the tube is this share of the device's extent.
_ASSUMED_RADIUS = 0.006


@dataclass(frozen=True, eq=False)
class Shape:
    """A centerline made ready to be drawn: n points at equal steps, and what is known there.

    Parameters
    ----------
    points, across_1, across_2 : (n, 3) arrays
        The curve, mm, and two unit vectors across it.
    radius : (n,) array
        Of the tube, mm.
    radius_known : bool
    spread : (n, 2, 2) array, optional
        Covariance across the curve, mm².
    determined : (n,) array of bool
        False where the views leave the depth open.
    values : (n,) array, optional
        What colors the tube.
    """

    points: Floats
    across_1: Floats
    across_2: Floats
    radius: Floats
    radius_known: bool
    spread: Floats | None
    determined: Booleans
    values: Floats | None


def shape_of(line: Centerline, color_by: str | None) -> Shape:
    """Take at most a few hundred points of a centerline, and what is known along it.

    Raises
    ------
    InputError
        Where the centerline does not hold what shall color it.
    """
    backbone = line.backbone
    places = np.linspace(0, 1, len(line.points))
    # Files of others may have uneven steps: their arrays stand at their own arc lengths.
    steps = np.linalg.norm(np.diff(line.points, axis=0), axis=1)
    if steps.sum() > 0:
        places = np.concatenate([[0], np.cumsum(steps)]) / steps.sum()
    stored = _stored_frames(line)
    if stored is None:
        s = backbone.arc_lengths(min(len(line.points), _POINTS))
        at, points = s / backbone.length, backbone(s)
        _, across_1, across_2 = np.moveaxis(backbone.frames(s), 1, 0)
    else:  # as our own files have them: nothing needs to be worked out
        at, points = places, line.points
        across_1, across_2 = stored

    def along(name: str) -> Floats | None:
        values = line.arrays.get(name)
        if values is None or values.ndim != 1 or not np.isfinite(values).any():
            return None
        return np.asarray(np.interp(at, places, values))

    radius = along("Radius")
    if radius is None:
        radius = along("MaximumInscribedSphereRadius")
    known = radius is not None and bool(np.all(np.isfinite(radius) & (radius > 0)))
    determined = along("Determined")
    return Shape(
        points,
        across_1,
        across_2,
        radius
        if radius is not None and known
        else np.full(len(at), _ASSUMED_RADIUS * extent(points)),
        known,
        _spread(line, places, at, across_1, across_2),
        np.ones(len(at), dtype=bool) if determined is None else determined > 0.5,
        None if color_by is None else _values(line, color_by, along(color_by), len(at)),
    )


def tube(shape: Shape, scale: float = 1.0) -> Any:
    """The device's surface, pyvista.PolyData."""
    angles = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    round_it = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return _swept(shape, scale * shape.radius[:, None, None] * round_it)


def envelope(shape: Shape, deviations: float = 2.0) -> Any | None:
    """The surface that the device's own stays inside within so many standard deviations.

    Across the curve it is the sum of a disk, the device, and an ellipse, where its axis may
    be: the point of it that lies farthest along a unit vector u is
    ``radius u + deviations C u / sqrt(u' C u)``, with C the covariance across the curve.
    """
    if shape.spread is None:
        return None
    angles = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    u = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    moved = np.einsum("nij,mj->nmi", shape.spread, u)
    length = np.sqrt(np.maximum(np.einsum("nmi,mi->nm", moved, u), 1e-12))
    return _swept(shape, shape.radius[:, None, None] * u + deviations * moved / length[:, :, None])


def polyline(points: Floats) -> Any:
    """Points as one line, pyvista.PolyData."""
    line = pv.PolyData(np.asarray(points))
    line.lines = np.concatenate([[len(points)], np.arange(len(points))])
    line.verts = np.empty(0, dtype=int)
    return line


def _swept(shape: Shape, outline: Floats) -> Any:
    """An outline across the curve at each point, (n, m, 2) mm, swept along it and closed."""
    n, m = outline.shape[:2]
    rings = (
        shape.points[:, None]
        + outline[:, :, :1] * shape.across_1[:, None]
        + outline[:, :, 1:] * shape.across_2[:, None]
    )
    mesh = pv.PolyData()
    mesh.points = rings.reshape(-1, 3)
    mesh.SetPolys(_faces(n, m))
    # Normals straight out of the curve shade smoothly, and cost nothing.
    out = rings - shape.points[:, None]
    length = np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), 1e-12)
    mesh.point_data.active_normals = (out / length).reshape(-1, 3)
    if shape.values is not None:
        mesh["values"] = np.repeat(np.where(shape.determined, shape.values, np.nan), m)
    return mesh


@lru_cache(maxsize=8)
def _faces(n: int, m: int) -> Any:
    """Faces between n rings of m points, and two that close the ends, vtkCellArray.

    From picture to picture it is one and the same, so that OpenGL keeps it.
    """
    i, j = np.meshgrid(np.arange(n - 1), np.arange(m), indexing="ij")
    beside = (j + 1) % m
    sides = np.stack(
        [np.full_like(i, 4), i * m + j, i * m + beside, (i + 1) * m + beside, (i + 1) * m + j],
        axis=-1,
    )
    ends = [m, *range(m - 1, -1, -1), m, *range((n - 1) * m, n * m)]
    return pv.CellArray(np.concatenate([sides.ravel(), ends]))


def _stored_frames(line: Centerline) -> tuple[Floats, Floats] | None:
    """Two unit vectors across the curve at each point, where the file holds sound ones."""
    wanted = [line.arrays.get(name) for name in ("FrenetTangent", "ParallelTransportNormals")]
    if len(line.points) > _POINTS or any(w is None or w.shape != line.points.shape for w in wanted):
        return None
    tangent, normal = (np.asarray(array, dtype=float) for array in wanted)
    second = np.cross(tangent, normal)
    length = np.linalg.norm(second, axis=1)
    if not np.all(length > 0.9):  # not unit vectors, not at right angles, or no numbers
        return None
    second = second / length[:, None]
    first = np.cross(second, tangent)
    return first / np.linalg.norm(first, axis=1, keepdims=True), second


def _values(line: Centerline, color_by: str, found: Floats | None, count: int) -> Floats:
    if color_by == "Time":
        return np.full(count, line.time)
    if found is None:
        others = [name for name in COLOR_BY if name in line.arrays or name == "Time"]
        raise InputError(
            f"frame {line.frame}",
            f"has no array {color_by} to color it by",
            f"give --color-by one of {', '.join(others)}",
        )
    return found


def _spread(
    line: Centerline, places: Floats, at: Floats, across_1: Floats, across_2: Floats
) -> Floats | None:
    """Covariance across the curve, (n, 2, 2) mm², from `Covariance` or `StandardDeviation`."""
    covariance, deviation = (line.arrays.get(name) for name in ("Covariance", "StandardDeviation"))
    if covariance is not None and covariance.shape == (len(places), 6):
        if not np.isfinite(covariance).all():
            return None
        xx, yy, zz, xy, yz, xz = (np.interp(at, places, part) for part in covariance.T)
        full = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), -1, 0)
        across = np.stack([across_1, across_2], axis=1)
        return np.asarray(across @ full @ across.transpose(0, 2, 1))
    if deviation is not None and deviation.ndim == 1 and np.isfinite(deviation).all():
        return np.interp(at, places, deviation)[:, None, None] ** 2 * np.eye(2)
    return None
