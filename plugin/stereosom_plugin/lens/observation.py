"""An observation of ideal cameras from masks of cameras with lenses."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import StereoRig
from stereosom.observation import Observation, picture_border

from .field import undistorted_field
from .mask import undistorted_mask_pixels
from .model import Lens

# Pixels farther inside than this do not meet the border of a picture.
_RIM_PX = 2


def undistorted_observation(
    masks: tuple[Any, Any], lenses: tuple[Lens, Lens], rig: StereoRig, **described: Any
) -> Observation:
    """As `Observation.from_masks`, free of lens distortion: the pixels, and where views end.

    Parameters
    ----------
    masks : pair of (rows, columns) arrays of bool
        The device in the seen pictures.
    lenses : pair of Lens
    rig : StereoRig
    **described
        As in `Observation.from_masks`; the field of view in seen pixels.

    Returns
    -------
    Observation
        Without pixels and with a `defect` where the device reaches beyond a lens model.

    Raises
    ------
    ValueError
        Where a mask has another size than its camera's picture.
    """
    cameras = (rig.a, rig.b)
    sizes = [tuple(np.shape(mask))[::-1] for mask in masks]
    if sizes != [tuple(camera.image_size) for camera in cameras]:
        return Observation.from_masks(*masks, rig, **described)  # which refuses them
    fields = described.pop("field_of_view", None) or (None, None)
    nothing = np.empty((0, 2))
    try:
        pixels = [undistorted_mask_pixels(*pair) for pair in zip(masks, lenses, strict=True)]
    except ValueError as error:
        described |= {"field_of_view": None if fields[0] is None else fields, "defect": str(error)}
        return Observation(nothing, nothing, rig, **described)
    ideal = tuple(
        undistorted_field(picture_border(camera), lens, _on_rim(mask))
        if field is None
        else undistorted_field(field, lens, np.argwhere(mask)[:, ::-1])
        for camera, field, lens, mask in zip(cameras, fields, lenses, masks, strict=True)
    )
    return Observation(pixels[0], pixels[1], rig, field_of_view=(ideal[0], ideal[1]), **described)


def _on_rim(mask: Any) -> Floats:
    """Pixels (x, y) of a mask along the border of its picture, (n, 2): few, and soon found."""
    rows, columns = np.shape(mask)
    strips = (
        (0, 0, mask[:_RIM_PX]),
        (rows - _RIM_PX, 0, mask[-_RIM_PX:]),
        (_RIM_PX, 0, mask[_RIM_PX:-_RIM_PX, :_RIM_PX]),
        (_RIM_PX, columns - _RIM_PX, mask[_RIM_PX:-_RIM_PX, -_RIM_PX:]),
    )
    found = [np.argwhere(strip)[:, ::-1] + (left, top) for top, left, strip in strips]
    return np.concatenate(found).astype(np.float64)
