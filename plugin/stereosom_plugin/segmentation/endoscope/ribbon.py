"""The two edges of a device along a line that runs near its middle: `trace`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats
from stereosom_plugin.errors import require

from ..picture import Mask
from ..way import best_way

# How likely colors are those of the device, (n, m), -1 to 1, of what a picture shows at places
# (x, y), (n, m) each.
Evidence = Callable[[Any, Floats, Floats], Floats]

# All of these in widths of the device.
_SIDE, _BEYOND, _GAP = 2.0, 3.0, 6.0
_ROW = 1 / 8  # from row to row of a straightened picture
_STEEPEST = 2  # columns that the middle may move by from row to row
_TURN = 0.02  # price of one
_SMOOTH = 0.7  # along an edge
# Of a round end, and of the body before it that tells how an edge runs.
_ROUND, _BODY = 0.6, 2.0
_RUN = 1.0  # along the run of the line and of an edge
_END = 0.75  # to either side of an end, likewise
_EDGE = 0.14  # to either side of an edge, where its colors are looked up
# An edge that is farther from its run than this, px and in widths, strays; how sure an edge must
# be to depart from its run.
_STRAYS_PX, _STRAYS, _BRIDGED = 0.6, 0.02, 0.1
# Fewer widths of length are no device; rows that are less like it than this are gaps.
_SHORTEST, _LEAST_LIKE = 3.0, 0.1
# A device that is less like itself than this on the mean has been lost.
_LOST = 0.35


@dataclass(frozen=True, eq=False)
class Ribbon:
    """A device in a picture.

    Attributes
    ----------
    middle : (n, 2) array
        Points along it, px, about an eighth of its width apart.
    edges : pair of (n, 2) arrays
        To the left and to the right of each point, px.
    seen : (n,) array of bool
        Where the picture shows the device; elsewhere it is hidden, or outside.
    width : float
        px.
    """

    middle: Floats
    edges: tuple[Floats, Floats]
    seen: Any
    width: float

    def mask(self, shape: tuple[int, ...]) -> Mask:
        """The pixels whose centers lie between the edges, (rows, columns)."""
        drawn = np.zeros(shape[:2], dtype=bool)
        left, right = self.edges
        number = np.flatnonzero(self.seen)
        for run in np.split(number, np.flatnonzero(np.diff(number) > 1) + 1):
            if len(run) > 1:
                rims = [_half_a_row_longer(edge[run]) for edge in (left, right)]
                _fill(drawn, np.vstack([rims[0], rims[1][::-1]]))
        return drawn


def trace(
    picture: Any, line: Floats, width: float, evidence: Evidence, *, place_ends: bool = False
) -> Ribbon | None:
    """Find the device about a line.

    The picture is straightened along the line. The middle is the way along which the evidence
    within a width is strongest; on either side the edge is where the color has gone half the way
    from the device's to that behind it, smoothed along the device by less than its width.

    Parameters
    ----------
    picture : (rows, columns, channels) array of uint8
    line : (n, 2) array
        Within two widths of the device's middle, from end to end or some way short of it, px.
    width : float
        Of the device, about, px.
    evidence : callable
    place_ends : bool
        Whether the ends are placed by color too, and not where the evidence ends: it may go on
        where a pixel shows little of the device.

    Returns
    -------
    Ribbon or None
        Nothing where there is no device about the line.
    """
    size = np.array(picture.shape[1::-1], dtype=float)
    line, normal = _even(line, width, size)
    columns = max(24, round(12 * _SIDE))
    offset = np.linspace(-_SIDE, _SIDE, 2 * columns + 1) * width
    place = line[:, None] + offset[:, None] * normal[:, None]
    within = np.asarray(((place >= -0.5) & (place <= size - 0.5)).all(axis=2))
    like = np.where(within, evidence(picture, place[..., 0], place[..., 1]), 0.0)
    center = offset[_middle(like, round(columns / _SIDE / 2))]
    inside = (offset >= (center - width / 4)[:, None]) & (offset <= (center + width / 4)[:, None])
    known = inside & within
    row_like = (like * known).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    row_like[known.sum(axis=1) < 0.5 * inside.sum(axis=1)] = np.nan
    start, stop = _longest_run(row_like)
    if (stop - start) * _ROW < _SHORTEST or np.nanmean(row_like[start:stop]) < _LOST:
        return None
    if place_ends:
        body = place[np.arange(len(place)), np.abs(offset - center[:, None]).argmin(axis=1)]
        start, stop = _half_way(picture, body, normal, width, np.isnan(row_like), start, stop)
    kept = slice(start, stop)
    line, normal, center = line[kept], normal[kept], _smooth(center[kept], _SMOOTH / _ROW / 2)
    seen = np.asarray(ndimage.uniform_filter1d(np.nan_to_num(row_like[kept], nan=1.0), 5))
    seen = seen >= _LEAST_LIKE
    rough = _rough_edges(like[kept], offset, center, width)
    weight = within[kept].any(axis=1) & (np.nan_to_num(row_like[kept]) > _LEAST_LIKE)
    edges = _fine_edges(picture, line, normal, rough, width, weight)
    span = edges[1] - edges[0]
    width = float(np.median(span[weight])) if weight.any() else width
    seen &= span > 0.2 * width
    middle = line + ((edges[0] + edges[1]) / 2)[:, None] * normal
    left, right = (line + edge[:, None] * normal for edge in edges)
    return Ribbon(middle, (left, right), seen, width)


def _even(line: Floats, width: float, size: Floats) -> tuple[Floats, Floats]:
    """A line at even steps, gone on straight at both ends, and its normals."""
    step = max(_ROW * width, 0.5)
    reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0, reach[-1], max(int(reach[-1] / step), 8))
    even = np.column_stack([np.interp(at, reach, axis) for axis in line.T])
    even = _smooth(even, _RUN * width / step)
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
    along = np.gradient(even, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    return even, np.column_stack([-along[:, 1], along[:, 0]])


def _middle(like: Floats, half: int) -> Any:
    """The column of each row about which a width of the evidence is strongest, smoothly."""
    total = ndimage.uniform_filter1d(like, 2 * half + 1, axis=1, mode="constant")
    # What lies beside a device is something else; a wide thing is not followed along its rim.
    beside = ndimage.uniform_filter1d(like, 4 * half + 1, axis=1, mode="constant")
    gain = ndimage.uniform_filter1d(2 * total - beside, 5, axis=0)
    return best_way(gain, _TURN * np.abs(np.arange(-_STEEPEST, _STEEPEST + 1)))


def _longest_run(row_like: Floats) -> tuple[int, int]:
    """Rows from the device's one end to the other; beyond the picture nothing is known."""
    smooth = ndimage.median_filter(np.nan_to_num(row_like, nan=-9.0), 5)
    on = np.flatnonzero(smooth > _LEAST_LIKE)
    if len(on) == 0:
        return 0, 0
    breaks = np.flatnonzero(np.diff(on) > _GAP / _ROW)
    starts, stops = on[np.append(0, breaks + 1)], on[np.append(breaks, len(on) - 1)] + 1
    longest = int(np.argmax(stops - starts))
    start, stop = int(starts[longest]), int(stops[longest])
    # At the picture's border the device goes on beyond it.
    outside = np.isnan(row_like)
    while start > 0 and outside[start - 1]:
        start -= 1
    while stop < len(row_like) and outside[stop]:
        stop += 1
    return start, stop


