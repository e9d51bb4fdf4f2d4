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


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct a biplane X-ray run from DICOM."""
    from ..fluoroscopy import read_biplane
    from ..segmentation import segment_xray

    return reconstruct_and_report(read_biplane(*arguments.inputs), segment_xray, arguments)
