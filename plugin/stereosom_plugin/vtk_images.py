"""Pictures as VTK holds them (rows from the bottom), and as arrays (rows from the top)."""

from __future__ import annotations

from typing import Any

import numpy as np

from .errors import InputError, require

vtk_data = require("vtkmodules.vtkCommonDataModel", "vtk")
numpy_support = require("vtkmodules.util.numpy_support", "vtk")


def picture_of(
    image: Any, view: str, *, top_down: bool = False, slice_number: int | None = None
) -> Any:
    """Gray values of `vtkImageData`, (rows, columns), the top row first.

    Parameters
    ----------
    image : vtkImageData
        Of one slice.
    view : str
        Its name in messages.
    top_down : bool
        Whether its first row is the top; VTK's readers of pictures begin at the bottom.
    slice_number : int, optional
        Which slice of a volume is the picture, from zero.

    Raises
    ------
    InputError
        Where it is empty, a volume, or has no point scalars.
    """
    columns, rows, slices = image.GetDimensions() if image is not None else (0, 0, 0)
    if columns * rows * slices == 0:
        raise InputError(f"view {view}", "holds no picture", "give image data that is not empty")
    if slices != 1 and slice_number is None:
        raise InputError(
            f"view {view}",
            f"is a volume of {slices} slices",
            "give one picture at a time (vtkExtractVOI, or a time series)",
        )
    scalars = image.GetPointData().GetScalars()
    if scalars is None:
        raise InputError(
            f"view {view}", "has no point scalars", "give a picture with active point scalars"
        )
    values = numpy_support.vtk_to_numpy(scalars)
    if values.ndim == 2:  # color, with or without opacity: gray is the mean of what is seen
        values = values[:, : 3 if values.shape[1] > 2 else 1].mean(axis=1)
    picture = values.reshape(slices, rows, columns)[slice_number or 0]
    return picture if top_down else picture[::-1]


def to_image(picture: Any) -> Any:
    """Make `vtkImageData` of an array (rows, columns), top row first, as VTK's readers do."""
    picture = np.asarray(picture)
    kept = picture.astype(np.uint8) * 255 if picture.dtype == bool else picture
    image = vtk_data.vtkImageData()
    image.SetDimensions(kept.shape[1], kept.shape[0], 1)
    array = numpy_support.numpy_to_vtk(np.ascontiguousarray(kept[::-1]).ravel(), deep=True)
    image.GetPointData().SetScalars(array)
    return image
