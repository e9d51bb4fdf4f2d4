"""The cheapest way through two sequences: compiled where numba is installed, else in numpy."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from types import ModuleType


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
