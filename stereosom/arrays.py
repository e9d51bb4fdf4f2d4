"""Checked, read-only arrays: what every frozen type of the core is made of."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.intp]
Booleans = npt.NDArray[np.bool_]


def check_array(values: Any, name: str, shape: tuple[int | None, ...]) -> Floats:
    """Return `values` as a read-only, finite float array of the given shape.

    Parameters
    ----------
    values : array_like
        What the caller gave. It is copied, so that nobody can change it later.
    name : str
        How the caller knows it; it appears in the error.
    shape : tuple of int or None
        The shape that is wanted; None stands for any length.

    Returns
    -------
    ndarray of float, read-only

    Raises
    ------
    ValueError
        Where the shape is another one, or a value is not a finite number.

    Examples
    --------
    >>> check_array([[1, 2], [3, 4]], "corners", (None, 2)).shape
    (2, 2)
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: not an array of numbers ({error})") from None
    if array.size == 0 and shape[0] is None:  # an empty list knows no columns
        array = array.reshape(0, *(length or 0 for length in shape[1:]))
    fits = len(shape) == array.ndim and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = "×".join("n" if length is None else str(length) for length in shape)
        have = "×".join(str(length) for length in array.shape) or "a single number"
        raise ValueError(f"{name}: must be {wanted}, is {have}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: holds values that are not finite numbers")
    array.setflags(write=False)
    return array


def check_image_size(image_size: Any) -> tuple[int, int]:
    """Return the size as (width, height), two positive whole numbers, or raise ValueError."""
    try:
        width, height = (int(length) for length in image_size)
        whole = (width, height) == tuple(image_size)
    except (TypeError, ValueError):
        raise ValueError(f"image size: {image_size!r} is not (width, height)") from None
    if not whole or width < 1 or height < 1:
        raise ValueError(f"image size: {image_size!r} must be two positive whole numbers")
    return width, height
