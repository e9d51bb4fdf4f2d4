"""What a run leaves in the scene: the curve over time, its projections, a table, one browser.

Slicer's space is RAS; the core's is LPS. `to_ras` is the one place where they meet.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkIntArray, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersGeneral import vtkTransformPolyDataFilter

from stereosom.reconstruction import Reconstruction
from stereosom_plugin.polydata import to_polydata
from stereosom_plugin.vtp_writer import make_polydata

from .views import Source

COLUMNS = (
    ("frame", vtkIntArray), ("time_s", vtkDoubleArray), ("status", vtkStringArray),
    ("length_mm", vtkDoubleArray), ("tip_r_mm", vtkDoubleArray), ("tip_a_mm", vtkDoubleArray),
    ("tip_s_mm", vtkDoubleArray), ("sigma_mm", vtkDoubleArray), ("residual_a_px", vtkDoubleArray),
    ("residual_b_px", vtkDoubleArray), ("reason", vtkStringArray),
)  # fmt: skip
_TO_RAS = np.array([-1.0, -1.0, 1.0])
_ALONG = ("ArcLength", "StandardDeviation", "Determined")


def to_ras(result: Reconstruction, samples: int = 200) -> vtkPolyData:
    """The centerline in RAS, as Slicer holds what it reads from our `.vtp`.

    Points, active vectors and active normals are turned. `Covariance` stays in LPS, as Slicer
    leaves it.
    """
    turn = vtkTransformPolyDataFilter()
    transform = vtkTransform()
    transform.Scale(*_TO_RAS)
    turn.SetTransform(transform)
    turn.SetInputData(to_polydata(result, samples=samples))
    turn.Update()
    turned: vtkPolyData = turn.GetOutput()
    turned.GetFieldData().RemoveArray("SPACE")  # it speaks of a file
    return turned


def projected(source: Source, number: int, result: Reconstruction, samples: int) -> vtkPolyData:
    """The centerline as one view (0 or 1) shows it, a line in the plane of its picture, RAS."""
    view, letter = source.views[number], "ab"[number]
    rig = source.acquisition.rig(result.index)
    backbone = result.backbone
    assert backbone is not None
    s = backbone.arc_lengths(samples)
    pixels = source.acquisition.seen(letter, (rig.a, rig.b)[number].project(backbone(s)))  # type: ignore[arg-type]
    volume, slice_number = view.place(source.frames[number][result.index])
    to_world = _ijk_to_ras(volume)
    seen = np.isfinite(pixels).all(axis=1)
    if seen.sum() < 2:
        return vtkPolyData()
    ijk = np.column_stack([pixels[seen], np.full(seen.sum(), float(slice_number))])
    points = ijk @ to_world[:3, :3].T + to_world[:3, 3]
    along = {
        "ArcLength": s,
        "StandardDeviation": result.standard_deviation_at(s),
        "Determined": result.determined_at(s),
    }
    line = make_polydata(points, {name: along[name][seen] for name in _ALONG}, {})
    line.GetPointData().SetActiveScalars("StandardDeviation")
    return line


def _ijk_to_ras(volume: Any) -> Any:
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    matrix = vtkMatrix4x4()
    volume.GetIJKToRASMatrix(matrix)
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


class Results:
    """The nodes of one run, filled frame by frame.

    Attributes
    ----------
    curve : vtkMRMLSequenceNode
        Models, with the arrays of a `.vtp`.
    projections : list of vtkMRMLSequenceNode
        Models: the curve in the picture's plane of view a, and of view b.
    table : vtkMRMLTableNode
        A row a frame: `COLUMNS`.
    browser : vtkMRMLSequenceBrowserNode
        Scrubs all of it, and the pictures, together.
    kept : list of Reconstruction
        What has come so far.
    """

    def __init__(self, scene: Any, source: Source, samples: int, name: str = "StereoSOM") -> None:
        self.scene, self.source, self.samples = scene, source, samples
        self.kept: list[Reconstruction] = []
        name = scene.GenerateUniqueName(name)
        index = _Index.of(source)
        self._values = index.values
        titles = (name, f"{name} in view a", f"{name} in view b")
        self.curve, *self.projections = (index.sequence(scene, title) for title in titles)
        self.table = scene.AddNewNodeByClass("vtkMRMLTableNode", f"{name} table")
        self.table.SetUseColumnTitleAsColumnHeader(True)
        for title, kind in COLUMNS:
            column = kind()
            column.SetName(title)
            self.table.AddColumn(column)
        self.browser = scene.AddNewNodeByClass("vtkMRMLSequenceBrowserNode", f"{name} browser")
        if len(source.acquisition) > 1:
            span = source.acquisition.times[-1] - source.acquisition.times[0]
            if span > 0:
                self.browser.SetPlaybackRateFps((len(source.acquisition) - 1) / float(span))
        self.browser.SetAndObserveMasterSequenceNodeID(self.curve.GetID())  # first: it drops others
        self.shown = [self._synchronize(number, index) for number in (0, 1)]

    def add(self, result: Reconstruction) -> None:
        """Put one frame into the scene; a frame without a curve shows nothing at its time."""
        parts = [vtkPolyData()] * 3
        if result.ok:
            parts = [to_ras(result, self.samples)]
            parts += [projected(self.source, n, result, self.samples) for n in (0, 1)]
        model = self.scene.CreateNodeByClass("vtkMRMLModelNode")
        model.UnRegister(None)  # the scene made it for us alone
        value = self._values[result.index]
        for sequence, part in zip((self.curve, *self.projections), parts, strict=True):
            model.SetName(sequence.GetName())
            model.SetAndObservePolyData(part)
            sequence.SetDataNodeAtValue(model, value)
        self._add_row(result)
        self.kept.append(result)
        if len(self.kept) == 1:  # models are made for what is there
            for sequence in self.projections:
                self.browser.AddSynchronizedSequenceNode(sequence)
        self.browser.SetSelectedItemNumber(self.curve.GetNumberOfDataNodes() - 1)

    @property
    def models(self) -> list[Any]:
        """The models that show the chosen time: the curve, and its projections a and b."""
        return [self.browser.GetProxyNode(s) for s in (self.curve, *self.projections)]

    def result_shown(self) -> Reconstruction:
        """Return the frame that the browser stands at."""
        return self.kept[max(0, int(self.browser.GetSelectedItemNumber()))]

    def _add_row(self, result: Reconstruction) -> None:
        nan = float("nan")
        row: list[Any] = [result.index, result.time, result.status, *[nan] * 7, result.reason]
        if result.backbone is not None and result.residuals is not None:
            backbone = result.backbone
            sigma = result.standard_deviation_at([backbone.length])[0]
            row[3:10] = [backbone.length, *(backbone.tip * _TO_RAS), sigma, *result.residuals]
        table = self.table.GetTable()
        for number, value in enumerate(row):
            table.GetColumn(number).InsertNextValue(value)
        table.Modified()
        self.table.Modified()

    def _synchronize(self, number: int, index: _Index) -> Any:
        """Let the browser drive the pictures of a view; returns the volume that shows them."""
        view = self.source.views[number]
        if view.sequence is None:
            return view.shown
        frames = self.source.frames[number]
        own = [view.sequence.GetNthIndexValue(frame) for frame in frames]
        if own == index.values and view.shown is not None:
            self.browser.AddProxyNode(view.shown, view.sequence, False)
            return view.shown
        # Its frames pair with those of the other view by other numbers or times than its own.
        title = f"{view.sequence.GetName()} paired"
        paired = view.sequence if own == index.values else index.sequence(self.scene, title)
        if paired is not view.sequence:
            for value, frame in zip(index.values, frames, strict=True):
                paired.SetDataNodeAtValue(view.item(frame), value)
        self.browser.AddSynchronizedSequenceNode(paired)
        return self.browser.GetProxyNode(paired)


class _Index:
    """The times by which all sequences of a run are found: those of view a's, where it has any."""

    def __init__(self, name: str, unit: str, values: list[str]) -> None:
        self.name, self.unit, self.values = name, unit, values

    @classmethod
    def of(cls, source: Source) -> _Index:
        sequence, frames = source.views[0].sequence, source.frames[0]
        if sequence is not None:
            values = [sequence.GetNthIndexValue(frame) for frame in frames]
            if len(set(values)) == len(values):
                return cls(sequence.GetIndexName(), sequence.GetIndexUnit(), values)
        values = [f"{time:.6g}" for time in source.acquisition.times]
        if len(set(values)) == len(values):
            return cls("time", "s", values)
        return cls("frame", "", [str(frame) for frame in range(len(values))])

    def sequence(self, scene: Any, name: str) -> Any:
        node = scene.AddNewNodeByClass("vtkMRMLSequenceNode", name)
        node.SetIndexName(self.name)
        node.SetIndexUnit(self.unit)
        try:  # Slicer tells times apart by this tolerance
            gaps = [float(b) - float(a) for a, b in pairwise(self.values)]
            node.SetNumericIndexValueTolerance(min([1e-3, *(g / 10 for g in gaps if g > 0)]))
        except ValueError:
            node.SetIndexType(node.TextIndex)
        return node
