"""The outlines of a mask, to be drawn over its picture."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom_plugin.errors import require


def outline(mask: Any) -> list[Floats]:
    """Closed lines between the pixels of a mask and the others.

    Parameters
    ----------
    mask : (rows, columns) array of bool

    Returns
    -------
    list of (n, 2) array
        Points (x, y), px; the first is the last. Holes have outlines of their own.

    Examples
    --------
    One pixel is surrounded by a diamond:

    >>> mask = np.zeros((5, 5), dtype=bool)
    >>> mask[2, 3] = True
    >>> [line.tolist() for line in outline(mask)]
    [[[3.0, 2.5], [2.5, 2.0], [3.0, 1.5], [3.5, 2.0], [3.0, 2.5]]]
    """
    mask = np.asarray(mask, dtype=bool)
    row, column = np.nonzero(mask)
    if len(row) == 0:
        return []
    low = np.array([row.min(), column.min()])
    window = np.pad(mask[row.min() : row.max() + 1, column.min() : column.max() + 1], 1)
    lines = require("skimage.measure", "fluoroscopy").find_contours(window.astype(float), 0.5)
    return [(line + low - 1)[:, ::-1] for line in lines]
