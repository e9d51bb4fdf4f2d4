"""What lines and tubes leave in a picture, and dark lines in one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Booleans, Floats, Integers

from .lines import Gray


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
