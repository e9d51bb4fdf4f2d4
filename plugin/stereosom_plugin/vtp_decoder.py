"""Polydata as plain arrays; of a file's bytes, through VTK in a child process.

VTK's XML reader aborts or crashes on some broken files. In the child it may: the run goes on,
and one line says that the file cannot be read. The child stays warm from file to file. It is
this file run by itself, so that it loads nothing but VTK and numpy.
"""

from __future__ import annotations

import atexit
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

SECONDS_A_FILE = 60.0
BYTES_OF_CHILD = 3 << 30
BYTES_OF_ANSWER = 1 << 30

Array = npt.NDArray[Any]


@dataclass
class Content:
    """What polydata holds, as numpy arrays; nothing in it is checked.

    `points` (n, 3); `connectivity` and `offsets` of its lines; `cells` and `lines`, how many
    it has; `point_data` by name; `described`, cell and field data by name, text as tuples;
    `turning`, the names of the active vectors and normals.
    """

    points: Array
    connectivity: Array
    offsets: Array
    cells: int
    lines: int
    point_data: dict[str, Array] = field(default_factory=dict)
    described: dict[str, Array | tuple[str, ...]] = field(default_factory=dict)
    turning: tuple[str, ...] = ()


def content_of(polydata: Any) -> Content:
    """Copy what a `vtkPolyData` holds."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkDataArray, vtkStringArray

    def plain(array: Any) -> Array | tuple[str, ...] | None:
        if isinstance(array, vtkStringArray):
            return tuple(array.GetValue(i) for i in range(array.GetNumberOfValues()))
        # A copy: VTK's memory goes with the reader.
        return np.array(vtk_to_numpy(array)) if isinstance(array, vtkDataArray) else None

    def by_name(data: Any) -> dict[str, Any]:
        arrays = [data.GetAbstractArray(i) for i in range(data.GetNumberOfArrays())]
        found = {array.GetName(): plain(array) for array in arrays if array and array.GetName()}
        return {name: values for name, values in found.items() if values is not None}

    points, lines = polydata.GetPoints(), polydata.GetLines()
    point_data = polydata.GetPointData()
    turning = (point_data.GetVectors(), point_data.GetNormals())
    return Content(
        points=np.array(vtk_to_numpy(points.GetData())) if points else np.empty((0, 3)),
        connectivity=np.array(vtk_to_numpy(lines.GetConnectivityArray())),
        offsets=np.array(vtk_to_numpy(lines.GetOffsetsArray())),
        cells=polydata.GetNumberOfCells(),
        lines=lines.GetNumberOfCells(),
        point_data={
            name: values
            for name, values in by_name(point_data).items()
            if not isinstance(values, tuple)
        },
        described={**by_name(polydata.GetCellData()), **by_name(polydata.GetFieldData())},
        turning=tuple(array.GetName() for array in turning if array is not None),
    )


def decode(data: bytes) -> Content:
    """Read the bytes of a `.vtp`.

    Raises
    ------
    ValueError
        Where VTK cannot read them, complains, or does not survive them.
    """
    global _child
    if not re.fullmatch(r"(python[\d.]*|pythonslicer|pythonw?-real)(\.exe)?", _host()):
        return _read(data)  # ParaView and the like: started again, they would open a window
    with _lock:
        if _child is None:
            _child = _Child()
            # In a copy of the process (`ahead`), nothing that is registered with atexit runs.
            Finalize(None, _close, exitpriority=1)
        try:
            return _child.decode(data)
        except _ChildDied as error:
            _close()
            raise ValueError(str(error)) from None


def _host() -> str:
    return Path(sys.executable or "").name.lower()


class _ChildDied(Exception):
    """The child is of no more use."""


class _Child:
    """A reader process, and the folder through which files pass."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="stereosom-"))
        # -P: the modules beside this file must not shadow anything.
        self.process = subprocess.Popen(
            [sys.executable, "-P", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def decode(self, data: bytes) -> Content:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        source = self.folder / "file.vtp"
        source.write_bytes(data)
        watchdog = threading.Timer(SECONDS_A_FILE, self.process.kill)
        watchdog.start()
        try:
            self.process.stdin.write(f"{source}\n")
            self.process.stdin.flush()
            answer = self.process.stdout.readline().strip()
        except OSError:
            answer = ""
        finally:
            watchdog.cancel()
        if answer == "done":
            return _unpacked(source.with_suffix(".npz"))
        if answer:
            raise ValueError(answer)
        raise _ChildDied("is broken in a way that ended VTK's reader")

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()
        shutil.rmtree(self.folder, ignore_errors=True)


_child: _Child | None = None
_lock = threading.Lock()


@atexit.register
def _close() -> None:
    global _child
    if _child is not None:
        _child.close()
        _child = None


def _forget() -> None:
    """In a copy of the process: the reader belongs to the other."""
    global _child, _lock
    _child, _lock = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def _pack(content: Content, path: Path) -> None:
    """Write content as an `.npz`: arrays by number, and a text that says which is which."""
    numbered: list[Array] = [content.points, content.connectivity, content.offsets]

    def number(values: Any) -> Any:
        if isinstance(values, tuple):
            return list(values)
        numbered.append(values)
        return len(numbered) - 1

    layout = {
        "cells": content.cells,
        "lines": content.lines,
        "turning": content.turning,
        "point_data": {name: number(values) for name, values in content.point_data.items()},
        "described": {name: number(values) for name, values in content.described.items()},
    }
    arrays = {str(i): array for i, array in enumerate(numbered)}
    np.savez(path, layout=np.array(json.dumps(layout)), **arrays)  # type: ignore[arg-type]


def _unpacked(path: Path) -> Content:
    with np.load(path, allow_pickle=False) as packed:
        layout = json.loads(str(packed["layout"]))

        def values(what: Any) -> Any:
            return tuple(what) if isinstance(what, list) else packed[str(what)]

        return Content(
            points=packed["0"],
            connectivity=packed["1"],
            offsets=packed["2"],
            cells=layout["cells"],
            lines=layout["lines"],
            point_data={name: values(what) for name, what in layout["point_data"].items()},
            described={name: values(what) for name, what in layout["described"].items()},
            turning=tuple(layout["turning"]),
        )


def _read(data: bytes) -> Content:
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    reader = vtkXMLPolyDataReader()
    reader.ReadFromInputStringOn()
    reader.SetInputString(data, len(data))  # type: ignore[call-overload]  # raw: zero bytes
    with vtk_messages() as messages:
        reader.Update()
    if messages:
        raise ValueError(messages[0])
    return content_of(reader.GetOutput())


@contextmanager
def vtk_messages() -> Iterator[list[str]]:
    """Collect VTK's warnings and errors, a line each, instead of printing them."""
    from vtkmodules import vtkCommonCore as vtk_core

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


def _serve() -> None:
    """Child: a path a line comes in, the arrays go beside it, a line goes out."""
    # What VTK prints must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (BYTES_OF_CHILD, BYTES_OF_CHILD))
        resource.setrlimit(resource.RLIMIT_FSIZE, (BYTES_OF_ANSWER, BYTES_OF_ANSWER))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, ValueError, OSError):  # no such limits on this system
        pass
    for line in sys.stdin:
        source = Path(line.rstrip("\n"))
        try:
            _pack(_read(source.read_bytes()), source.with_suffix(".npz"))
            answers.write("done\n")
        except (Exception, MemoryError) as error:
            text = " ".join(str(error).split())[:300]
            answers.write(f"{text or type(error).__name__}\n")


if __name__ == "__main__":
    _serve()
