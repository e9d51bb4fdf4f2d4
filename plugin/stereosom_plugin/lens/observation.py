"""An observation of ideal cameras from one of cameras with lenses."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from stereosom.observation import Observation

from .field import undistorted_field
from .mask import undistorted_mask_pixels
from .model import Lens


def undistorted_observation(
    seen: Observation, masks: tuple[Any, Any], lenses: tuple[Lens, Lens]
) -> Observation:
    """Free an observation of lens distortion: the device's pixels, and where the views end.

    Parameters
    ----------
    seen : Observation
        Its field of view in seen pixels.
    masks : pair of (rows, columns) arrays of bool
        The device in the seen pictures.
    lenses : pair of Lens

    Returns
    -------
    Observation
        Without pixels and with a `defect` where the device reaches beyond a lens model.
    """
    assert seen.field_of_view is not None  # filled in when made
    try:
        pixels = [undistorted_mask_pixels(*pair) for pair in zip(masks, lenses, strict=True)]
    except ValueError as error:
        nothing = np.empty((0, 2))
        return replace(seen, pixels_a=nothing, pixels_b=nothing, defect=str(error))
    shown = (seen.pixels_a, seen.pixels_b)
    field_a, field_b = (
        undistorted_field(*view) for view in zip(seen.field_of_view, lenses, shown, strict=True)
    )
    return replace(seen, pixels_a=pixels[0], pixels_b=pixels[1], field_of_view=(field_a, field_b))
