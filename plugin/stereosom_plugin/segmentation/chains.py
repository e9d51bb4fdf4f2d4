"""From dark pixels to chains: pieces of line, linked across gaps and straight over crossings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom.arrays import Floats
from stereosom_plugin.errors import require

from .picture import Mask, middle
from .ridges import Ridges

# A line begins where it stands out of the noise by the first, and goes on by the second.
CLEAR, DIM = 6.0, 3.5
# Absorption that is taken for a line whatever the noise: most of the anatomy stays below.
LEAST_CLEAR, LEAST_DIM = 0.08, 0.05
# Shortest piece, and longest gap that is bridged, in pixels of the search.
SHORTEST, LONGEST_GAP = 6, 40.0
# Two ends are linked where neither turns more than this, rad, and their absorptions have no
# greater quotient.
MOST_TURN, MOST_QUOTIENT = 0.8, 1.5
# A chain is also taken for two where its absorption changes by this quotient, suddenly: over so
# many points, which are also the least of a part.
CHANGE, PART = 1.35, 24
_SQUARE = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True, eq=False)
class Chain:
    """A line through a picture.

    `points` (n, 2), px, are in order; `absorption` (n,) is that of the line there, not a number
    in gaps.
    """

    points: Floats
    absorption: Floats

    @property
    def length(self) -> float:
        """Along the line, px."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @property
    def typical(self) -> float:
        """Median absorption."""
        return middle(self.absorption)

    @property
    def variation(self) -> float:
        """Median deviation of the absorption, as a share of the typical."""
        typical = self.typical
        return middle(np.abs(self.absorption - typical)) / typical


def find_chains(ridges: Ridges, field: Mask | None = None) -> list[Chain]:
    """Find the lines of a picture, those that absorb most in all first.

    Parameters
    ----------
    ridges : Ridges
    field : (rows, columns) array of bool, optional
        Where to look.
    """
    clear = ridges.absorption > np.maximum(CLEAR * ridges.noise, LEAST_CLEAR)
    dim = ridges.absorption > np.maximum(DIM * ridges.noise, LEAST_DIM)
    lines = ridges.crest & dim
    if field is not None:
        lines &= field
    labels, count = ndimage.label(lines, _SQUARE)
    if count == 0:
        return []
    strong = np.bincount(labels[clear & lines], minlength=count + 1)
    lines &= (strong >= 3)[labels] & (labels > 0)
    thin = require("skimage.morphology", "fluoroscopy").skeletonize(lines)
    pieces = [
        Chain(points.astype(float), ridges.absorption[tuple(points.T[::-1])].astype(float))
        for points in _pieces(thin)
    ]
    chains = [part for chain in _linked(pieces) for part in (chain, *_parts(chain))]
    return sorted(chains, key=lambda chain: -chain.length * chain.typical)


