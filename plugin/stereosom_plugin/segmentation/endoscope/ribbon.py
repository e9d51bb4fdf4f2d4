"""The two edges of a device along a line that runs near its middle: `trace`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats

from ..loops import loops
from ..picture import Mask
from .straight import (
    LEAST_LIKE,
    ROW,
    Evidence,
    Strip,
    sample,
    smooth,
    straighten,
    weighted,
)
from .tips import Tip, find_tip

# All of these in widths of the device.
_SMOOTH = 0.7  # along an edge
# Of a round end, and of the body before it that tells how an edge runs.
_ROUND, _BODY = 0.6, 2.0
_RUN = 1.0  # along the run of the line and of an edge
_END = 0.75  # to either side of an end, likewise
_EDGE = 0.14  # to either side of an edge, where its colors are looked up
# Least share of hue in what changes there, and how often such an edge is looked up; narrower, and
# there is no inside of one color. Each look goes two thirds of the way that is left.
_OF_HUE, _LOOKS, _TOLD, _FARTHER = 0.15, 2, 4.0, 1.5
# An edge that is farther from its run than this, px and in widths, strays; how sure an edge must
# be to depart from its run.
_STRAYS_PX, _STRAYS, _BRIDGED = 0.6, 0.02, 0.1
# Fewer widths of length are no device.
_SHORTEST = 3.0
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
    tips : pair of Tip or None
        How it begins and ends, where that is known.
    """

    middle: Floats
    edges: tuple[Floats, Floats]
    seen: Any
    width: float
    tips: tuple[Tip | None, Tip | None] = (None, None)

    def mask(self, shape: tuple[int, ...]) -> Mask:
        """The pixels whose centers lie between the edges, (rows, columns)."""
        drawn = np.zeros(shape[:2], dtype=bool)
        number = np.flatnonzero(self.seen)
        for run in np.split(number, np.flatnonzero(np.diff(number) > 1) + 1):
            if len(run) > 1:
                edges = self.edges[0][run], self.edges[1][run]
                first, last = run[0] == 0, run[-1] == len(self.seen) - 1
                edges = _ended(edges, self.tips[1] if last else None)
                edges = _ended((edges[0][::-1], edges[1][::-1]), self.tips[0] if first else None)
                loops().fill(drawn, np.vstack([edges[0], edges[1][::-1]]))
        return drawn


