"""Pictures without a screen: find an OpenGL that works before VTK makes a window."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from functools import cache

from .errors import InputError

_CHOICE = "VTK_DEFAULT_OPENGL_WINDOW"
_WINDOWS = {"vtkEGLRenderWindow": "libEGL.so.1", "vtkOSOpenGLRenderWindow": "libOSMesa.so.8"}
_TRIAL = """
import sys
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(True)
window.SetSize(16, 16)
window.Render()
sys.exit(not window.SupportsOpenGL())
"""


@cache
def prepare() -> None:
    """Choose, once, how VTK renders off screen. Call it before the first window is made.

    On Linux a VTK without a working OpenGL does not complain, it ends the process: so each
    way is tried in a process of its own first (half a second). Elsewhere the system always
    has an OpenGL, and nothing is done. A choice already made in VTK_DEFAULT_OPENGL_WINDOW is
    the only one tried.

    Raises
    ------
    InputError
        Where no way works; it says what to install.
    """
    if not sys.platform.startswith("linux"):
        return
    chosen = os.environ.get(_CHOICE)
    loadable = [window for window, library in _WINDOWS.items() if _loads(library)]
    for window in [chosen] if chosen else loadable:
        if _works(window):
            os.environ[_CHOICE] = window
            return
    raise InputError(
        "rendering",
        "no OpenGL that works without a screen was found"
        + (f" ({_CHOICE} asks for {chosen})" if chosen else ""),
        "install one, on Debian and Ubuntu: apt-get install libegl1 libgl1-mesa-dri",
    )


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def _works(window: str) -> bool:
    """Whether a process of its own survives making a small picture."""
    command, environment = [sys.executable, "-c", _TRIAL], {**os.environ, _CHOICE: window}
    try:
        trial = subprocess.run(command, env=environment, capture_output=True, timeout=60)
    except subprocess.TimeoutExpired:
        return False
    return trial.returncode == 0
