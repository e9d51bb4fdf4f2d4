"""The skeleton as a graph: ends and crossings, and the chains of pixels between them."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Booleans, Floats, Integers

# Steps to the neighbors of a pixel: (rows down, columns to the right).
_STRAIGHT = ((-1, 0), (0, 1), (1, 0), (0, -1))
_DIAGONAL = ((-1, -1), (-1, 1), (1, -1), (1, 1))


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
    pixels = np.argwhere(skeleton)
    links = _links(pixels, skeleton.shape)
    nodes = _nodes(links)
    chains = []
    used: set[tuple[int, int]] = set()
    for pixel, node in nodes.items():
        for first in links[pixel]:
            if nodes.get(first) == node or (pixel, first) in used:
                continue
            way = [pixel, first]
            while way[-1] not in nodes:
                onward = [link for link in links[way[-1]] if link != way[-2]]
                if not onward:
                    break
                way.append(onward[0])
            used |= {(way[0], way[1]), (way[-1], way[-2])}
            if way[-1] in nodes:
                chains.append(Chain(node, nodes[way[-1]], pixels[way].astype(float)))
    return chains


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


def _links(pixels: Integers, shape: tuple[int, ...]) -> list[list[int]]:
    """Neighbors of each pixel (n, 2); diagonal ones only where no straight way leads there."""
    place = np.full((shape[0] + 2, shape[1] + 2), -1)
    row, column = pixels.T + 1
    place[row, column] = np.arange(len(pixels))
    straight = [place[row + down, column + right] for down, right in _STRAIGHT]
    diagonal = []
    for down, right in _DIAGONAL:
        beside = (place[row + down, column] >= 0) | (place[row, column + right] >= 0)
        diagonal.append(np.where(beside, -1, place[row + down, column + right]))
    near = np.stack(straight + diagonal, axis=1)
    found = near >= 0
    flat, stops = near[found].tolist(), np.cumsum(found.sum(axis=1)).tolist()
    return [flat[start:stop] for start, stop in zip([0, *stops], stops, strict=False)]


def _nodes(links: list[list[int]]) -> dict[int, int]:
    """Node of each pixel that is an end or belongs to a crossing; others are not in it.

    A ring without either gets a node anywhere, or its chain would begin nowhere.
    """
    nodes: dict[int, int] = {}
    count = 0
    for pixel, near in enumerate(links):
        if len(near) == 2 or pixel in nodes:
            continue
        nodes[pixel] = count
        waiting = [pixel] if len(near) > 2 else []
        while waiting:
            for link in links[waiting.pop()]:
                if len(links[link]) > 2 and link not in nodes:
                    nodes[link] = count
                    waiting.append(link)
        count += 1
    if not nodes and links:
        nodes[0] = 0
    return nodes
