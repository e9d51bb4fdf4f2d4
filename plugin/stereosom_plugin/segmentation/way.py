"""The best way through rows of scores, by dynamic programming."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def best_way(score: npt.NDArray[Any], price: npt.NDArray[Any]) -> npt.NDArray[np.intp]:
    """Place in each row (n,) of the way through scores (n, m) that collects most.

    Parameters
    ----------
    score : (n, m) array
    price : (2 k + 1,) array
        Of going on by -k to k places from one row to the next; no farther.

    Examples
    --------
    Two turns cost 0.4 and collect 3; straight on there is 1 to be had:

    >>> best_way(np.eye(3), np.array([0.2, 0, 0.2]))
    array([0, 1, 2])
    """
    count, wide = score.shape
    most = len(price) // 2
    came = np.empty((count, wide), dtype=np.intp)
    total = score[0].astype(float)
    padded = np.full(wide + 2 * most, -np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, wide)  # a row per turn
    priced = price[:, None]
    places = np.arange(wide)
    for row in range(1, count):
        padded[most : most + wide] = total
        reached = windows - priced
        best = came[row] = reached.argmax(axis=0)
        total = reached[best, places] + score[row]
    came += places - most
    way = np.empty(count, dtype=np.intp)
    way[-1] = int(total.argmax())
    for row in range(count - 1, 0, -1):
        way[row - 1] = came[row, way[row]]
    return way
