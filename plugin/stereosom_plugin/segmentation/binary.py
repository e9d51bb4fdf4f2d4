"""Pictures that are masks already."""

from __future__ import annotations

from typing import Any

import numpy as np

from .picture import Mask, checked


def binary(image: Any) -> Mask:
    """Take the pixels above half of the picture's range; a constant picture has none.

    Parameters
    ----------
    image : (rows, columns) array
        A mask as a picture: device bright.

    Returns
    -------
    (rows, columns) array of bool

    Raises
    ------
    InputError
        Where the image has no two dimensions or holds values that are not finite.

    Examples
    --------
    >>> binary([[0, 255], [127, 128]])
    array([[False,  True],
           [False,  True]])
    """
    picture = checked(image).astype(np.float64)
    return np.asarray(picture > (picture.min() + picture.max()) / 2)