def trace(
    picture: Any,
    line: Floats,
    width: float,
    evidence: Evidence,
    *,
    place_ends: bool = False,
    middle: bool = False,
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
    strip = straighten(picture, line, width, evidence, middle=middle)
    like, offset, center, row_like = strip.like, strip.offset, strip.center, strip.row_like
    start, stop = strip.run()
    if (stop - start) * ROW < _SHORTEST or np.nanmean(row_like[start:stop]) < _LOST:
        return None
    if place_ends:
        start, stop = _half_way(picture, strip, width, start, stop)
    kept = slice(start, stop)
    line, normal = strip.line[kept], strip.normal[kept]
    center = smooth(center[kept], _SMOOTH / ROW / 2)
    near = ndimage.uniform_filter1d(np.nan_to_num(row_like[kept], nan=1.0), 5)
    seen = near >= LEAST_LIKE
    edges = _rough_edges(like[kept], offset, center, width)
    weight = strip.within[kept].any(axis=1) & (np.nan_to_num(row_like[kept]) > LEAST_LIKE)
    for _ in range(_LOOKS):
        edges, by_hue = _fine_edges(picture, line, normal, edges, width, weight)
        if not by_hue:
            break
    span = edges[1] - edges[0]
    width = float(np.median(span[weight])) if weight.any() else width
    seen &= span > 0.2 * width
    left, right = (line + edge[:, None] * normal for edge in edges)
    ribbon = Ribbon((left + right) / 2, (left, right), seen, width)
    return ribbon if place_ends else replace(ribbon, tips=_tips(picture, ribbon, evidence))


def _tips(picture: Any, ribbon: Ribbon, evidence: Evidence) -> tuple[Tip | None, Tip | None]:
    """How a device begins and ends, where the picture shows it."""
    (left, right), size = ribbon.edges, picture.shape[1::-1]

    def gain(x: Floats, y: Floats) -> Floats:
        return evidence(picture, x, y) - LEAST_LIKE

    return (
        find_tip((left[::-1], right[::-1]), size, gain) if ribbon.seen[0] else None,
        find_tip((left, right), size, gain) if ribbon.seen[-1] else None,
    )


def _half_way(picture: Any, strip: Strip, width: float, start: int, stop: int) -> tuple[int, int]:
    """Rows of both ends, where the color has gone half the way to that behind the device."""
    middle, normal, outside = strip.middle, strip.normal, np.isnan(strip.row_like)
    across = np.linspace(-0.2, 0.2, 5)[:, None] * width
    reach = round(_END / ROW)
    found = []
    for end, outward in ((start, -1), (stop - 1, 1)):
        rows = end + outward * np.arange(-reach, reach + 1)
        if rows.min() < 0 or rows.max() >= len(middle) or outside[rows].any():
            found.append(end)
            continue
        place = middle[rows][:, None] + across * normal[rows][:, None]
        color = sample(picture, place[..., 0], place[..., 1]).mean(axis=1)
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
    first = np.rint((center - offset[0]) / step).astype(int)
    columns = loops().most_gain(like, first, int(np.ceil(0.9 * width / step)))
    size = 2 * round(_SMOOTH / ROW / 2) + 1
    left, right = (loops().middles((each + 0.5) * step, size) for each in columns)
    return np.stack([center - left, center + right])


def _fine_edges(
    picture: Any, line: Floats, normal: Floats, rough: Floats, width: float, weight: Any
) -> tuple[Floats, bool]:
    """Where the colors have gone half the way from inside to outside, (2, rows), from the line.

    And whether it is their hue that tells it, on both sides: it does so the better, the nearer
    what is called inside and outside is to the edge.
    """
    reach = max(2.5, _EDGE * width)
    least_hue = _OF_HUE if width > _TOLD * reach else np.inf
    across, side = np.linspace(-reach, reach, 21), np.array([[-1.0], [1.0]])
    away = rough[..., None] + side[..., None] * across
    x, y = (line[:, i, None] + away * normal[:, i, None] for i in (0, 1))
    profiles = (loops().sampled(picture, *edge) for edge in zip(x, y, strict=True))
    step = across[1] - across[0]
    found = [loops().half_way(profile, step, least_hue) for profile in profiles]
    shift, contrast, by_hue = (np.array(each) for each in zip(*found, strict=True))
    sure = weight * np.minimum(contrast / 25, 1) ** 2 + 1e-6
    shift *= np.where(by_hue, _FARTHER, 1.0)[:, None]
    shift = np.where(np.abs(shift) < reach, shift, 0)
    edge = rough + side * shift
    edge = np.stack([_to_flat_ends(*each) for each in zip(edge, sure, strict=True)], axis=1)
    sure = sure.T
    # What departs from the run of the edge is a glare or a vessel beside it: bridged.
    for _ in range(3):
        run = weighted(edge, sure, _RUN / ROW)
        sure = sure / (1 + ((edge - run) / max(_STRAYS_PX, _STRAYS * width)) ** 2)
    fine = run + weighted(edge - run, sure, _SMOOTH / ROW, _BRIDGED)
    return np.asarray(fine).T, bool(by_hue.all())


def _to_flat_ends(edge: Floats, sure: Floats) -> Floats:
    """An edge that goes straight on where a round end bends it inwards."""
    row = np.arange(len(edge))
    seen = np.flatnonzero(sure > 1e-3)
    for end, inward in ((seen[0], 1), (seen[-1], -1)) if len(seen) else ():
        distance = inward * (row - end) * ROW
        body = (distance >= _ROUND) & (distance < _ROUND + _BODY)
        weight, at, here = sure[body], row[body], edge[body]
        if (total := weight.sum()) > 1e-3 and len(at) > 4:
            middle, level = weight @ at / total, weight @ here / total
            slope = weight @ ((at - middle) * (here - level)) / (weight @ (at - middle) ** 2)
            edge = np.where(distance < _ROUND, level + slope * (row - middle), edge)
    return edge


def _ended(edges: tuple[Floats, Floats], tip: Tip | None) -> tuple[Floats, Floats]:
    """Both edges, (n, 2), up to the end of the device.

    Rows are known at their middles: where no tip is known, it reaches over the whole of its last.
    """
    if tip is not None:
        return tip.after(edges)
    left, right = (np.vstack([edge, 1.5 * edge[-1] - 0.5 * edge[-2]]) for edge in edges)
    return left, right
