"""Inner loops that are written twice: for numba to compile, and in plain numpy."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from types import ModuleType


def fastest(package: str) -> ModuleType:
    """The module `compiled` of a package where numba is installed, else its `reference`.

    Parameters
    ----------
    package : str
        Full name. Importing numba takes a second: ask at first use, and keep what is returned.
    """
    if find_spec("numba") is not None:
        try:
            return import_module(f"{package}.compiled")
        except RuntimeError:  # numba's, where no folder is left to keep compiled code in
            pass
    return import_module(f"{package}.reference")
