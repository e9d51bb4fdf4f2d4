"""Experiments that run again from one command: `stereosom experiment NAME --output FOLDER`."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

Progress = Callable[[Iterable[Any]], Iterable[Any]]


class Experiment(Protocol):
    """Writes its results to a folder; returns the text to print."""

    def __call__(self, output: Path, *, progress: Progress = iter) -> str:
        """Run it; `progress` wraps the longest loop, as tqdm does."""


def _table1(output: Path, *, progress: Progress = iter) -> str:
    """Section III and Table I of the paper, on rendered pictures of the mock-up."""
    from .table1 import run

    return run(output, progress=progress)


def _methods(output: Path, *, progress: Progress = iter) -> str:
    """Every method on the same masks."""
    from .methods import run

    return run(output, progress=progress)


def _limits(output: Path, *, progress: Progress = iter) -> str:
    """Errors beside the Cramér–Rao bound, by noise, angle, radius and resolution."""
    from .limits import run

    return run(output, progress=progress)


def _coverage(output: Path, *, progress: Progress = iter) -> str:
    """Whether true points lie where results say that they do."""
    from .coverage import run

    return run(output, progress=progress)


def _self_calibration(output: Path, *, progress: Progress = iter) -> str:
    """Wrong headers, as they are and refined from the device."""
    from .self_calibration import run

    return run(output, progress=progress)


EXPERIMENTS: MappingProxyType[str, Experiment] = MappingProxyType(
    {
        "coverage": _coverage,
        "limits": _limits,
        "methods": _methods,
        "self-calibration": _self_calibration,
        "table1": _table1,
    }
)