def _half_way(
    picture: Any, middle: Floats, normal: Floats, width: float, outside: Any, start: int, stop: int
) -> tuple[int, int]:
    """Rows of both ends, where the color has gone half the way to that behind the device."""
    across = np.linspace(-0.2, 0.2, 5)[:, None] * width
    reach = round(_END / _ROW)
    found = []
    for end, outward in ((start, -1), (stop - 1, 1)):
        rows = end + outward * np.arange(-reach, reach + 1)
        if rows.min() < 0 or rows.max() >= len(middle) or outside[rows].any():
            found.append(end)
            continue
        place = middle[rows][:, None] + across * normal[rows][:, None]
        color = sample(picture, place[..., 0], place[..., 1]).astype(float).mean(axis=1)
        inner, outer = color[: reach // 2].mean(axis=0), color[-(reach // 2) :].mean(axis=0)
        way = outer - inner
        share = np.clip((color - inner) @ way / max(float(way @ way), 1e-6), 0, 1)
        found.append(end + outward * round(reach - share.sum()))
    return found[0], found[1] + 1


def _rough_edges(like: Floats, offset: Floats, center: Floats, width: float) -> Floats:
    """Distance of both edges from the line, (2, rows).

    Outwards from the middle, the evidence sums up to its most there.
    """
    step = offset[1] - offset[0]
    smooth = ndimage.uniform_filter1d(like, 5, axis=0)
    found = []
    far = np.arange(1, int(np.ceil(0.9 * width / step)) + 1)
    first = np.rint((center - offset[0]) / step).astype(int)
    for side in (-1, 1):
        column = np.clip(first[:, None] + side * far, 0, like.shape[1] - 1)
        total = np.cumsum(np.take_along_axis(smooth, column, axis=1), axis=1)
        at = far[total.argmax(axis=1)] * step + step / 2
        at = ndimage.median_filter(at, size=2 * round(_SMOOTH / _ROW / 2) + 1, mode="nearest")
        found.append(center + side * at)
    return np.stack(found)


def _fine_edges(
    picture: Any, line: Floats, normal: Floats, rough: Floats, width: float, weight: Any
) -> Floats:
    """Where the colors have gone half the way from inside to outside, (2, rows), from the line."""
    reach = max(2.5, _EDGE * width)
    across, side = np.linspace(-reach, reach, 21), np.array([[-1.0], [1.0]])
    away = (rough[..., None] + side[..., None] * across).reshape(-1, 21, 1)
    place = np.tile(line, (2, 1))[:, None] + away * np.tile(normal, (2, 1))[:, None]
    profile = sample(picture, place[..., 0], place[..., 1]).astype(np.float32)
    profile = ndimage.uniform_filter1d(profile.reshape(2, len(line), 21, -1), 5, axis=1)
    inner, outer = profile[:, :, 1:7].mean(axis=2), profile[:, :, 14:20].mean(axis=2)
    way = outer - inner
    share = np.einsum("erck,erk->erc", profile - inner[:, :, None], way)
    square = (way**2).sum(axis=2)
    share /= np.maximum(square, 1e-6)[..., None]
    # The area under the rise: the place of its half, less noisy than where it crosses.
    step = across[1] - across[0]
    shift = across[-1] - np.clip(share, 0, 1).sum(axis=2) * step + step / 2
    sure = weight * np.minimum(np.sqrt(square) / 25, 1) ** 2 + 1e-6
    shift = np.where(np.abs(shift) < reach, shift, 0)
    edge = rough + side * shift
    edge = np.stack([_to_flat_ends(*each) for each in zip(edge, sure, strict=True)], axis=1)
    sure = sure.T
    # What departs from the run of the edge is a glare or a vessel beside it: bridged.
    for _ in range(3):
        run = _weighted(edge, sure, _RUN / _ROW)
        sure = sure / (1 + ((edge - run) / max(_STRAYS_PX, _STRAYS * width)) ** 2)
    return np.asarray(run + _weighted(edge - run, sure, _SMOOTH / _ROW, _BRIDGED)).T


def _to_flat_ends(edge: Floats, sure: Floats) -> Floats:
    """An edge that goes straight on where a round end bends it inwards."""
    row = np.arange(len(edge))
    seen = np.flatnonzero(sure > 1e-3)
    for end, inward in ((seen[0], 1), (seen[-1], -1)) if len(seen) else ():
        distance = inward * (row - end) * _ROW
        body = (distance >= _ROUND) & (distance < _ROUND + _BODY)
        weight, at, here = sure[body], row[body], edge[body]
        if (total := weight.sum()) > 1e-3 and len(at) > 4:
            middle, level = weight @ at / total, weight @ here / total
            slope = weight @ ((at - middle) * (here - level)) / (weight @ (at - middle) ** 2)
            edge = np.where(distance < _ROUND, level + slope * (row - middle), edge)
    return edge


def sample(picture: Any, x: Floats, y: Floats) -> Any:
    """Colors at places (x, y), (n, m, channels), interpolated."""
    cv2 = require("cv2", "endoscopy")
    found = cv2.remap(
        picture, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    return found if found.ndim == 3 else found[..., None]


def _smooth(values: Floats, sigma: float) -> Floats:
    """A mean along the first axis that neither shortens a line nor turns its ends."""
    return _weighted(values, np.ones((len(values), 1)), sigma)


def _weighted(values: Floats, weights: Floats, sigma: float, more: float = 0.0) -> Floats:
    """The same with weights, (n, 1) or one to a value; `more` of them at zero."""
    flat = np.reshape(values, (len(values), -1))
    margin = min(int(3 * sigma) + 1, len(flat) - 1)
    before, after = slice(margin, 0, -1), slice(-2, -2 - margin, -1)
    weight = np.vstack([weights[before], weights, weights[after]])
    flat = np.vstack([2 * flat[0] - flat[before], flat, 2 * flat[-1] - flat[after]])
    both = np.hstack([flat * weight, weight])
    over = ndimage.correlate1d(both, _bell(sigma), axis=0)[margin : len(flat) - margin]
    mean = over[:, : flat.shape[1]] / (over[:, flat.shape[1] :] + more)
    return np.asarray(mean.reshape(np.shape(values)))


@lru_cache(maxsize=64)
def _bell(sigma: float) -> Floats:
    """Weights of a normal distribution out to three deviations, their sum one."""
    reach = int(3 * sigma + 0.5)
    weight = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.asarray(weight / weight.sum())


def _half_a_row_longer(edge: Floats) -> Floats:
    """Rows are known at their middles; a device reaches over the whole of its first and last."""
    before, after = 1.5 * edge[0] - 0.5 * edge[1], 1.5 * edge[-1] - 0.5 * edge[-2]
    return np.vstack([before, edge, after])


def _fill(drawn: Mask, outline: Floats) -> None:
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
