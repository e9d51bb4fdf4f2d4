"""The inner loops of segmentation."""

from __future__ import annotations

from functools import cache
from types import ModuleType

from stereosom.loops import fastest


@cache
def loops() -> ModuleType:
    """`compiled` where numba is installed, else `reference`."""
    return fastest(__name__)
