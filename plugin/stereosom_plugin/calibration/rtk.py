"""RTK's geometry XML (ThreeDCircularProjectionGeometry, version 3)."""

from __future__ import annotations

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import StereoRig

from .content import Content, numbers
from .model import MM_PER, Calibration, checked_size
from .settings import Settings

SOURCE = "RTK geometry XML"


def read_rtk(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read one file of two projections, or two files of as many projections each.

    RTK's matrices (its documentation, "3D projection geometry") lead from mm about the
    isocenter to mm on the detector. Pixels are not in the file: its pictures are taken to be
    centered, with columns along u and rows along v.
    """
    if not all(
        content.kind == "xml" and content.tree.tag == "RTKThreeDCircularGeometry"
        for content in contents
    ):
        return None
    read = [_matrices(content) for content in contents]
    if len(read) == 1:
        if len(read[0]) != 2:
            raise ValueError(
                f"holds {len(read[0])} projections, not two; "
                "give two files where each plane has several"
            )
        read = [[matrix] for matrix in read[0]]
    if len(read[0]) != len(read[1]):
        raise ValueError(f"hold {len(read[0])} and {len(read[1])} projections; give as many each")
    if settings.pixel_spacing is None:
        raise ValueError("says no pixel spacing; give it with --pixel-spacing MM")
    width, height = checked_size(None, settings.image_size)
    scale = MM_PER[settings.units or "mm"]
    per_unit = scale / settings.pixel_spacing
    to_pixels = np.array(
        [[per_unit, 0, (width - 1) / 2], [0, per_unit, (height - 1) / 2], [0, 0, 1]]
    )
    in_mm = np.diag([1.0, 1.0, 1.0, scale])
    size = (width, height)
    rigs = tuple(
        StereoRig.from_projections(
            to_pixels @ matrix_a @ in_mm, to_pixels @ matrix_b @ in_mm, size, size
        )
        for matrix_a, matrix_b in zip(read[0], read[1], strict=True)
    )
    note = "the detector's picture is taken to be centered, its columns along u, its rows along v"
    return Calibration(rigs, None, SOURCE, (note,))


def _matrices(content: Content) -> list[Floats]:
    matrices = []
    for projection in content.tree.iter("Projection"):
        text = projection.findtext("Matrix")
        if text is None:
            raise ValueError("a projection has no Matrix; write it with RTK 1.4 or later")
        matrices.append(numbers(text, "Matrix", (3, 4)))
    return matrices
