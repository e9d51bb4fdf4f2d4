"""A picture straightened along a line that runs near a device's middle: `straighten`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats

from ..loops import loops
from ..picture import Mask
from ..way import best_way
from .frame import Light

# How likely colors are those of the device, (n, m), -1 to 1, of what a picture shows at places
# (x, y), (n, m) each, a row across the device after the other.
Evidence = Callable[[Any, Floats, Floats], Floats]

# All of these in widths of the device: to either side of a line, of its middle; beyond either end;
# a gap within it.
_SIDE, _NEAR_SIDE, _BEYOND, _GAP = 2.0, 1.25, 3.0, 6.0
ROW, _COLUMN = 1 / 8, 1 / 12  # from row to row, and from column to column
_RUN = 1.0  # along the run of the line
_STEEPEST = 2  # columns that the middle may move by from row to row
_TURN = 0.02  # price of one
# Rows that are less like the device than this are gaps.
LEAST_LIKE = 0.1
# A line is brought to a device on every so many-th row and column, as often at most as it is
# farther off than this, in widths, or too short.
_COARSE, _OFF, _BROUGHT = 2, 1.0, 8


@dataclass(frozen=True, eq=False)
class Strip:
    """A straightened picture: n rows across a line, m columns along it.

    Attributes
    ----------
    line, normal : (n, 2) array
        The line, gone on straight at both ends, px, and what is across it.
    offset : (m,) array
        Of the columns from the line, px.
    within : (n, m) array of bool
        What lies in the picture.
    like : (n, m) array
        How like the device it is.
    center, row_like : (n,) array
        How far the device's middle is from the line, px, and how like the device that is; not a
        number beyond the picture.
    row : float
        From row to row, widths.
    """

    line: Floats
    normal: Floats
    offset: Floats
    within: Mask
    like: Floats
    center: Floats
    row_like: Floats
    row: float

    @property
    def middle(self) -> Floats:
        """Of the device, (n, 2), px."""
        return np.asarray(self.line + self.center[:, None] * self.normal)

    def run(self) -> tuple[int, int]:
        """Rows from the device's one end to the other."""
        return _longest_run(self.row_like, self.row)

    def goes_on(self, start: int, stop: int) -> bool:
        """Whether a device's run goes on in the picture beyond what is straightened."""
        ends = (row for row, at in ((0, start), (-1, stop - len(self.line))) if at == 0)
        return any(self.row_like[row] > LEAST_LIKE for row in ends)


def straighten(
    picture: Any,
    line: Floats,
    width: float,
    evidence: Evidence,
    *,
    coarse: int = 1,
    middle: bool = False,
) -> Strip:
    """Straighten a picture along a line; every so many-th row and column of it.

    Where the line is the device's `middle` already, it is not looked for, and less of what lies
    beside is looked at.
    """
    size = np.array(picture.shape[1::-1], dtype=float)
    side = _NEAR_SIDE if middle else _SIDE
    row, columns = coarse * ROW, round(side / _COLUMN / coarse)
    line, normal = _even(line, width, row, size)
    offset = np.linspace(-side, side, 2 * columns + 1) * width
    x, y = (line[:, i, None] + offset * normal[:, i, None] for i in (0, 1))
    within = (x >= -0.5) & (x <= size[0] - 0.5) & (y >= -0.5) & (y <= size[1] - 0.5)
    like = np.where(within, evidence(picture, x, y), 0.0)
    center = np.zeros(len(line))
    if not middle:
        center = offset[_middle(like, round(columns / side / 2))]
    inside = (offset >= (center - width / 4)[:, None]) & (offset <= (center + width / 4)[:, None])
    known = inside & within
    row_like = (like * known).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    row_like[known.sum(axis=1) < 0.5 * inside.sum(axis=1)] = np.nan
    return Strip(line, normal, offset, within, like, center, row_like, row)


