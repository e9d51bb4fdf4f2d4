"""The picture along a line, and across it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom.arrays import Floats, Integers

Gray = npt.NDArray[np.float32]


def light_across(
    picture: Gray, line: Floats, normals: Floats, across: Floats, least: float
) -> Gray:
    """Light, (n, m), at m places across each of n points of a line.

    Parameters
    ----------
    picture : (rows, columns) array
        The light; taken between pixels by straight lines, and beyond the border as there.
    line, normals : (n, 2) array
        Points, px, and the directions across.
    across : (m,) array
        Places, px.
    least : float
        At which the light is held.
    """
    place = line[:, None] + across[:, None] * normals[:, None]
    light = ndimage.map_coordinates(
        picture, [place[..., 1], place[..., 0]], order=1, mode="nearest", output=np.float32
    )
    return np.asarray(np.maximum(light, np.float32(least)))


def medians(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Median of each row (n,) of finite numbers (n, m): numpy's looks for others first."""
    count = values.shape[1]
    low, high = (count - 1) // 2, count // 2
    parted = np.partition(values, [low, high], axis=1)
    return np.asarray((parted[:, low] + parted[:, high]) / 2)


def middles(values: Floats, size: int) -> Floats:
    """Median (n,) of an odd number of values about each; beyond the ends, all are as there."""
    return np.asarray(ndimage.median_filter(values, size, mode="nearest"))


def best_way(score: npt.NDArray[Any], price: Floats) -> Integers:
    """As `way.best_way`."""
    count, wide = score.shape
    most = len(price) // 2
    came = np.empty((count, wide), dtype=np.intp)
    total = score[0].astype(float)
    padded = np.full(wide + 2 * most, -np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, wide)  # a row per turn
    priced = price[:, None]
    places = np.arange(wide)
    for row in range(1, count):
        padded[most : most + wide] = total
        reached = windows - priced
        best = came[row] = reached.argmax(axis=0)
        total = reached[best, places] + score[row]
    came += places - most
    way = np.empty(count, dtype=np.intp)
    way[-1] = int(total.argmax())
    for row in range(count - 1, 0, -1):
        way[row - 1] = came[row, way[row]]
    return way


def blurred(values: Floats, weights: Floats) -> Floats:
    """Weighted mean down each column of (n, m) values; beyond the ends they are mirrored."""
    return np.asarray(ndimage.correlate1d(values, weights, 0))


def absorbed(log: Gray, across: Floats, beyond: int, weights: Floats) -> Floats:
    """What a device absorbs, (n, m), of the logarithm of the light across it.

    What lies behind is drawn straight from one side of the device to the other: between medians
    of the outermost places, smooth along the line.

    Parameters
    ----------
    log : (n, m) array
    across : (m,) array
        Places, px.
    beyond : int
        How many of them are beside the device, on either side.
    weights : (2 k + 1,) array
        Of the blur along the line.
    """
    sides = []
    for beside in (log[:, :beyond], log[:, log.shape[1] - beyond :]):
        level = ndimage.median_filter(medians(beside).astype(float), 5)
        sides.append(ndimage.correlate1d(level, weights))
    middle = -(across[0] + across[beyond - 1]) / 2
    share = (across + middle) / (2 * middle)
    return np.asarray(sides[0][:, None] * (1 - share) + sides[1][:, None] * share - log)


def normals(line: Floats) -> Floats:
    """Directions of length one (n, 2) across a line, to the right of its way in the picture."""
    ahead = np.empty_like(line)
    ahead[1:-1], ahead[0], ahead[-1] = line[2:] - line[:-2], line[1] - line[0], line[-1] - line[-2]
    length = np.maximum(np.hypot(*ahead.T), 1e-9)
    return np.asarray(np.column_stack([-ahead[:, 1], ahead[:, 0]]) / length[:, None])


def evenly(line: Floats, spacing: float) -> Floats:
    """A line (n, 2) at even steps of about a spacing, from its first point to its last."""
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    at = np.linspace(0, way[-1], max(2, round(way[-1] / spacing) + 1))
    return np.column_stack([np.interp(at, way, line[:, axis]) for axis in (0, 1)])
