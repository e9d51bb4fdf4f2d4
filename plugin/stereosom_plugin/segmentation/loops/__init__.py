"""The inner loops of segmentation."""

from __future__ import annotations

from functools import cache
from types import ModuleType

import numpy as np

from stereosom.loops import fastest


def bring_up() -> None:
    """Bring numba up now: a process that is forked afterwards need not do so once more."""
    loops().medians(np.zeros((1, 1)))


@cache
def loops() -> ModuleType:
    """`compiled` where numba is installed, else `reference`."""
    return fastest(__name__)
