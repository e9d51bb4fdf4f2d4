"""What Slicer lacks is installed when it is needed; what Slicer has is never replaced."""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distributions, version
from importlib.util import find_spec
from pathlib import Path

OLDEST_PYTHON = (3, 11)
# Slicer's own builds: a second copy from pip would crash the application.
NEVER = ("vtk", "SimpleITK", "numpy")


class CannotInstall(RuntimeError):
    """What is missing cannot be had; says why, and what to do, in one line."""


@dataclass(frozen=True)
class Package:
    """A package: the module it is imported by, how pip calls it, its least major version."""

    module: str
    requirement: str
    least: int = 0

    def missing(self) -> bool:
        """Whether it is not there, or too old."""
        if find_spec(self.module) is None:
            return True
        try:
            return self.least > int(version(self.module).partition(".")[0])
        except (PackageNotFoundError, ValueError):
            return False


def own_package(here: Path = Path(__file__)) -> Package:
    """`stereosom` itself: of the checkout that this module lies in, else by its name."""
    above = here.resolve().parents
    checkout = above[4] if len(above) > 4 else here
    in_checkout = (checkout / "pyproject.toml").is_file() and (checkout / "stereosom").is_dir()
    return Package("stereosom_plugin", str(checkout) if in_checkout else "stereosom")


SCIPY = Package("scipy", "scipy>=1.11")
SCIKIT_IMAGE = Package("skimage", "scikit-image>=0.22")
PYDICOM = Package("pydicom", "pydicom>=3.0", least=3)


def needed(*, dicom: bool) -> list[Package]:
    """What a run needs; DICOM files need one package more."""
    return [own_package(), SCIPY, SCIKIT_IMAGE, *([PYDICOM] if dicom else [])]


def check_python(python: Sequence[int] = tuple(sys.version_info[:2])) -> None:
    """Raise CannotInstall where this Slicer's Python is too old."""
    if tuple(python[:2]) < OLDEST_PYTHON:
        raise CannotInstall(
            f"This 3D Slicer runs Python {python[0]}.{python[1]}, and Stereo SOM needs 3.11 or "
            "newer: install a 3D Slicer of mid-2025 or later (Python 3.12)."
        )


def install_missing(
    packages: Sequence[Package],
    *,
    install: Callable[[list[str]], object],
    agree: Callable[[str], bool],
) -> list[str]:
    """Install what is missing, and nothing else.

    Parameters
    ----------
    packages : sequence of Package
    install : callable
        `slicer.util.pip_install`: takes pip's arguments.
    agree : callable
        Asked with one sentence before anything is downloaded.

    Returns
    -------
    list of str
        What was installed.

    Raises
    ------
    CannotInstall
        Where the user does not agree, or pip fails.
    """
    wanted = [package.requirement for package in packages if package.missing()]
    if not wanted:
        return []
    if not agree(f"Stereo SOM needs to install {', '.join(wanted)} into 3D Slicer's Python."):
        raise CannotInstall(f"Not installed: {', '.join(wanted)}. Apply again to be asked anew.")
    handle, name = tempfile.mkstemp(prefix="stereosom-constraints-", suffix=".txt", text=True)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write("\n".join(constraints()) + "\n")
        install([*wanted, "--constraint", name])
    except Exception as error:
        raise CannotInstall(
            f"{', '.join(wanted)} could not be installed beside what 3D Slicer has "
            f"({type(error).__name__}: {error}); see the Python console."
        ) from error
    finally:
        os.unlink(name)
    importlib.invalidate_caches()
    if left := [package.requirement for package in packages if package.missing()]:
        raise CannotInstall(f"{', '.join(left)}: still missing; restart 3D Slicer and try again.")
    return wanted


def constraints() -> list[str]:
    """Lines that keep pip from changing anything that is there, each package at its version.

    VTK, SimpleITK and numpy of Slicer may bear no record that pip could see; then no version
    may be installed at all.
    """
    found = {
        str(name).lower(): f"{name}=={distribution.version}"
        for distribution in distributions()
        if (name := distribution.metadata["Name"]) and distribution.version
    }
    hidden = [f"{name}<0" for name in NEVER if name.lower() not in found]
    return [*sorted(found.values()), *hidden]
