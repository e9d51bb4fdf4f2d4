"""`stereosom endoscopy`: a stereo recording and its calibration."""

from __future__ import annotations

import argparse
from typing import Any

from ..acquisition import Acquisition
from ..errors import InputError
from .reconstructing import reconstruct_and_report
from .words import add_run_words

DOES = "reconstruct a stereo endoscope's recording"
EXAMPLE = "stereosom endoscopy left.mp4 right.mp4 --rig calibration.yaml --output out --render"
_LAYOUTS = ("side-by-side", "top-bottom", "interleaved", "interleaved-frames")


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument(
        "inputs",
        nargs="+",
        metavar="LEFT RIGHT | STACKED",
        help="films, folders of pictures or pictures of both eyes, or one that holds both",
    )
    parser.add_argument(
        "--rig", required=True, metavar="CALIBRATION", help="of both eyes, in any known format"
    )
    parser.add_argument("--layout", choices=_LAYOUTS, help="how one film holds both eyes")
    parser.add_argument(
        "--right-first", action="store_true", help="in one film, the right eye comes first"
    )
    parser.add_argument("--rectified", action="store_true", help="take the calibration's P1 and P2")
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of pictures")
    found = parser.add_argument_group("what tells the device from what is behind it")
    found.add_argument(
        "--background", nargs=2, metavar=("LEFT", "RIGHT"), help="pictures without the device"
    )
    found.add_argument(
        "--color-box", type=_box, metavar="X,Y,W,H",
        help="a box on the device in the first left picture: its color is learned there",
    )  # fmt: skip
    found.add_argument(
        "--width", type=float, metavar="PX", help="greatest width of the device in a picture"
    )
    parser.add_argument(
        "--show-masks", action="store_true", help="also write segmentation_0000.png, ..."
    )
    add_run_words(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct a stereo endoscope's recording."""
    from ..endoscopy import read_stereo

    if len(arguments.inputs) > 2:
        raise InputError(
            "endoscopy", f"{len(arguments.inputs)} inputs were given", "give LEFT RIGHT, or one"
        )
    left, right = (*arguments.inputs, None)[:2]
    acquisition = read_stereo(
        left,
        right,
        arguments.rig,
        layout=arguments.layout,
        right_first=arguments.right_first,
        rectified=arguments.rectified,
        rate_hz=arguments.rate,
    )
    both = chosen_segmenter(vars(arguments), acquisition)
    return reconstruct_and_report(acquisition, both, arguments)


def chosen_segmenter(options: dict[str, Any], acquisition: Acquisition) -> Any:
    """What finds the device in each eye's pictures, as the options of a call have it."""
    from ..segmentation.endoscope import segmenter

    ways: dict[str, Any] = {}
    if options["background"]:
        ways["background"] = tuple(_picture(path) for path in options["background"])
    if options["color_box"]:
        first = (options["frames"] or (0, None))[0] or 0
        ways |= {"color_box": options["color_box"], "example": acquisition[first].image_a}
    return segmenter(width_px=options["width"], **ways)


def _picture(path: str) -> Any:
    from pathlib import Path

    from ..endoscopy.pictures import Pictures

    return Pictures([Path(path)]).frame(0)


def _box(text: str) -> tuple[int, int, int, int]:
    values = [int(part) for part in text.split(",")]
    if len(values) != 4:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y,W,H")
    return (values[0], values[1], values[2], values[3])
