"""glTF 2.0 in one binary file, `.glb`: the tube of each frame, and an animation that plays them.

VTK's own exporter needs an OpenGL window and writes text only, so the container is written
here: https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, section 4.4. Lengths are in m
and y points up, as the format wants it; the patient's head is up and the front towards you.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats

from ..centerline import Centerline
from ..errors import InputError, require
from ..files import write_whole
from ..vtp_writer import make_polydata
from .samples import UNITS, Sample, check_color, sampled, value_range

_MOST_POINTS, _SIDES = 100, 12
_MOST_BYTES = 1 << 30
_PLAIN = (0.72, 0.74, 0.78)
# mm in LPS to m with y up: x stays to the left, y becomes the head, z the front. By columns.
_TO_GLTF = [1e-3, 0, 0, 0, 0, 0, -1e-3, 0, 0, 1e-3, 0, 0, 0, 0, 0, 1]
_FLOAT, _SHORT, _INT = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963


def write_glb(
    lines: Sequence[Centerline], path: str | Path, *, color_by: str | None = None
) -> None:
    """Write the tubes of a run; several frames follow each other in an animation, in seconds.

    Parameters
    ----------
    lines : sequence of Centerline
        In order of time.
    path : path
    color_by : str, optional
        Point array that colors the tube. Default: curvature, where known.

    Raises
    ------
    InputError
        Where an array is missing or not finite, or the file cannot be written.
    """
    color_by = check_color(lines, color_by)
    samples = [sampled(line, _MOST_POINTS) for line in lines]
    limits = value_range(s.arrays[color_by] for s in samples) if color_by else None
    scene = _Scene()
    for line, sample in zip(lines, samples, strict=True):
        tube = _tube(sample, sample.arrays[color_by] if color_by else sample.s)
        scene.add(f"frame {line.frame}", *tube, colored=bool(color_by), limits=limits)
        if scene.bytes > _MOST_BYTES:
            raise InputError(path, "would be larger than 1 GiB", "choose a frame with --frame N")
    if len(lines) > 1:
        scene.animate([line.time for line in lines])
    about: dict[str, Any] = {"frames": [line.frame for line in lines]}
    about["seconds"] = [line.time for line in lines]
    if color_by and limits:
        about["color"] = {"array": color_by, "unit": UNITS[color_by], "range": limits}
    with write_whole(path) as part:
        part.write_bytes(scene.glb(about))


def _tube(sample: Sample, values: Floats) -> tuple[Floats, Floats, Floats, npt.NDArray[Any]]:
    """Vertices (n, 3), normals (n, 3), values (n,) and triangles (m, 3) of a capped tube."""
    numpy_support = require("vtkmodules.util.numpy_support", "vtk")
    filters = require("vtkmodules.vtkFiltersCore", "vtk")
    line = make_polydata(sample.points, {"Radius": sample.radius, "Value": values}, {})
    line.GetPointData().SetActiveScalars("Radius")
    tube, triangles = filters.vtkTubeFilter(), filters.vtkTriangleFilter()
    tube.SetInputData(line)
    tube.SetVaryRadiusToVaryRadiusByAbsoluteScalar()
    tube.SetNumberOfSides(_SIDES)
    tube.CappingOn()
    triangles.SetInputConnection(tube.GetOutputPort())
    triangles.Update()
    surface = triangles.GetOutput()
    data = surface.GetPointData()
    cells = numpy_support.vtk_to_numpy(surface.GetPolys().GetConnectivityArray())
    return (
        numpy_support.vtk_to_numpy(surface.GetPoints().GetData()).astype(np.float64),
        numpy_support.vtk_to_numpy(data.GetNormals()).astype(np.float64),
        numpy_support.vtk_to_numpy(data.GetArray("Value")).astype(np.float64),
        cells.reshape(-1, 3),
    )


class _Scene:
    """The parts of a glTF file, gathered frame by frame."""

    def __init__(self) -> None:
        self._binary: list[bytes] = []
        self.bytes = 0
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._nodes: list[dict[str, Any]] = [
            {"name": "stereosom", "matrix": _TO_GLTF, "children": []}
        ]
        self._animations: list[dict[str, Any]] = []

    def add(
        self,
        name: str,
        points: Floats,
        normals: Floats,
        values: Floats,
        triangles: npt.NDArray[Any],
        *,
        colored: bool,
        limits: tuple[float, float] | None,
    ) -> None:
        attributes = {
            "POSITION": self._accessor(points, _FLOAT, "VEC3", _VERTICES, bounds=True),
            "NORMAL": self._accessor(normals, _FLOAT, "VEC3", _VERTICES),
        }
        if colored and limits:
            colors = _linear_colors((values - limits[0]) / (limits[1] - limits[0]))
            attributes["COLOR_0"] = self._accessor(colors, _SHORT, "VEC4", _VERTICES)
        indices = self._accessor(triangles.ravel(), _INT, "SCALAR", _INDICES)
        primitive = {"attributes": attributes, "indices": indices, "material": int(not colored)}
        self._meshes.append({"name": name, "primitives": [primitive]})
        self._nodes.append({"name": name, "mesh": len(self._meshes) - 1})
        self._nodes[0]["children"].append(len(self._nodes) - 1)

    def animate(self, times: Sequence[float]) -> None:
        """Show each frame from its time on: the others have no size."""
        start = np.asarray(times) - times[0]
        last = float(np.median(np.diff(start))) or 1.0
        # Frames at one time would be keys at one time, which the format forbids.
        keys = np.maximum.accumulate(np.append(start, start[-1] + last))
        keys = (keys + 1e-6 * np.arange(len(keys))).astype(np.float32)
        clock = self._accessor(keys, _FLOAT, "SCALAR", None, bounds=True)
        samplers, channels = [], []
        for shown in range(len(times)):
            scale = np.zeros((len(keys), 3))
            scale[shown] = 1
            if shown == len(times) - 1:
                scale[-1] = 1
            output = self._accessor(scale, _FLOAT, "VEC3", None)
            samplers.append({"input": clock, "output": output, "interpolation": "STEP"})
            target = {"node": shown + 1, "path": "scale"}
            channels.append({"sampler": shown, "target": target})
            self._nodes[shown + 1]["scale"] = [float(shown == 0)] * 3
        self._animations = [{"name": "run", "samplers": samplers, "channels": channels}]

    def glb(self, about: dict[str, Any]) -> bytes:
        """Header, JSON and binary chunk."""
        steel = {"metallicFactor": 0.1, "roughnessFactor": 0.45}
        described: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "stereosom", "extras": about},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self._nodes,
            "meshes": self._meshes,
            "materials": [
                {"name": "values", "pbrMetallicRoughness": steel},
                {
                    "name": "plain",
                    "pbrMetallicRoughness": {**steel, "baseColorFactor": [*_PLAIN, 1]},
                },
            ],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": self.bytes}],
        }
        if self._animations:
            described["animations"] = self._animations
        text = json.dumps(described, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        binary = b"".join(self._binary)
        whole = 12 + 8 + len(text) + 8 + len(binary)
        return b"".join(
            (
                struct.pack("<4sII", b"glTF", 2, whole),
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(binary), b"BIN\0"),
                binary,
            )
        )

    def _accessor(
        self, values: Any, kind: int, shape: str, target: int | None, *, bounds: bool = False
    ) -> int:
        array = np.ascontiguousarray(values, {_FLOAT: "<f4", _SHORT: "<u2", _INT: "<u4"}[kind])
        data = array.tobytes()
        view = {"buffer": 0, "byteOffset": self.bytes, "byteLength": len(data)}
        self._views.append(view if target is None else {**view, "target": target})
        self._binary.append(data + b"\0" * (-len(data) % 4))
        self.bytes += len(self._binary[-1])
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": kind,
            "count": len(array),
            "type": shape,
        }
        if kind == _SHORT:
            accessor["normalized"] = True
        if bounds:
            columns = array.reshape(len(array), -1)
            accessor["min"] = [float(v) for v in columns.min(axis=0)]
            accessor["max"] = [float(v) for v in columns.max(axis=0)]
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _linear_colors(share: Floats) -> npt.NDArray[np.uint16]:
    """Viridis at shares from 0 to 1, as (n, 4) shares of linear light, as the format wants it."""
    encoded = require("matplotlib", "vtk").colormaps["viridis"](share)
    light = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    light[:, 3] = 1
    return np.asarray(np.round(65535 * light), dtype=np.uint16)
