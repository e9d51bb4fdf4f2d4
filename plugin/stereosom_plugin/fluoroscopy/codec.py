"""JPEG, JPEG-LS and JPEG 2000 through SimpleITK, in a child process.

Native decoders meet bytes from elsewhere here. In the child they may crash, hang, or ask for
gigabytes: the run goes on, and one frame is reported broken. The child stays warm from frame
to frame. It is this file run by itself, so that it loads nothing but SimpleITK.
"""

from __future__ import annotations

import atexit
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from multiprocessing.util import Finalize
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

SECONDS_A_FRAME = 60.0
BYTES_OF_CHILD = 4 << 30


class CodecError(Exception):
    """One frame cannot be decoded; says why."""


class _ChildDied(Exception):
    """The child is of no more use."""


class _Child:
    """A decoder process, and the folder through which files pass."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="stereosom-"))
        # -P: the modules beside this file must not shadow anything.
        self.process = subprocess.Popen(
            [sys.executable, "-P", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def decode(self, file: bytes) -> npt.NDArray[Any]:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        source = self.folder / "frame.dcm"
        source.write_bytes(file)
        watchdog = threading.Timer(SECONDS_A_FRAME, self.process.kill)
        watchdog.start()
        try:
            self.process.stdin.write(f"{source}\n")
            self.process.stdin.flush()
            answer = self.process.stdout.readline().strip()
        except OSError:
            answer = ""
        finally:
            watchdog.cancel()
        if answer == "done":
            return np.asarray(np.load(source.with_suffix(".npy"), allow_pickle=False))
        if answer:
            raise CodecError(answer)
        raise _ChildDied("its decoder died of it, or took too long")

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()
        shutil.rmtree(self.folder, ignore_errors=True)


_child: _Child | None = None
_lock = threading.Lock()


def decode_with_simpleitk(file: bytes) -> npt.NDArray[Any]:
    """Decode a one-frame DICOM file.

    Parameters
    ----------
    file : bytes
        The whole file.

    Returns
    -------
    (rows, columns) array

    Raises
    ------
    CodecError
        Where it cannot be decoded.
    """
    global _child
    if importlib.util.find_spec("SimpleITK") is None:
        from stereosom_plugin.errors import require

        require("SimpleITK", "fluoroscopy")
    with _lock:
        if _child is None:
            _child = _Child()
            # In a copy of the process (`ahead`), nothing that is registered with atexit runs.
            Finalize(None, _close, exitpriority=1)
        try:
            return _child.decode(file)
        except _ChildDied as error:
            _close()
            raise CodecError(str(error)) from None


@atexit.register
def _close() -> None:
    global _child
    if _child is not None:
        _child.close()
        _child = None


def _forget() -> None:
    """In a copy of the process: the decoder belongs to the other."""
    global _child, _lock
    _child, _lock = None, threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def _serve() -> None:
    """Child: a path a line comes in, the picture goes beside it, a line goes out."""
    # What libraries print must not mix with the answers.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (BYTES_OF_CHILD, BYTES_OF_CHILD))
    except (ImportError, ValueError, OSError):  # no such limits on this system
        pass
    import SimpleITK

    for line in sys.stdin:
        source = Path(line.rstrip("\n"))
        try:
            image = SimpleITK.ReadImage(str(source), imageIO="GDCMImageIO")
            picture = SimpleITK.GetArrayFromImage(image)
            np.save(source.with_suffix(".npy"), picture.reshape(picture.shape[-2:]))
            answers.write("done\n")
        except (Exception, MemoryError):
            answers.write("cannot be decoded\n")


if __name__ == "__main__":
    _serve()
