"""A segmentation model in an ONNX file, run in a child process.

A model is a program from elsewhere, run by a native library: in the child it may crash, hang, or
ask for gigabytes, and the run goes on. The child is this file run by itself; pictures go in
through its standard input, and what the model says of them comes back through its standard output.
"""

from __future__ import annotations

import atexit
import importlib.util
import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

SECONDS_A_PICTURE = 60.0
SECONDS_TO_LOAD = 60.0
BYTES_OF_CHILD = 8 << 30
BYTES_OF_FILE = 2 << 30
# Networks halve their pictures some times; sides that are free are made a multiple of this.
MULTIPLE = 32


class ModelError(Exception):
    """The model cannot be used, or not on this picture; says why."""


class OnnxModel:
    """A model that tells, for each pixel of a picture, how likely it shows the device.

    Its one input is (1, 1, rows, columns) or (1, 3, rows, columns), float32: the picture
    stretched to 0 to 1, thrice where three channels are wanted. Its first output is
    (1, 1, rows, columns), or (1, 2, rows, columns) with the device second, or the same without
    the leading ones: probabilities, or logits where any value lies outside 0 to 1. Where the
    rows and columns of the input are free, the picture is continued to a multiple of 32; where
    they are fixed, it is scaled to them.

    Parameters
    ----------
    path : path
        The `.onnx` file.

    Raises
    ------
    ModelError
        Where the file is no model of this kind.
    ImportError
        Where onnxruntime is not installed; names the extra.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise ModelError("no such file")
        if self.path.stat().st_size > BYTES_OF_FILE:
            raise ModelError("is larger than 2 GiB")
        if importlib.util.find_spec("onnxruntime") is None:
            from stereosom_plugin.errors import require

            require("onnxruntime", "onnx")
        self._process: subprocess.Popen[bytes] | None = None
        self._start()

    def __call__(self, picture: Any) -> Any:
        """Whether each pixel shows the device, (rows, columns) of bool.

        Raises
        ------
        ModelError
        """
        import numpy as np

        if self._process is None:
            self._start()
        low, high = float(picture.min()), float(picture.max())
        stretched = (picture.astype(np.float32) - low) / max(high - low, 1e-6)
        rows, columns = stretched.shape
        data = stretched.astype("<f4").tobytes()
        header = json.dumps({"rows": rows, "columns": columns}).encode() + b"\n"
        answer, body = self._ask(header + data, SECONDS_A_PICTURE, rows * columns)
        if "error" in answer:
            raise ModelError(answer["error"])
        return np.frombuffer(body, dtype=np.uint8).reshape(rows, columns) > 0

    def close(self) -> None:
        """End the child."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None

    def _start(self) -> None:
        # -P: the modules beside this file must not shadow anything.
        self._process = subprocess.Popen(
            [sys.executable, "-P", __file__, str(self.path.resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        atexit.register(self.close)
        answer, _ = self._ask(b"", SECONDS_TO_LOAD, 0)
        if "error" in answer:
            self.close()
            raise ModelError(answer["error"])

    def _ask(self, data: bytes, seconds: float, expected: int) -> tuple[dict[str, Any], bytes]:
        assert self._process is not None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        watchdog = threading.Timer(seconds, self._process.kill)
        watchdog.start()
        try:
            self._process.stdin.write(data)
            self._process.stdin.flush()
            line = self._process.stdout.readline(100_000)
            answer = json.loads(line) if line.endswith(b"\n") else None
            body = b""
            if isinstance(answer, dict) and expected and "error" not in answer:
                body = self._process.stdout.read(expected)
        except (OSError, ValueError):
            answer, body = None, b""
        finally:
            watchdog.cancel()
        if not isinstance(answer, dict) or ("error" not in answer and len(body) != expected):
            self.close()
            raise ModelError("ended the process that ran it, or took too long")
        return answer, body


def _serve(path: str) -> None:
    """Child: load the model, then answer one picture after the other."""
    import os

    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print must not mix with the answers
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (BYTES_OF_CHILD, BYTES_OF_CHILD))
    except (ImportError, ValueError, OSError):  # no such limits on this system
        pass

    def answer(body: bytes = b"", **said: Any) -> None:
        answers.write(json.dumps(said).encode() + b"\n" + body)
        answers.flush()

    try:
        session, shape = _load(path)
    except Exception as error:
        answer(error=_said(error))
        return
    answer(loaded=True)
    while header := sys.stdin.buffer.readline():
        asked = json.loads(header)
        rows, columns = asked["rows"], asked["columns"]
        data = sys.stdin.buffer.read(4 * rows * columns)
        try:
            answer(_segment(session, shape, data, rows, columns), segmented=True)
        except (Exception, MemoryError) as error:
            answer(error=_said(error))


def _load(path: str) -> tuple[Any, list[Any]]:
    import onnxruntime

    onnxruntime.set_default_logger_severity(4)
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    inputs = session.get_inputs()
    if len(inputs) != 1:
        raise ValueError(f"has {len(inputs)} inputs instead of one picture")
    shape = list(inputs[0].shape)
    if inputs[0].type != "tensor(float)" or len(shape) != 4:
        raise ValueError(f"its input is {inputs[0].type} of {len(shape)} axes, not float of 4")
    if isinstance(shape[1], int) and shape[1] not in (1, 3):
        raise ValueError(f"its input has {shape[1]} channels, not 1 or 3")
    return session, shape


def _segment(session: Any, shape: list[Any], data: bytes, rows: int, columns: int) -> bytes:
    import numpy as np

    picture = np.frombuffer(data, dtype="<f4").reshape(rows, columns)
    size = []
    for wanted, length in zip(shape[2:], (rows, columns), strict=True):
        size.append(wanted if isinstance(wanted, int) else -(-length // MULTIPLE) * MULTIPLE)
    fixed = isinstance(shape[2], int) or isinstance(shape[3], int)
    if max(size) > 8192:
        raise ValueError(f"wants pictures of {size[1]}×{size[0]} pixels")
    if fixed:
        fitted = _scaled(picture, size)
    else:
        fitted = np.pad(picture, ((0, size[0] - rows), (0, size[1] - columns)), mode="edge")
    channels = 3 if shape[1] == 3 else 1
    given = np.repeat(fitted[None, None].astype(np.float32), channels, axis=1)
    said = np.asarray(session.run(None, {session.get_inputs()[0].name: given})[0], dtype=float)
    found = said.reshape(said.shape[-3:]) if said.ndim == 4 and len(said) == 1 else said
    if found.ndim == 3 and len(found) == 2:
        likely = found[1] - found[0]
        level = 0.0
    else:
        likely = found[0] if found.ndim == 3 and len(found) == 1 else found
        level = 0.5 if likely.size and likely.min() >= 0 and likely.max() <= 1 else 0.0
    if likely.ndim != 2 or not np.isfinite(likely).all():
        raise ValueError(f"answers {'×'.join(map(str, said.shape))} values, not one per pixel")
    if list(likely.shape) != size:
        likely = _scaled(likely, size)
    likely = _scaled(likely, [rows, columns]) if fixed else likely[:rows, :columns]
    return bytes((likely > level).astype(np.uint8).tobytes())


def _scaled(picture: Any, size: list[int]) -> Any:
    """A picture of another size, by straight lines between pixel centers."""
    import numpy as np
    from scipy import ndimage

    rows, columns = picture.shape
    at = np.meshgrid(
        (np.arange(size[0]) + 0.5) * rows / size[0] - 0.5,
        (np.arange(size[1]) + 0.5) * columns / size[1] - 0.5,
        indexing="ij",
    )
    return ndimage.map_coordinates(picture, at, order=1, mode="nearest")


def _said(error: BaseException) -> str:
    """An error in one line of printable text."""
    text = " ".join(str(error).split()) or type(error).__name__
    text = "".join(letter for letter in text if letter.isprintable())
    return text if len(text) < 200 else text[:197] + "..."


if __name__ == "__main__":
    _serve(sys.argv[1])
