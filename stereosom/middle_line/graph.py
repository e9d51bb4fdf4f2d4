"""The skeleton as a graph: ends and crossings, and the chains of pixels between them."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Booleans, Floats
from .kernels import kernels


@dataclass(frozen=True, eq=False)
class Chain:
    """A way between two nodes: pixels (n, 2) as (row, column), from `start` to `stop`."""

    start: int
    stop: int
    pixels: Floats

    @cached_property
    def length(self) -> float:
        """Along the pixels, px."""
        return polyline_length(self.pixels)

    def reversed(self) -> Chain:
        """The same from `stop` to `start`."""
        return Chain(self.stop, self.start, self.pixels[::-1])


def polyline_length(points: Floats) -> float:
    """Length of a polyline (n, 2) or (n, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def skeleton_chains(skeleton: Booleans) -> list[Chain]:
    """Chains of a skeleton; touching pixels with more than two neighbors are one node.

    Parameters
    ----------
    skeleton : (rows, columns) array of bool
    """
    nodes, stops, pixels = kernels().trace(skeleton)
    ways = np.split(pixels.astype(float), stops[:-1])
    # Of no stops, splitting makes one empty way.
    return [
        Chain(start, stop, way) for (start, stop), way in zip(nodes.tolist(), ways, strict=False)
    ]


def prune(chains: list[Chain], shortest: float) -> list[Chain]:
    """Take off dead ends shorter than `shortest`, the shortest first, and join what is left."""
    chains = list(chains)
    while True:
        degree = Counter(node for chain in chains for node in (chain.start, chain.stop))
        spurs = [
            (chain.length, place)
            for place, chain in enumerate(chains)
            if (degree[chain.start] == 1) != (degree[chain.stop] == 1)
        ]
        if spurs and min(spurs)[0] < shortest:
            chains.pop(min(spurs)[1])
        elif not _join_one(chains, degree):
            return chains


def _join_one(chains: list[Chain], degree: Counter[int]) -> bool:
    """Make one chain of two that meet where nothing else does; whether there were such."""
    meeting: dict[int, list[int]] = defaultdict(list)
    for place, chain in enumerate(chains):
        for node in {chain.start, chain.stop}:
            meeting[node].append(place)
    for node, places in meeting.items():
        if degree[node] == 2 and len(places) == 2:
            second, first = (chains.pop(place) for place in sorted(places, reverse=True))
            first = first if first.stop == node else first.reversed()
            second = second if second.start == node else second.reversed()
            pixels = np.vstack([first.pixels, second.pixels])
            chains.append(Chain(first.start, second.stop, pixels))
            return True
    return False
