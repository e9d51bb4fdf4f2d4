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
    total = np.full((count, wide + 2 * most), -np.inf)  # beyond both sides there is no way
    inner = total[:, most : most + wide]
    inner[0] = score[0]
    before = np.lib.stride_tricks.sliding_window_view(total, wide, axis=1)  # (row, turn, place)
    priced, reached = price[:, None], np.empty((len(price), wide))
    for row in range(1, count):
        np.subtract(before[row - 1], priced, out=reached)
        np.maximum.reduce(reached, axis=0, out=inner[row])
        inner[row] += score[row]
    way = np.empty(count, dtype=np.intp)
    place = way[-1] = int(inner[-1].argmax())
    for row in range(count - 2, -1, -1):
        place += int((total[row, place : place + len(price)] - price).argmax()) - most
        way[row] = place
    return way
