"""A device from one frame to the next: the darkest smooth way through a band about where it was.

The picture is straightened along the line that was seen last; at each place across it, how much
darker it is than on both sides counts. The way through that band that collects most, without
sudden turns, is found by dynamic programming (A. A. Amini, T. E. Weymouth, R. C. Jain, "Using
dynamic programming for solving variational problems in vision", IEEE PAMI 12(9), 1990).
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats

from .loops import loops
from .picture import log_across
from .tube import Tube, extended
from .way import best_way
from .xray import AT_BORDER, BAND, Candidate, View

# Spacing of places along and across, and how far beyond its ends the device may have grown, px of
# the search.
ALONG, ACROSS, GROWN = 2.0, 1.0, 24
# Price of a place to the side from one step to the next, and greatest number of those.
TURN, MOST_TURN = 0.15, 2
_PRICE = TURN * np.arange(-MOST_TURN, MOST_TURN + 1) ** 2
# Share of the usual absorption that is device, and gaps that are bridged, steps.
PRESENT, GAP = 0.5, 12


def follow(view: View, last: Tube, near: Floats) -> Candidate | None:
    """Find the line of a device that was seen a frame before.

    Parameters
    ----------
    view : View
    last : Tube
        As it was.
    near : (n, 2) array
        Where it is expected, px.

    Returns
    -------
    Candidate or None
        None where nothing goes on like it.
    """
    unit = float(view.factor)
    line = loops().evenly(near, ALONG * unit)
    if len(line) < 8:
        return None
    grown = round(GROWN / ALONG)
    ends = tuple(view.distance_to_border(line[[0, -1]]) < AT_BORDER * unit)
    line = extended(line, grown, smooth=2.0)
    line = line[0 if not ends[0] else grown : None if not ends[1] else -grown]
    radius = float(np.median(last.radius))
    darker, across = _darker(view, line, radius, unit)
    score = np.clip(darker / last.absorption, 0, 1)
    way = best_way(score, _PRICE)
    steps = np.arange(len(way))
    seen = ndimage.uniform_filter1d(score[steps, way], 5) > PRESENT
    first, beyond = _longest(seen)
    if beyond - first < 8:
        return None
    side = ndimage.gaussian_filter1d(across[way].astype(float), 1.5)
    points = (line + side[:, None] * loops().normals(line))[first:beyond]
    inside = np.all((points >= 0) & (points <= np.array(view.picture.shape[::-1]) - 1), axis=1)
    points = points[inside]
    if len(points) < 8:
        return None
    enters = view.distance_to_border(points[[0, -1]]) < AT_BORDER * unit
    absorption = float(np.median(darker[steps, way][first:beyond]))
    return Candidate(points, (bool(enters[0]), bool(enters[1])), max(absorption, 1e-3), 1.0)


def _darker(view: View, line: Floats, radius: float, unit: float) -> tuple[Floats, Floats]:
    """By how much places (n, m) across a line are darker than both sides; and the m places, px.

    As logarithms of the light, averaged over the width of the device and some steps.
    """
    beside = radius + 2 * unit
    count = int(np.ceil((BAND * unit + beside) / (ACROSS * unit)))
    across = ACROSS * unit * np.arange(-count, count + 1, dtype=float)
    light = log_across(view.picture, line, loops().normals(line), across)
    light = ndimage.gaussian_filter1d(light, 1.2, axis=0)
    core = max(1, round(1.2 * radius / (ACROSS * unit)))
    light = ndimage.uniform_filter1d(light, core + (core + 1) % 2, axis=1)
    away = int(np.ceil(beside / (ACROSS * unit)))
    sides = np.minimum(light[:, : -2 * away], light[:, 2 * away :])
    return np.asarray(sides - light[:, away:-away], dtype=float), across[away:-away]


def _longest(seen: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> tuple[int, int]:
    """First step of the longest stretch that is seen but for short gaps, and that beyond it."""
    at = np.flatnonzero(seen)
    if len(at) == 0:
        return 0, 0
    breaks = np.flatnonzero(np.diff(at) > GAP + 1)
    first, last = at[np.append(0, breaks + 1)], at[np.append(breaks, len(at) - 1)]
    longest = np.argmax(last - first)
    return int(first[longest]), int(last[longest]) + 1
