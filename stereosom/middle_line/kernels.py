"""The inner loops of middle lines."""

from __future__ import annotations

from functools import cache
from types import ModuleType

from ..loops import fastest


@cache
def kernels() -> ModuleType:
    """`compiled` where numba is installed, else `reference`."""
    return fastest(__package__)
