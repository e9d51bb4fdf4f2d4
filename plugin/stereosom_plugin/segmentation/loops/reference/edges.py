"""The edges of a device along its straightened picture, and the mask between them."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import ndimage

from stereosom.arrays import Booleans, Floats, Integers


def weighted(values: Floats, weights: Floats, bell: Floats, more: float) -> Floats:
    """A weighted mean along the first axis, as wide as a bell; `more` of the weight at zero.

    Beyond the ends, values go on as their mirror turned about the end: a line is neither
    shortened nor turned.

    Parameters
    ----------
    values : (n, m) array
    weights : (n, 1) or (n, m) array
    bell : (2 k + 1,) array
    more : float
    """
    margin = min(len(bell) // 2 + 1, len(values) - 1)
    before, after = slice(margin, 0, -1), slice(-2, -2 - margin, -1)
    weight = np.vstack([weights[before], weights, weights[after]])
    flat = np.vstack([2 * values[0] - values[before], values, 2 * values[-1] - values[after]])
    both = np.hstack([flat * weight, weight])
    over = ndimage.correlate1d(both, bell, axis=0)[margin : len(flat) - margin]
    return np.asarray(over[:, : values.shape[1]] / (over[:, values.shape[1] :] + more))


def most_gain(gain: Any, first: Integers, reach: int) -> Integers:
    """How many columns to the left and right of `first` hold most of the gain, (2, n).

    Parameters
    ----------
    gain : (n, m) array
        Five rows are taken together; beyond the first and last column it goes on as there.
    first : (n,) array
        The column of each row from which on it is summed up, the next one first.
    reach : int
        So many columns are looked at.
    """
    smooth = ndimage.uniform_filter1d(gain, 5, axis=0)
    away = np.arange(1, reach + 1)
    found = []
    for side in (-1, 1):
        column = np.clip(first[:, None] + side * away, 0, gain.shape[1] - 1)
        total = np.cumsum(np.take_along_axis(smooth, column, axis=1), axis=1)
        found.append(away[total.argmax(axis=1)])
    return np.stack(found)


def half_way(profile: Any, step: float, least_hue: float) -> tuple[Floats, Floats, bool]:
    """Where colors have gone half the way from inside to outside, (n,) px, and how far they go.

    The area under the rise tells it: less noisy than where it crosses. Five rows are taken
    together. A round body darkens towards its edges, and less where it is lit from there: where
    what is behind has another hue, only the way across the body's own color is looked at, in
    which its shades are all alike.

    Parameters
    ----------
    profile : (n, 21, channels) array of float32
        Colors across an edge, from inside to outside, at a step of so many px.
    step : float
    least_hue : float
        Share of the squared way that is one of hue, where it is looked at.

    Returns
    -------
    shift, far : (n,) array
    hue : bool
        Whether it was.
    """
    mean = ndimage.uniform_filter1d(profile, 5, axis=0)
    inner, outer = mean[:, 1:7].mean(axis=1), mean[:, 14:20].mean(axis=1)
    way = outer - inner
    brightness = (inner**2).sum(axis=1, keepdims=True)
    far = np.sqrt((way**2).sum(axis=1))
    hue = way - (way * inner).sum(axis=1, keepdims=True) / np.maximum(brightness, 1e-6) * inner
    of_hue = bool((hue**2).sum() > least_hue * (way**2).sum())
    if of_hue:
        way = hue
    square = (way**2).sum(axis=1)
    share = np.einsum("rck,rk->rc", mean - inner[:, None], way)
    share /= np.maximum(square, 1e-6)[:, None]
    shift = (10.5 - np.clip(share, 0, 1).sum(axis=1)) * step
    return shift.astype(float), far.astype(float), of_hue


def held(
    total: Floats, ends: Floats, reaches: Floats, short: Floats, begin: float, step: float
) -> Floats:
    """What lies before each of some ends, (ends, kinds), in all columns.

    Parameters
    ----------
    total : (n, m) array
        What lies in each of m columns before places from `begin` on, at a step.
    ends : (k,) array
        Where an end reaches farthest.
    reaches, short : (kinds,), (m,) array
        An end of a kind falls short of that by the product of both.
    begin, step : float
    """
    at = ends[:, None, None] - reaches[:, None] * short
    place = begin + step * np.arange(len(total))
    before = np.zeros(at.shape[:2])
    for column in range(total.shape[1]):
        before += np.interp(at[..., column], place, total[:, column])
    return before


def fill(drawn: Booleans, outline: Floats) -> None:
    """Draw the pixels whose centers a polygon, (n, 2), winds about."""
    start, end = outline, np.roll(outline, -1, axis=0)
    upper, lower = np.minimum(start, end)[:, 1], np.maximum(start, end)[:, 1]
    # The lines of pixels that each side crosses, and where.
    first = np.clip(np.ceil(upper).astype(int), 0, len(drawn))
    count = np.clip(np.ceil(lower).astype(int), first, len(drawn)) - first
    side = np.repeat(np.arange(len(outline)), count)
    row = np.arange(len(side)) - np.repeat(np.cumsum(count) - count - first, count)
    (x, y), (to_x, to_y) = start[side].T, end[side].T
    place = x + (row - y) * (to_x - x) / (to_y - y)
    order = np.lexsort((place, row))
    row, column = row[order], np.clip(np.ceil(place[order]).astype(int), 0, drawn.shape[1])
    turns = np.cumsum(np.where(to_y > y, 1, -1)[order])  # back at none at the end of each line
    for number in np.flatnonzero(turns):
        drawn[row[number], column[number] : column[number + 1]] = True
