"""A user's own segmentation, by name: an ONNX model, or a function of a module."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from stereosom_plugin.errors import InputError

from .observing import Segment
from .onnx_model import ModelError, OnnxModel
from .picture import Mask, checked
from .xray import segment_xray

XRAY = "xray"
_MEND = "give xray, a model.onnx, or package.module:function"


def load_segmenter(name: str) -> Segment:
    """Find a segmentation by its name.

    Parameters
    ----------
    name : str
        `xray`, the default; the path of an ONNX model (`OnnxModel` says what it must take and
        give); or `package.module:function`, a function of one picture, (rows, columns), that
        gives a mask of its size. Modules of the current folder are found.

    Returns
    -------
    callable
        Image to mask. It raises InputError where the model or the function fails on a picture.

    Raises
    ------
    InputError
        Where there is no such model or function, or it cannot be used.
    ImportError
        Where onnxruntime is missing.

    Examples
    --------
    >>> load_segmenter("numpy:isnan")(np.zeros((2, 3))).shape
    (2, 3)
    """
    if name == XRAY:
        return segment_xray
    if name.lower().endswith(".onnx"):
        try:
            model = OnnxModel(name)
        except ModelError as error:
            raise InputError(
                name, f"is no model that can be used: {error}", "see docs/segmentation.md"
            ) from None
        return _guarded(name, model)
    module, colon, function = name.partition(":")
    if not colon or not module or not function:
        raise InputError(f"--segmenter {name}", "names no segmentation", _MEND)
    return _guarded(name, _function(name, module, function))


def _function(name: str, module: str, function: str) -> Callable[[Any], Any]:
    here = os.getcwd()
    added = here not in sys.path
    if added:
        sys.path.insert(0, here)
    try:
        found = getattr(importlib.import_module(module), function, None)
    except Exception as error:  # whatever the module does when it is imported
        raise InputError(name, f"cannot be imported ({_line(error)})", _MEND) from None
    finally:
        if added:
            sys.path.remove(here)
    if not callable(found):
        raise InputError(name, f"{module} has no function {function}", _MEND)
    return found  # type: ignore[no-any-return]


def _guarded(name: str, segment: Callable[[Any], Any]) -> Segment:
    """The same, but what goes wrong is one line, and what comes out a mask."""

    def guarded(image: Any) -> Mask:
        picture = checked(image)
        try:
            said = np.asarray(segment(picture))
        except InputError:
            raise
        except Exception as error:
            raise InputError(name, f"fails on a picture ({_line(error)})", "mend it") from None
        if said.shape != picture.shape:
            shape = "×".join(map(str, said.shape)) or "a single value"
            raise InputError(
                name,
                f"gives {shape} for a picture of {'×'.join(map(str, picture.shape))}",
                "give a mask of the picture's rows and columns",
            )
        if said.dtype.kind not in "biuf" or not np.isfinite(said.astype(float)).all():
            raise InputError(name, "gives values that are no numbers", "give a boolean mask")
        return np.asarray(said, dtype=bool) if said.dtype.kind != "f" else np.asarray(said > 0.5)

    return guarded


def _line(error: BaseException) -> str:
    text = " ".join(str(error).split())[:200]
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