def brought_to(picture: Any, line: Floats, width: float, evidence: Evidence) -> Floats:
    """A line where a device was, brought to where it is: across its old line, ends look slanted.

    Parameters
    ----------
    picture : (rows, columns, channels) array of uint8
    line : (n, 2) array
        Within two widths of the device's middle, px.
    width : float
        Of the device, px.
    evidence : callable
    """
    for _ in range(_BROUGHT):
        strip = straighten(picture, line, width, evidence, coarse=_COARSE)
        start, stop = strip.run()
        if stop - start < 8:
            break
        line = strip.middle[start:stop]
        near = np.abs(strip.center[start:stop]).max() < _OFF * width
        if near and not strip.goes_on(start, stop):
            break
    return line


def _even(line: Floats, width: float, row: float, size: Floats) -> tuple[Floats, Floats]:
    """A line at even steps, gone on straight at both ends, and its normals."""
    step = max(row * width, 0.5)
    length = float(np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)).sum())
    even = smooth(loops().evenly(line, min(step, length / 8)), _RUN * width / step)
    tail = min(max(int(width / step), 2), len(even) - 1)
    ahead = step * np.arange(1, int(_BEYOND * width / step) + 1)[:, None]
    ends = []
    for end, before in ((even[0], even[tail]), (even[-1], even[-1 - tail])):
        heading = (end - before) / max(float(np.linalg.norm(end - before)), 1e-9)
        ends.append(end + ahead * heading)
    even = np.vstack([ends[0][::-1], even, ends[1]])
    near = ((even > -width) & (even < size - 1 + width)).all(axis=1)
    inside = np.flatnonzero(near)
    if len(inside) > 8:
        even = even[inside[0] : inside[-1] + 1]
    return even, np.asarray(loops().normals(even))


def _middle(like: Floats, half: int) -> Any:
    """The column of each row about which a width of the evidence is strongest, smoothly."""
    total = ndimage.uniform_filter1d(like, 2 * half + 1, axis=1, mode="constant")
    # What lies beside a device is something else; a wide thing is not followed along its rim.
    beside = ndimage.uniform_filter1d(like, 4 * half + 1, axis=1, mode="constant")
    gain = ndimage.uniform_filter1d(2 * total - beside, 5, axis=0)
    return best_way(gain, _TURN * np.abs(np.arange(-_STEEPEST, _STEEPEST + 1)))


def _longest_run(row_like: Floats, row: float) -> tuple[int, int]:
    """Rows from the device's one end to the other; beyond the picture nothing is known."""
    outside = np.isnan(row_like)
    on = np.flatnonzero(loops().middles(np.where(outside, -9.0, row_like), 5) > LEAST_LIKE)
    if len(on) == 0:
        return 0, 0
    breaks = np.flatnonzero(np.diff(on) > _GAP / row)
    starts, stops = on[np.append(0, breaks + 1)], on[np.append(breaks, len(on) - 1)] + 1
    longest = int(np.argmax(stops - starts))
    start, stop = int(starts[longest]), int(stops[longest])
    # At the picture's border the device goes on beyond it.
    while start > 0 and outside[start - 1]:
        start -= 1
    while stop < len(row_like) and outside[stop]:
        stop += 1
    return start, stop


def sample(picture: Any, x: Floats, y: Floats) -> Light:
    """Colors at places (x, y), (n, m, channels), interpolated."""
    return np.asarray(loops().sampled(picture, x, y))


def smooth(values: Floats, sigma: float) -> Floats:
    """A mean along the first axis that neither shortens a line nor turns its ends."""
    return weighted(values, np.ones((len(values), 1)), sigma)


def weighted(values: Floats, weights: Floats, sigma: float, more: float = 0.0) -> Floats:
    """The same with weights, (n, 1) or one to a value; `more` of them at zero."""
    flat = np.reshape(values, (len(values), -1))
    return np.asarray(loops().weighted(flat, weights, _bell(sigma), more).reshape(np.shape(values)))


@lru_cache(maxsize=64)
def _bell(sigma: float) -> Floats:
    """Weights of a normal distribution out to three deviations, their sum one."""
    reach = int(3 * sigma + 0.5)
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(weight / weight.sum())
