"""The paper's own image processing (Section III-A): blur, Laplacian, threshold."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import convolve

_GAUSSIAN = np.outer([1, 2, 1], [1, 2, 1]) / 16
_LAPLACIAN = np.array([[0, 1, 0], [1, -4, 1], [0, 1, 0]])


def edge_mask(image: npt.NDArray[np.uint8], threshold: float) -> npt.NDArray[np.bool_]:
    """Pixels along the edges of something dark before a light background.

    "First, we convolved our original images with a 3×3 symmetric Gaussian kernel […]. Next, we
    enhanced edges via convolution with a 3×3, 2-dimensional Laplacian. Finally, we thresholded
    the resulting image." Taken are values above the threshold: in an 8-bit image, as there,
    the negative side of each edge (the background's) is cut off at zero.

    Parameters
    ----------
    image : (rows, columns) array of uint8
    threshold : float
        Gray levels, "adjusted appropriately to account for lighting".

    Returns
    -------
    (rows, columns) array of bool

    Examples
    --------
    >>> step = np.full((5, 8), 200, dtype=np.uint8)
    >>> step[:, :4] = 100  # dark on the left: its last columns are the edge
    >>> np.flatnonzero(edge_mask(step, 12)[2])
    array([2, 3])
    """
    smooth = convolve(image.astype(float), _GAUSSIAN, mode="nearest")
    return np.asarray(convolve(smooth, _LAPLACIAN, mode="nearest") > threshold)
