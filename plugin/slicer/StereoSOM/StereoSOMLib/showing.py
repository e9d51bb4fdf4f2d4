"""How results are shown: the curve in 3D, each projection over its own picture."""

from __future__ import annotations

from typing import Any

from .results import Results

# View a goes to the red slice view, view b to the yellow one.
SLICE_VIEWS = ("Red", "Yellow")
COLORS = ((1.0, 0.75, 0.1), (0.2, 0.8, 1.0))
_COLOR_TABLE = "vtkMRMLColorTableNodeFileViridis.txt"


def show(scene: Any, results: Results) -> None:
    """Put pictures and projections into the slice views, and the curve into the 3D view.

    Each model is shown in its own view only: pictures lie where Slicer put them, which is not
    where the X-rays met the patient, and the curve would cross them at a meaningless place.
    """
    curve, *projections = results.models
    if curve is None:
        return
    _show_curve(scene, curve)
    for number, model in enumerate(projections):
        _show_projection(scene, model, results.shown[number], number)


def _show_curve(scene: Any, model: Any) -> None:
    display = _display(model)
    display.SetLineWidth(5)
    display.SetLighting(False)  # a line's normals are no surface's
    display.SetVisibility2D(False)
    display.SetActiveScalarName("Curvature")
    display.SetScalarVisibility(True)
    if scene.GetNodeByID(_COLOR_TABLE):
        display.SetAndObserveColorNodeID(_COLOR_TABLE)


def _show_projection(scene: Any, model: Any, volume: Any, number: int) -> None:
    tag = SLICE_VIEWS[number]
    display = _display(model)
    display.SetScalarVisibility(False)
    display.SetColor(*COLORS[number])
    display.SetVisibility2D(True)
    display.SetVisibility3D(False)
    display.SetSliceDisplayModeToProjection()
    display.SetSliceIntersectionThickness(2)
    view = scene.GetSingletonNode(tag, "vtkMRMLSliceNode")
    layers = scene.GetSingletonNode(tag, "vtkMRMLSliceCompositeNode")
    if view is not None:
        display.SetViewNodeIDs([view.GetID()])
        if volume is not None:
            view.RotateToVolumePlane(volume)
    if layers is not None and volume is not None:
        layers.SetBackgroundVolumeID(volume.GetID())


def _display(model: Any) -> Any:
    if model.GetDisplayNode() is None:
        model.CreateDefaultDisplayNodes()
    return model.GetDisplayNode()