def _parts(chain: Chain) -> list[Chain]:
    """Both parts of a chain whose absorption changes suddenly: a device that ends upon a wire."""
    log = np.log(chain.absorption)
    log = np.where(np.isfinite(log), log, middle(log))
    around = np.arange(PART, len(log) - PART)
    if len(around) == 0:
        return []
    smooth = ndimage.median_filter(log, 15)
    change = np.abs(smooth[around + PART // 2] - smooth[around - PART // 2])
    at = int(around[np.argmax(change)])
    before, behind = middle(log[:at]), middle(log[at:])
    if abs(before - behind) < np.log(CHANGE):
        return []
    return [
        Chain(chain.points[part], chain.absorption[part]) for part in (slice(at), slice(at, None))
    ]


def _pieces(thin: Mask) -> list[npt.NDArray[np.int_]]:
    """Ordered pixels (n, 2) of each stretch of a skeleton between its ends and junctions."""
    neighbors = ndimage.convolve(thin.astype(np.uint8), _SQUARE.astype(np.uint8), mode="constant")
    junctions = thin & (neighbors > 3)
    stretches = thin & ~ndimage.binary_dilation(junctions, _SQUARE)
    labels, _ = ndimage.label(stretches, _SQUARE)
    found = []
    for number, place in enumerate(ndimage.find_objects(labels), start=1):
        row, column = np.nonzero(labels[place] == number)
        if len(row) < SHORTEST:
            continue
        origin = [place[1].start, place[0].start]
        found.append(_ordered(np.column_stack([column, row])) + origin)
    return found


def _ordered(pixels: npt.NDArray[np.int_]) -> npt.NDArray[np.int_]:
    """Pixels of a line without junctions, from one end to the other."""
    left = {(int(x), int(y)) for x, y in pixels}
    beside = [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]

    def next_to(x: int, y: int) -> tuple[int, int] | None:
        return next(((x + i, y + j) for i, j in beside if (x + i, y + j) in left), None)

    ways = []
    at: tuple[int, int] | None = next(iter(left))
    start = at
    for _ in range(2):  # from anywhere to one end, and to the other
        way = []
        while at is not None:
            left.discard(at)
            way.append(at)
            at = next_to(*at)
        ways.append(way)
        at = next_to(*start) if start is not None else None
    return np.array(ways[1][::-1] + ways[0])


def _linked(pieces: list[Chain]) -> list[Chain]:
    """Join pieces that go on in each other, the best matches first."""
    if not pieces:
        return []
    ends = np.array([chain.points[side] for chain in pieces for side in (0, -1)])
    outward = np.array([_outward(chain.points[::step]) for chain in pieces for step in (1, -1)])
    typical = np.array(
        [_absorption_at_end(chain.absorption[::step]) for chain in pieces for step in (1, -1)]
    )
    length = np.repeat([chain.length for chain in pieces], 2)
    one, two = np.triu_indices(len(ends), 1)
    near = (one // 2 != two // 2) & (
        np.abs(ends[one] - ends[two]).max(axis=1) < np.minimum(LONGEST_GAP, 8 + length[one])
    )
    one, two = one[near], two[near]
    gap = ends[two] - ends[one]
    distance = np.linalg.norm(gap, axis=1)
    direction = gap / np.maximum(distance, 1e-9)[:, None]
    # The way across the gap turns at both of its ends; over a short one, pixels decide nothing.
    leaving = _angle(outward[one], direction)
    arriving = _angle(-outward[two], direction)
    turn = _angle(outward[one], -outward[two])
    close = distance < 6
    bend = np.where(close, turn, np.maximum(np.maximum(leaving, arriving), turn))
    quotient = np.abs(np.log(typical[one] / typical[two]))
    allowed = (bend < MOST_TURN) & (quotient < np.log(MOST_QUOTIENT))
    allowed &= ~close | (np.maximum(leaving, arriving) < 1.6)
    cost = distance / 12 + 2 * bend + quotient
    partner = np.full(len(ends), -1)
    group = np.arange(len(pieces))
    for i in np.argsort(np.where(allowed, cost, np.inf))[: int(allowed.sum())]:
        a, b = one[i], two[i]
        if partner[a] < 0 and partner[b] < 0 and group[a // 2] != group[b // 2]:
            partner[a], partner[b] = b, a
            group[group == group[b // 2]] = group[a // 2]
    return [_join(pieces, partner, members) for members in _groups(group)]


def _groups(group: npt.NDArray[np.int_]) -> list[npt.NDArray[np.int_]]:
    return [np.flatnonzero(group == number) for number in np.unique(group)]


def _join(
    pieces: list[Chain], partner: npt.NDArray[np.int_], members: npt.NDArray[np.int_]
) -> Chain:
    """One chain of linked pieces; end 2k is the first point of piece k, 2k + 1 its last."""
    end = next(2 * k + side for k in members for side in (0, 1) if partner[2 * k + side] < 0)
    points: list[Floats] = []
    absorption: list[Floats] = []
    while end >= 0:
        step = 1 if end % 2 == 0 else -1
        piece = pieces[end // 2]
        if points:
            bridge = np.linspace(points[-1][-1], piece.points[::step][0], 6)[1:-1]
            points.append(bridge)
            absorption.append(np.full(len(bridge), np.nan))
        points.append(piece.points[::step].astype(float))
        absorption.append(piece.absorption[::step])
        end = partner[end + step]
    return Chain(np.concatenate(points), np.concatenate(absorption))


def _absorption_at_end(absorption: Floats) -> float:
    """Absorption near the first point of a piece, without what a crossing there adds to it."""
    near = absorption[min(10, len(absorption) // 2) : 30]
    return middle(near)


def _outward(points: Floats) -> Floats:
    """Unit vector (2,) in which a piece leaves at its first point."""
    away = points[0] - points[min(len(points) - 1, 10)]
    return np.asarray(away / np.linalg.norm(away))


def _angle(one: Floats, two: Floats) -> Floats:
    return np.asarray(np.arccos(np.clip(np.sum(one * two, axis=1), -1, 1)))
