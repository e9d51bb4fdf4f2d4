"""Name and version of this program."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache
def generator() -> str:
    """Name and version of this program, as files carry it."""
    try:
        return f"stereosom {version('stereosom')}"
    except PackageNotFoundError:  # a checkout on the path, as in 3D Slicer
        return "stereosom"
