"""`stereosom fluoroscopy`: a biplane X-ray run from DICOM."""

from __future__ import annotations

import argparse
import json

from ..errors import InputError
from .reconstructing import reconstruct_and_report
from .words import add_run_words

DOES = "reconstruct a biplane X-ray run from DICOM"
EXAMPLE = "stereosom fluoroscopy plane_a.dcm plane_b.dcm --output out --render"

# What the command alone can be asked for, as it is where nobody asks.
LEFT_OUT = {
    "describe": False,
    "dsa": False,
    "refine_geometry": False,
    "segmenter": "xray",
    "masks": None,
    "show_masks": False,
    "dicom_sr": False,
    "dicom_seg": False,
}


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="A.dcm B.dcm | FOLDER",
        help="the two planes in either order, or a folder that holds one pair; also the files "
        "of single-frame series, or one file with the frames of both planes",
    )
    add_run_words(parser, output_required=False)
    parser.add_argument(
        "--describe",
        action="store_true",
        help="print what is understood of the run (angles, frames, pairing, assumptions), and stop",
    )
    parser.add_argument(
        "--dsa",
        action="store_true",
        help="subtract the masks that the objects prescribe (digital subtraction angiography)",
    )
    parser.add_argument(
        "--refine-geometry",
        action="store_true",
        help="refine how the planes stand to each other from the device, and say what was changed",
    )
    parser.add_argument(
        "--segmenter",
        default="xray",
        metavar="NAME",
        help="what finds the device in a picture: xray (default), the path of a model.onnx, or "
        "package.module:function",
    )
    parser.add_argument(
        "--masks",
        nargs=2,
        metavar=("FOLDER_A", "FOLDER_B"),
        help="masks that are files already: pictures, white on the device, one per frame in order "
        "of their names, of plane A and plane B as --describe names them",
    )
    parser.add_argument(
        "--show-masks",
        action="store_true",
        help="also write segmentation_0000.png, ...: what was found in both views",
    )
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
    from ..segmentation import MaskFiles, Segmentation
    from ..segmentation.own import XRAY, load_segmenter

    if arguments.describe:
        return _describe(arguments)
    if arguments.output is None:
        raise InputError("--output", "is missing", "name a folder for the results; see --help")
    if arguments.masks and arguments.segmenter != XRAY:
        raise InputError("--masks", "and --segmenter exclude each other", "give one of them")
    segment: Segmentation = load_segmenter(arguments.segmenter)
    acquisition = read_biplane(arguments.inputs, dsa=arguments.dsa)
    if arguments.masks:
        folder_a, folder_b = arguments.masks
        segment = MaskFiles(folder_a, folder_b, acquisition)
    origin = None
    if arguments.dicom_sr or arguments.dicom_seg:
        from ..dicom_out import read_origin  # before a long run: it may refuse

        origin = read_origin(acquisition)
    if arguments.refine_geometry:
        from ..geometry_check import refine_geometry

        acquisition = refine_geometry(acquisition, segment)
    code = reconstruct_and_report(
        acquisition, segment, arguments, check_geometry=not arguments.refine_geometry
    )
    if origin is not None:
        from .dicom_objects import write_dicom_objects

        write_dicom_objects(acquisition, segment, origin, arguments)
    return code


def _describe(arguments: argparse.Namespace) -> int:
    """Print what is understood of the run."""
    from ..fluoroscopy import describe_biplane, description_text

    description = describe_biplane(arguments.inputs, dsa=arguments.dsa)
    print(json.dumps(description, indent=1) if arguments.json else description_text(description))
    return 0
