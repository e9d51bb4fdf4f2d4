"""The inner loops of segmentation: compiled where numba is installed, else in plain numpy."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from types import ModuleType

import numpy as np


def bring_up() -> None:
    """Bring numba up now: a process that is forked afterwards need not do so once more."""
    loops().medians(np.zeros((1, 1)))


@cache
def loops() -> ModuleType:
    """`compiled` or `reference`; made at first use, because importing numba takes a second."""
    from . import reference

    if find_spec("numba") is None:
        return reference
    try:
        from . import compiled
    except RuntimeError:  # numba's, where no folder is left to keep compiled code in
        return reference
    return compiled
