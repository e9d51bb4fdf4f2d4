"""The device's way through the skeleton: straight on at crossings, across gaps, from end to end."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from itertools import combinations

import numpy as np

from ..arrays import Floats
from .graph import Chain, polyline_length

# An end of a chain: its place in the list, and whether it is the chain's stop.
_End = tuple[int, bool]

# Ways into a crossing that turn by more than this, rad, are no continuation of each other.
_SHARPEST_TURN = 2.0
# So many widths long is what two strands that cross share; where three ways meet at either end
# of it, and not four, they cross at a small angle and share more.
_MERGED, _MERGED_LONG = 2.5, 6.0
# Gaps up to this many widths are bridged, where the turns in all are no more than this, rad.
_WIDEST_GAP, _STRAIGHT_ON = 8.0, 1.2
# Over a short gap, in widths, such as a hole in the mask leaves, it may turn as far as this.
_SHORT_GAP, _AROUND = 3.5, 2.5
# Beside a hole a middle line is drawn aside: its heading is taken so many widths before.
_AT_A_HOLE = (4.0, 1.2)


def longest_route(chains: list[Chain], width: float) -> Floats:
    """The longest way along the device, (n, 2) pixels as (row, column).

    Parameters
    ----------
    chains : list of Chain
        Pruned.
    width : float
        Of the device, px.
    """
    routes = sorted(_routes(chains, width), key=polyline_length, reverse=True)
    return _bridge_gaps(routes, width) if routes else np.zeros((0, 2))


def _routes(chains: list[Chain], width: float) -> list[Floats]:
    """Ways that go straight on at every crossing, each chain in one of them."""
    chains = _merge_crossings(chains, width)
    onward = _continuations(chains, width)
    ends = [(place, stop) for place in range(len(chains)) for stop in (False, True)]
    # From where nothing leads on; then rings, which have no such place.
    routes = []
    used: set[int] = set()
    for begin in [end for end in ends if end not in onward] + ends:
        parts: list[Floats] = []
        at: _End | None = begin
        while at is not None and at[0] not in used:
            place, from_stop = at
            used.add(place)
            pixels = chains[place].pixels
            parts.append(pixels[::-1] if from_stop else pixels)
            at = onward.get((place, not from_stop))
        if parts:
            routes.append(_without_crossings(parts, width))
    return [route for route in routes if len(route) > 1]


def _merge_crossings(chains: list[Chain], width: float) -> list[Chain]:
    """Drop short chains between crossings: two strands that cross merge over some length."""
    degree = Counter(node for chain in chains for node in (chain.start, chain.stop))
    same: dict[int, int] = {}

    def merged(node: int) -> int:
        while node in same:
            node = same[node]
        return node

    kept = []
    for chain in chains:
        inner = degree[chain.start] > 2 and degree[chain.stop] > 2 and chain.start != chain.stop
        threefold = degree[chain.start] == degree[chain.stop] == 3
        if inner and chain.length < (_MERGED_LONG if threefold else _MERGED) * width:
            if merged(chain.start) != merged(chain.stop):
                same[merged(chain.start)] = merged(chain.stop)
        else:
            kept.append(chain)
    return [Chain(merged(chain.start), merged(chain.stop), chain.pixels) for chain in kept]


def _continuations(chains: list[Chain], width: float) -> dict[_End, _End]:
    """Which end leads on into which: at each crossing the straightest pairs, best first."""
    meeting: dict[int, list[_End]] = defaultdict(list)
    for place, chain in enumerate(chains):
        meeting[chain.start].append((place, False))
        meeting[chain.stop].append((place, True))
    onward: dict[_End, _End] = {}
    for ends in meeting.values():
        arriving = {end: _arrival(chains[end[0]].pixels[:: 1 if end[1] else -1], width)
                    for end in ends}  # fmt: skip
        pairs = [(_turn(arriving[a], arriving[b]), a, b) for a, b in combinations(ends, 2)]
        for turn, a, b in sorted(pairs):
            if turn < _SHARPEST_TURN and a not in onward and b not in onward:
                onward[a], onward[b] = b, a
    return onward


def _arrival(
    pixels: Floats, width: float, widths: tuple[float, float] = (2.5, 0.8)
) -> tuple[Floats, Floats]:
    """Where a way is before its last pixel, where the end bends nothing yet, and its heading.

    Between so many widths before the end.
    """
    last = len(pixels) - 1
    first, stop = (int(number * width) for number in widths)
    before = pixels[max(0, last - first) : max(1, last - stop) + 1]
    first, at = (before if len(before) > 1 else pixels)[[0, -1]]
    step = at - first
    return at, np.asarray(step / max(math.hypot(*step), 1e-9))


def _turn(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> float:
    """Turns from one arrival onto the way across, and from there onto the other, in all, rad.

    Two strands that cross at a small angle have nearly the same heading; but only the true
    continuation lies straight ahead.
    """
    (here, heading), (there, opposite) = one, other
    across = there - here
    across = across / max(math.hypot(*across), 1e-9)
    cosines = (float(heading @ across), float(-opposite @ across))
    return sum(math.acos(min(max(cosine, -1.0), 1.0)) for cosine in cosines)


def _without_crossings(parts: list[Floats], width: float) -> Floats:
    """Chain pixels end to end, without those near a crossing, which draws them aside."""
    drawn = int(0.9 * width)
    trimmed = [
        part[drawn if number else 0 : len(part) - (drawn if number < len(parts) - 1 else 0)]
        for number, part in enumerate(parts)
    ]
    return np.vstack(trimmed)


def _bridge_gaps(routes: list[Floats], width: float) -> Floats:
    """Lengthen the first route at both ends by the others that go on where it stops."""
    whole, rest = routes[0], [route for route in routes[1:] if polyline_length(route) > width]
    for _ in range(2):  # at its stop, then at its start
        while True:
            here = _arrival(whole, width, _AT_A_HOLE)
            candidates = []
            for place, route in enumerate(rest):
                for ahead in (route, route[::-1]):
                    gap = math.dist(ahead[0], whole[-1])
                    if gap >= _WIDEST_GAP * width:
                        continue
                    turn = _turn(here, _arrival(ahead[::-1], width, _AT_A_HOLE))
                    short = gap < _SHORT_GAP * width and turn < _AROUND
                    if short or turn < _STRAIGHT_ON:
                        candidates.append((gap, place, ahead))
            if not candidates:
                break
            _, place, ahead = min(candidates, key=lambda candidate: candidate[0])
            whole = np.vstack([whole, ahead])
            rest.pop(place)
        whole = whole[::-1]
    return whole
