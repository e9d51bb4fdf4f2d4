"""An example that needs no files: a quarter circle of 60 mm radius, drawn in two views."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData

from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin.calibration import write_rig


def quarter_circle(scene: Any, rig_file: str | Path) -> tuple[Any, Any]:
    """Two volumes of masks; writes the rig that they were drawn with."""
    rig, curve = converging_rig(60), arc(60, 90)
    write_rig([rig], rig_file)
    masks = (silhouette(curve, 1.0, camera) for camera in (rig.a, rig.b))
    a, b = (volume(scene, mask, f"view {name}") for mask, name in zip(masks, "ab", strict=True))
    return a, b


def volume(scene: Any, picture: Any, name: str) -> Any:
    """Make a volume of a picture, (rows, columns), upright in an axial slice view."""
    node = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", name)
    node.SetAndObserveImageData(image_data(picture))
    node.SetIJKToRASDirections(-1, 0, 0, 0, -1, 0, 0, 0, 1)
    node.CreateDefaultDisplayNodes()
    return node


def image_data(picture: Any) -> vtkImageData:
    """Pixels as Slicer holds them: the top row first."""
    pixels = np.asarray(picture)
    pixels = np.ascontiguousarray(pixels.astype(np.uint8) if pixels.dtype == bool else pixels)
    image = vtkImageData()
    image.SetDimensions(pixels.shape[1], pixels.shape[0], 1)
    image.GetPointData().SetScalars(numpy_to_vtk(pixels.ravel(), deep=True))
    return image
