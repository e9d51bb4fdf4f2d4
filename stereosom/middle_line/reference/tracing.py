"""Along the pixels of a skeleton, from node to node."""

from __future__ import annotations

import numpy as np

from ...arrays import Booleans, Integers

# Steps to the neighbors of a pixel: (rows down, columns to the right).
STRAIGHT = ((-1, 0), (0, 1), (1, 0), (0, -1))
DIAGONAL = ((-1, -1), (-1, 1), (1, -1), (1, 1))


def trace(skeleton: Booleans) -> tuple[Integers, Integers, Integers]:
    """The ways between the nodes of a skeleton: its ends and its crossings.

    Pixels with more than two neighbors that touch are one node.

    Parameters
    ----------
    skeleton : (rows, columns) array of bool

    Returns
    -------
    nodes : (k, 2) array
        Where each way begins, and where it stops.
    stops : (k,) array
        Where its pixels end among all of them.
    pixels : (n, 2) array
        Of one way after the other, as (row, column).
    """
    pixels = np.argwhere(skeleton)
    links = _links(pixels, skeleton.shape)
    nodes = _nodes(links)
    between, stops, ways = [], [], []
    used: set[tuple[int, int]] = set()
    for pixel, node in nodes.items():
        for first in links[pixel]:
            if nodes.get(first) == node or (pixel, first) in used:
                continue
            way = [pixel, first]
            while way[-1] not in nodes:
                here, before = way[-1], way[-2]
                way.append(next(link for link in links[here] if link != before))
            used |= {(way[0], way[1]), (way[-1], way[-2])}
            between.append((node, nodes[way[-1]]))
            ways += way
            stops.append(len(ways))
    return (
        np.array(between, dtype=np.intp).reshape(-1, 2),
        np.array(stops, dtype=np.intp),
        pixels[np.array(ways, dtype=np.intp)],
    )


def _links(pixels: Integers, shape: tuple[int, ...]) -> list[list[int]]:
    """Neighbors of each pixel (n, 2); diagonal ones only where no straight way leads there."""
    place = np.full((shape[0] + 2, shape[1] + 2), -1)
    row, column = pixels.T + 1
    place[row, column] = np.arange(len(pixels))
    straight = [place[row + down, column + right] for down, right in STRAIGHT]
    diagonal = []
    for down, right in DIAGONAL:
        beside = (place[row + down, column] >= 0) | (place[row, column + right] >= 0)
        diagonal.append(np.where(beside, -1, place[row + down, column + right]))
    near = np.stack(straight + diagonal, axis=1)
    return [[link for link in links if link >= 0] for links in near.tolist()]


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
