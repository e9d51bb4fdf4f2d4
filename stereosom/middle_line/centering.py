"""The middle of a device to a fraction of a pixel, and how far it reaches."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from ..arrays import Floats
from .kernels import kernels

# Pixels farther beside a line than so many widths, or px, belong to something else.
_BESIDE, _BESIDE_PX = 0.9, 1.2
# The middle is taken over so many widths along the line (standard deviation).
ALONG = 1.5
# An end's heading is that of so many widths before it; pixels as far beyond may belong to it.
_HEADING = 2.0


def directions(line: Floats) -> Floats:
    """Unit tangents (n, 2) of a polyline (n, 2)."""
    step = np.gradient(line, axis=0)
    return np.asarray(step / np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-9))


def to_middle(line: Floats, pixels: Floats, width: float) -> Floats:
    """Move a line across itself to the middle of the pixels beside it.

    A skeleton is a chain of whole pixels, and half a pixel is much where the views stand
    close together. The mean of the pixels across a short stretch tells the middle far better.

    Parameters
    ----------
    line : (n, 2) array
        Within the device, at even steps, px.
    pixels : (m, 2) array
        Of the device.
    width : float
        px.

    Examples
    --------
    Rows 2 and 3 are filled; the middle lies between them:

    >>> x, y = np.meshgrid(np.arange(20.0), [2.0, 3.0])
    >>> filled = np.column_stack([x.ravel(), y.ravel()])
    >>> line = np.column_stack([np.arange(2.0, 18.0), np.full(16, 2.0)])
    >>> np.unique(to_middle(line, filled, 2.0)[:, 1].round(9))
    array([2.5])
    """
    tangents = directions(line)
    normals = np.column_stack([-tangents[:, 1], tangents[:, 0]])
    spacing = _spacing(line)
    nearest = np.asarray(cKDTree(line).query(pixels)[1])
    offset = pixels - line[nearest]
    across = np.sum(offset * normals[nearest], axis=1)
    along = np.sum(offset * tangents[nearest], axis=1)
    beside = np.abs(across) <= max(_BESIDE * width, _BESIDE_PX)
    beside &= np.abs(along) <= max(spacing, 1.0)
    sums = np.bincount(nearest[beside], across[beside], len(line))
    counts = np.bincount(nearest[beside], minlength=len(line))
    # Both at once: a mean over each stretch.
    sigma = max(ALONG * width / max(spacing, 1e-9), 0.5)
    both = np.stack([sums, counts]).astype(float)
    both = gaussian_filter1d(both, sigma, axis=1, mode="constant", truncate=3.0)
    return np.asarray(line + (both[0] / np.maximum(both[1], 1e-9))[:, None] * normals)


def to_ends(line: Floats, pixels: Floats, width: float) -> Floats:
    """Lengthen a line, straight on, to where the pixels of the device stop.

    Both views of an end must show the same place of it: where a device runs along an
    epipolar plane, its ends alone tell how far away they are.

    Parameters
    ----------
    line, pixels, width
        As of `to_middle`.
    """
    before = min(max(round(_HEADING * width / max(_spacing(line), 1e-9)), 3), len(line) - 1)
    reached = line[[0, -1]].copy()
    for end, inner in ((0, before), (-1, -1 - before)):
        heading = line[end] - line[inner]
        heading /= max(float(np.linalg.norm(heading)), 1e-9)
        beyond = kernels().straight_on(
            pixels, line[end], heading, 0.3 * width + 0.5, (-width, _HEADING * width)
        )
        if not np.isnan(beyond):
            reached[end] += (beyond + 0.5) * heading
    return np.vstack([reached[:1], line, reached[1:]])


def _spacing(line: Floats) -> float:
    """Mean step of a polyline, px."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).mean())
