"""MATLAB's `.mat` files, read by scipy in a child process.

scipy's reader is native code that is not meant for bytes from strangers: here it may crash,
hang or ask for gigabytes, and one line says so. This file is run by itself as the child.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

MOST_SECONDS = 30
MOST_BYTES_OF_CHILD = 2 << 30
MOST_NUMBERS = 4096
MOST_LEVELS = 6


def load_mat(path: Path) -> dict[str, Any]:
    """Variables of a `.mat` file: nested lists of numbers, text, and dicts of them.

    Arrays of more than 4096 numbers are left out: no calibration has them. MATLAB objects,
    which no other program can read, are given as the text "object".

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    from stereosom_plugin.errors import InputError

    # -P: the modules beside this file must not shadow anything.
    call = [sys.executable, "-P", __file__, str(path)]
    try:
        done = subprocess.run(call, capture_output=True, timeout=MOST_SECONDS, check=False)
        answer = json.loads(done.stdout)
    except (subprocess.TimeoutExpired, ValueError):
        answer = "the reader died of it, or took too long"
    if not isinstance(answer, dict):
        raise InputError(path, f"cannot be read ({answer})", "save it again with -v7 in MATLAB")
    return answer


def _serve(path: str) -> dict[str, Any] | str:
    """Child: the file as JSON."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES_OF_CHILD, MOST_BYTES_OF_CHILD))
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS))
    except (ImportError, ValueError, OSError):  # no such limits on this system
        pass
    import numpy as np
    from scipy import io

    def plain(value: Any, level: int = 0) -> Any:
        if level > MOST_LEVELS:
            return None
        if isinstance(value, dict):
            return {str(key): plain(part, level + 1) for key, part in list(value.items())[:200]}
        if isinstance(value, str):
            return value[:1000]
        if isinstance(value, io.matlab.MatlabOpaque | io.matlab.MatlabFunction):
            return "object"
        array = np.asarray(value)
        if array.size > MOST_NUMBERS or array.dtype.kind not in "biuf":
            return None
        return array.tolist()

    try:
        small = [
            name
            for name, shape, kind in io.whosmat(path)[:1000]
            if kind != "cell" and np.prod(shape, dtype=float) <= MOST_NUMBERS
        ]
        loaded = io.loadmat(path, variable_names=small, simplify_cells=True)
        return {name: plain(value) for name, value in loaded.items() if not name.startswith("__")}
    except MemoryError:
        return "it is too large"
    except Exception as error:
        return " ".join(str(error).split())[:200] or type(error).__name__


if __name__ == "__main__":
    print(json.dumps(_serve(sys.argv[1])))
