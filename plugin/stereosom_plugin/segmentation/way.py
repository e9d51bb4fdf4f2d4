"""The best way through rows of scores, by dynamic programming."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .loops import loops


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
    return np.asarray(loops().best_way(score, price))
