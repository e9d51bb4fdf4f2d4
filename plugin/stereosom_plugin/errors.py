"""The one error that a user is meant to read."""

from __future__ import annotations

import importlib
from types import ModuleType


class InputError(ValueError):
    """Something that was given cannot be used: what, why, and how to mend it.

    Examples
    --------
    >>> str(InputError("a.dcm", "no such file", "check the path"))
    'a.dcm: no such file; check the path'
    """

    def __init__(self, what: object, why: str, mend: str) -> None:
        self.what, self.why, self.mend = str(what), why, mend
        super().__init__(f"{self.what}: {self.why}; {self.mend}")

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        # So that it passes from one process to another (`ahead`).
        return type(self), (self.what, self.why, self.mend)


def require(module: str, extra: str) -> ModuleType:
    """Import a module, or raise the ImportError that names the extra which brings it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"{module.partition('.')[0]} is missing ({error}); "
            f"install it with: pip install 'stereosom[{extra}]'"
        ) from error
