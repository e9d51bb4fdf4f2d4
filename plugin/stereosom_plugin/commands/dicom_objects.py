"""`--dicom-sr` and `--dicom-seg`: a finished run as DICOM objects, beside its own files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..acquisition import Acquisition
from ..centerline import read_vtp
from ..dicom_out import Origin, write_centerlines, write_masks
from ..output import DICOM_CENTERLINES, DICOM_MASKS, centerline_path, read_table
from ..segmentation import Segment, observe
from .reconstructing import say, warn


def write_dicom_objects(
    acquisition: Acquisition, segment: Segment, origin: Origin, arguments: argparse.Namespace
) -> None:
    """Write what was asked for, of all frames that the output folder has."""
    folder = Path(arguments.output)
    rows = sorted(read_table(folder), key=lambda row: int(row["frame"]))
    if arguments.dicom_sr:
        curves = [row for row in rows if row["status"] in ("ok", "predicted")]
        if curves:
            write_centerlines(
                [read_vtp(centerline_path(folder, int(row["frame"]))) for row in curves],
                origin,
                acquisition.rigs,
                folder / DICOM_CENTERLINES,
                predicted=[int(row["frame"]) for row in curves if row["status"] == "predicted"],
                notes=acquisition.notes,
            )
            say(arguments, f"written {folder / DICOM_CENTERLINES}")
        else:
            warn(f"no frame has a centerline, so there is no {DICOM_CENTERLINES}")
    if arguments.dicom_seg:
        frames = [int(row["frame"]) for row in rows]
        for view, sources in enumerate((origin.frames_a, origin.frames_b)):
            write_masks(
                _masks(acquisition, segment, frames, view),
                [sources[frame] for frame in frames],
                origin,
                folder / DICOM_MASKS[view],
            )
            say(arguments, f"written {folder / DICOM_MASKS[view]}")


def _masks(
    acquisition: Acquisition, segment: Segment, frames: list[int], view: int
) -> Iterator[Any]:
    """Segment the pictures of one plane once more: masks are not kept during a run."""
    for seen in observe(acquisition, segment, frames=frames):
        width, height = (seen.rig.a, seen.rig.b)[view].image_size
        mask = np.zeros((height, width), dtype=bool)
        column, row = np.rint((seen.pixels_a, seen.pixels_b)[view]).astype(int).T
        mask[row, column] = True
        yield mask
