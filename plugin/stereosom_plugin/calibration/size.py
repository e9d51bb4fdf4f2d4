"""Picture sizes of two meanings: some programs write width and height, some rows and columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stereosom.arrays import Floats


def ordered_size(
    said: Floats, intrinsics: Sequence[Floats], wanted: tuple[int, int] | None
) -> tuple[tuple[int, int], tuple[str, ...]]:
    """Width and height, and a note where the file seems to say height and width.

    A principal point lies near the middle of its picture. Where the other order brings it
    clearly nearer, that order is meant; what the caller says decides without asking.

    Examples
    --------
    >>> k = np.array([[883, 0, 445], [0, 883, 190], [0, 0, 1]])
    >>> ordered_size(np.array([480, 640]), [k], None)[0]
    (640, 480)
    """
    if np.any(said != np.rint(said)) or np.any(said < 1) or np.any(said > 1 << 16):
        raise ValueError(f"image size: {said[0]:g}, {said[1]:g} are no sides of a picture")
    width, height = int(said[0]), int(said[1])
    swapped = (height, width)
    if wanted is not None and tuple(wanted) in ((width, height), swapped):
        return (int(wanted[0]), int(wanted[1])), ()
    off = [
        np.mean([np.linalg.norm(k[:2, 2] / side - 0.5) for k in intrinsics])
        for side in (np.array([width, height]), np.array(swapped))
    ]
    if off[1] < 0.8 * off[0] - 1e-9:
        note = f"the picture size {width}, {height} is read as rows, columns"
        return swapped, (f"{note}: the principal point lies nearer to that middle",)
    return (width, height), ()
