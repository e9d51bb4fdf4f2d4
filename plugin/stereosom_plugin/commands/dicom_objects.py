"""`--dicom-sr` and `--dicom-seg`: a finished run as DICOM objects, beside its own files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..acquisition import Acquisition, FramePair
from ..centerline import read_vtp
from ..dicom_out import Origin, write_centerlines, write_masks
from ..output import DICOM_CENTERLINES, DICOM_MASKS, centerline_path, read_table
from ..segmentation import Mask, Segmentation, observe
from .reconstructing import say, warn


def write_dicom_objects(
    acquisition: Acquisition, segment: Segmentation, origin: Origin, arguments: argparse.Namespace
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
        algorithm = "files" if arguments.masks else arguments.segmenter
        for view, masks in enumerate(_masks(acquisition, segment, frames)):
            path = folder / DICOM_MASKS[view]
            sources = (origin.frames_a, origin.frames_b)[view]
            wanted = [sources[frame] for frame in frames]
            write_masks(masks, wanted, origin, path, algorithm=algorithm)
            say(arguments, f"written {path}")


def _masks(
    acquisition: Acquisition, segment: Segmentation, frames: list[int]
) -> tuple[Iterator[Mask], ...]:
    """Segment the pictures once more: masks are not kept during a run. Frames of either view."""
    kept: tuple[dict[int, Any], ...] = ({}, {})

    def keep(frame: int, _: FramePair, *masks: Mask) -> None:
        for of_view, mask in zip(kept, masks, strict=True):
            of_view[frame] = np.packbits(mask)  # an eighth of the memory

    for _ in observe(acquisition, segment, frames=frames, show=keep):
        pass

    def unpacked(view: int, shape: tuple[int, int]) -> Iterator[Mask]:
        for frame in frames:
            bits = kept[view].get(frame, np.zeros(-(-shape[0] * shape[1] // 8), dtype=np.uint8))
            yield np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape).astype(bool)

    rig = acquisition.rigs[0]
    return tuple(unpacked(i, camera.image_size[::-1]) for i, camera in enumerate((rig.a, rig.b)))
