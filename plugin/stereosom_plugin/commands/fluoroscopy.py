"""`stereosom fluoroscopy`: a biplane X-ray run from DICOM."""

from __future__ import annotations

import argparse

from .reconstructing import reconstruct_and_report
from .words import add_run_words

DOES = "reconstruct a biplane X-ray run from DICOM"
EXAMPLE = "stereosom fluoroscopy plane_a.dcm plane_b.dcm --output out --render"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="A.dcm B.dcm | FOLDER",
        help="the two planes in either order, or a folder that holds one pair",
    )
    add_run_words(parser)
    parser.add_argument(
        "--dicom-sr",
        action="store_true",
        help="also write centerlines.dcm: the run as a DICOM Comprehensive 3D SR",
    )
    parser.add_argument(
        "--dicom-seg",
        action="store_true",
        help="also write masks_a.dcm and masks_b.dcm: DICOM segmentations of both planes",
    )


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct a biplane X-ray run from DICOM."""
    from ..fluoroscopy import read_biplane
    from ..segmentation import segment_xray

    acquisition = read_biplane(*arguments.inputs)
    origin = None
    if arguments.dicom_sr or arguments.dicom_seg:
        from ..dicom_out import read_origin  # before a long run: it may refuse

        origin = read_origin(acquisition)
    code = reconstruct_and_report(acquisition, segment_xray, arguments)
    if origin is not None:
        from .dicom_objects import write_dicom_objects

        write_dicom_objects(acquisition, segment_xray, origin, arguments)
    return code
