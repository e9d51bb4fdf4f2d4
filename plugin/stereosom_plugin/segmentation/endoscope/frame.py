"""A checked picture in color or gray, as light from 0 to 1."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom_plugin.errors import InputError

Light = npt.NDArray[np.float32]


def light(image: Any, name: str = "picture") -> Light:
    """Return a picture as light, (rows, columns, channels), 0 to 1.

    Parameters
    ----------
    image : (rows, columns) or (rows, columns, 1, 3 or 4) array
        Gray, or red, green, blue; of a fourth channel (opacity) nothing is taken. Whole numbers
        count up to the most that their type holds; others from 0 to 1.
    name : str
        What a message calls it.

    Returns
    -------
    (rows, columns, 1 or 3) array of float32

    Raises
    ------
    InputError
        Where it is no picture.

    Examples
    --------
    >>> light(np.full((2, 2), 51, dtype=np.uint8))[0, 0].round(3).tolist()
    [0.20000000298023224]
    """
    array = np.asarray(image)
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3 or array.size == 0 or array.shape[2] not in (1, 3, 4):
        shape = "×".join(map(str, np.shape(image))) or "a single number"
        raise InputError(name, f"is {shape}, not rows × columns × colors", "give one picture")
    if array.dtype.kind not in "biuf":
        raise InputError(name, "does not hold numbers", "give one picture")
    array = array[:, :, :3]
    most = float(np.iinfo(array.dtype).max) if array.dtype.kind in "iu" else 1.0
    picture: Light = array.astype(np.float32) / np.float32(most)
    if not np.isfinite(picture).all():
        raise InputError(name, "holds values that are not finite", "give every pixel a value")
    return picture


def over_colors(function: np.ufunc, picture: Light) -> Light:
    """Least or largest color of each pixel, (rows, columns): color by color, a tenth of the time.

    Examples
    --------
    >>> over_colors(np.minimum, np.array([[[0.5, 0.25, 0.75]]], dtype=np.float32)).tolist()
    [[0.25]]
    """
    found = picture[..., 0].copy()
    for channel in range(1, picture.shape[-1]):
        function(found, picture[..., channel], out=found)
    return found


def as_bytes(image: Any) -> npt.NDArray[np.uint8]:
    """Return a picture as bytes, (rows, columns, 1 or 3), in one piece; no copy where it is that.

    Raises
    ------
    InputError
        Where it is no picture.
    """
    array = np.asarray(image)
    if array.dtype == np.uint8 and array.ndim == 3 and array.shape[2] in (1, 3) and array.size:
        return np.ascontiguousarray(array)
    return np.rint(light(image) * 255).astype(np.uint8)
