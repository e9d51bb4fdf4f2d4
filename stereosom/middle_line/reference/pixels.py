"""Masks made small and clean, and how far their pixels go on beyond a line."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ...arrays import Booleans, Floats


def small_mask(pixels: Floats, wide: float) -> tuple[Booleans, float, float, int]:
    """A mask cut out, and made so small that the device is about `wide` px wide.

    Parameters
    ----------
    pixels : (n, 2) array
        Of a filled mask, in any order.
    wide : float

    Returns
    -------
    mask : (rows, columns) array of bool
        With a margin of a pixel or more.
    left, top : float
        Its corner, px of the picture.
    factor : int
        How many pixels of the picture one of the mask is wide.
    """
    left, top = np.floor(pixels.min(axis=0)) - 1
    column, row = np.rint(pixels - [left, top]).astype(int).T
    mask = np.zeros((row.max() + 2, column.max() + 2), dtype=bool)
    mask[row, column] = True
    edges = np.count_nonzero(mask[1:] != mask[:-1]) + np.count_nonzero(mask[:, 1:] != mask[:, :-1])
    # Steps along rows and columns are 4/π longer than the outline, on the mean over directions.
    width = 2 * len(pixels) / max(edges * np.pi / 4, 1.0)
    factor = max(1, int(width / wide))
    if factor > 1:
        rows, columns = (-(-length // factor) for length in mask.shape)
        block = row // factor * columns + column // factor
        filled = np.bincount(block, minlength=rows * columns).reshape(rows, columns)
        mask = np.pad(2 * filled > factor**2, 1)
        left, top = left - factor, top - factor
    return mask, left, top, factor


def without_small(mask: Booleans, filled: bool, share: float, limit: float) -> Booleans:
    """A mask whose small pieces, or holes, are turned over.

    Parameters
    ----------
    mask : (rows, columns) array of bool
    filled : bool
        Whether its pieces are meant, which may touch at their corners; or the holes.
    share, limit : float
        Small is less than that share of the largest one, and less than so many pixels.
    """
    label, _ = ndimage.label(mask == filled, np.ones((3, 3)) if filled else None)
    size = np.bincount(label.ravel())
    size[0] = 0
    small = size < min(share * size.max(), limit)
    small[0] = False
    return np.asarray(mask ^ small[label])


def straight_on(
    pixels: Floats, place: Floats, heading: Floats, beside: float, reach: tuple[float, float]
) -> float:
    """How far pixels go on beyond a place, straight on, px; NaN where there are none.

    Parameters
    ----------
    pixels : (n, 2) array
    place, heading : (2,) array
        The heading has length one.
    beside : float
        Pixels farther off the straight line, px, do not count.
    reach : (float, float)
        Nor do those that are no farther on than the first, or as far as the second, px.
    """
    offset = pixels - place
    beyond = offset @ heading
    near = np.abs(offset @ [-heading[1], heading[0]]) <= beside
    near &= (beyond > reach[0]) & (beyond < reach[1])
    return float(beyond[near].max()) if near.any() else np.nan
