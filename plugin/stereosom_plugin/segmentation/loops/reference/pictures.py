"""What lines and tubes leave in a picture, and dark lines in one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom.arrays import Booleans, Floats, Integers

from .lines import Gray


def even(points: Floats, way: Floats, spacing: float) -> tuple[Floats, float]:
    """Points (m, 2) at the middles of equal steps, no longer than a spacing, and the step.

    Parameters
    ----------
    points : (n, 2) array
    way : (n,) array
        To each of them, not decreasing, from zero.
    spacing : float
    """
    count = max(16, int(np.ceil(way[-1] / spacing)))
    step = float(way[-1]) / count
    at = (np.arange(count) + 0.5) * step
    return np.column_stack([np.interp(at, way, points[:, i]) for i in (0, 1)]), step


def shadow(
    pixels: Floats, line: Floats, radius: float, pace: float, ends: bool, face: bool
) -> Floats:
    """Chord through a tube at each of n pixels, (n,), as a share of its diameter.

    The nearest part of it counts alone.

    Parameters
    ----------
    pixels : (n, 2) array
    line : (m, 2) array
        Its axis, px.
    radius : float
        px.
    pace : float
        Length of the last piece of the axis in space, px as seen from the side.
    ends : bool
        Whether it ends there.
    face : bool
        Whether the end's face is seen.
    """
    steps = np.diff(line, axis=0)
    square = np.maximum((steps**2).sum(axis=1), 1e-12)
    offset = pixels[:, None] - line[:-1]
    along = np.clip((offset * steps).sum(axis=2) / square, 0, 1)
    distance = ((offset - along[..., None] * steps) ** 2).sum(axis=2)
    nearest = distance.argmin(axis=1)
    share = np.sqrt(np.maximum(1 - distance.min(axis=1) / radius**2, 0))
    if not ends:
        return np.asarray(share)
    shown = float(np.sqrt(square[-1]))
    x_ahead, y_ahead = steps[-1] / shown
    x, y = (pixels - line[-1]).T
    beyond = x * x_ahead + y * y_ahead
    past = (nearest == len(steps) - 1) & (beyond > -0.5)
    share = np.where(past, np.clip(0.5 - beyond, 0, 1), 1.0) * share
    if face:
        thick = max(1 - (shown / pace) ** 2, 0.02)
        away = beyond**2 / thick + (y * x_ahead - x * y_ahead) ** 2
        share = np.maximum(share, np.sqrt(np.maximum(1 - away / radius**2, 0)))
    return np.asarray(share)


def blurred_root(share: Floats, shown: Booleans, absorption: float, weights: Floats) -> Floats:
    """Root of the light at pixels, after a blur.

    Parameters
    ----------
    share : (n,) array
        Of the absorption, at the pixels that are `shown`; the rest absorbs nothing.
    shown : (rows, columns) array of bool
    absorption : float
        Natural logarithm.
    weights : (2 k + 1,) array
        Of the blur.
    """
    light = np.ones(shown.shape)
    light[shown] = np.exp(-absorption * share)
    for axis in (0, 1):
        light = ndimage.correlate1d(light, weights, axis)
    return np.asarray(np.sqrt(light[shown]))


def heaped(points: Floats, shape: tuple[int, int]) -> Floats:
    """How many of points (n, 2), px, lie at each pixel, shared between the four about each."""
    rows, columns = shape
    # One more on each side, where all that lies beyond is heaped.
    x = np.clip(points[:, 0] + 1, 0, columns + 1)
    y = np.clip(points[:, 1] + 1, 0, rows + 1)
    column, row = x.astype(int), y.astype(int)
    right, down = x - column, y - row
    first = row * (columns + 2) + column
    place = np.concatenate([first, first + 1, first + columns + 2, first + columns + 3])
    share = np.concatenate(
        [(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down]
    )
    heap = np.bincount(place, share, (rows + 3) * (columns + 2))
    heap = heap[: (rows + 2) * (columns + 2)].reshape(rows + 2, columns + 2)
    return np.asarray(heap[1:-1, 1:-1])


def draw_line(mask: Booleans, line: Floats, radius: Floats) -> None:
    """Set the pixels whose centers lie beside a line by at most half its width.

    Parameters
    ----------
    mask : (rows, columns) array of bool
    line : (n, 2) array
        px.
    radius : (n,) array
        px.
    """
    steps = np.diff(line, axis=0)
    length = np.maximum(np.hypot(*steps.T), 1e-9)
    x_ahead, y_ahead = (steps / length[:, None]).T
    # At a bend both steps reach farther, so that no wedge is left between them.
    cosine = x_ahead[1:] * x_ahead[:-1] + y_ahead[1:] * y_ahead[:-1]
    mitre = np.sqrt(np.clip((1 - cosine) / (1 + np.maximum(cosine, 0)), 0, 1)) * radius[1:-1]
    before, behind = np.append(0, mitre), np.append(mitre, 0) + length
    half = (radius[:-1] + radius[1:]) / 2
    reach = int(np.ceil(np.hypot(half.max(), (behind + before).max() / 2) + 0.5))
    beside = np.arange(-reach, reach + 1)
    middle = np.rint((line[:-1] + line[1:]) / 2).astype(int)
    # Pixels about the middle of each step, (rows, columns, steps): how far along it, and beside.
    away = beside[:, None, None] + (middle - line[:-1])
    x, y = away[..., 0], away[:, None, :, 1]
    along = x * x_ahead + y * y_ahead
    covered = np.abs(x * y_ahead - y * x_ahead) <= half
    covered &= (along >= -before) & (along <= behind)
    row, column, step = np.nonzero(covered)
    row, column = beside[row] + middle[step, 1], beside[column] + middle[step, 0]
    seen = (column >= 0) & (column < mask.shape[1]) & (row >= 0) & (row < mask.shape[0])
    mask[row[seen], column[seen]] = True


def darker_lines(
    smooth: Gray,
    taps: Integers,
    aside: Integers,
    absorption: Gray,
    direction: npt.NDArray[np.int8],
) -> Booleans:
    """Where short lines are darker than any before, by as much as than both of their sides.

    Parameters
    ----------
    smooth : (rows + 2 k, columns + 2 k) array
        Logarithm of the light, with a margin.
    taps : (d, t, 2) array of int
        Points (x, y) of the line in each direction, from its middle, px.
    aside : (d, 2) array of int
        From a line to one of its sides, px.
    absorption, direction : (rows, columns) array
        How much darker, and the number of that direction; filled in where it is more.
    """
    margin = (len(smooth) - len(absorption)) // 2
    side = int(np.abs(aside).max())
    better = np.zeros(absorption.shape, dtype=bool)
    for number, (line, across) in enumerate(zip(taps, aside, strict=True)):
        total = shifted(smooth, line[0], margin - side).copy()
        for tap in line[1:]:
            total += shifted(smooth, tap, margin - side)
        total *= np.float32(1 / len(line))
        sides = np.minimum(shifted(total, across, side), shifted(total, -across, side))
        darker = sides - shifted(total, (0, 0), side)
        more = darker > absorption
        np.copyto(absorption, darker, where=more)
        np.copyto(direction, np.int8(number), where=more)
        better |= more
    return better


def shifted(array: Gray, offset: Integers | tuple[int, int], margin: int) -> Gray:
    """View of an array without its margin, moved by an offset (x, y) of at most the margin."""
    x, y = int(offset[0]), int(offset[1])
    rows, columns = array.shape
    return array[margin + y : rows - margin + y, margin + x : columns - margin + x]
