"""`stereosom masks`: pairs of mask pictures."""

from __future__ import annotations

import argparse
from dataclasses import replace

from .. import masks, segmentation
from ..calibration import read_calibration
from ..errors import InputError
from .reconstructing import reconstruct_and_report
from .words import add_run_words

DOES = "reconstruct pairs of mask pictures"
EXAMPLE = "stereosom masks a.png b.png --rig rig.json --output out"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument("a", metavar="A.png | FOLDER_A", help="view a, white on the device")
    parser.add_argument("b", metavar="B.png | FOLDER_B", help="view b")
    parser.add_argument(
        "--rig",
        required=True,
        metavar="RIG",
        help="where the views stood: a rig.json or another calibration",
    )
    parser.add_argument("--rate", type=float, metavar="HZ", help="frames per second of folders")
    add_run_words(parser)


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct pairs of mask pictures."""
    found = read_calibration(arguments.rig)
    acquisition = masks.read_masks(
        arguments.a, arguments.b, found.rigs, rate_hz=arguments.rate, lenses=found.lenses
    )
    acquisition = replace(acquisition, notes=(*found.notes, *acquisition.notes))
    if len(acquisition) == 1:
        # Of a run, empty frames fail and the others are done; here nothing would be left.
        for path, image in zip(acquisition.sources, acquisition.read(0), strict=True):
            if not segmentation.binary(image).any():
                raise InputError(
                    path, "shows no device: the mask is empty", "give a mask that is white on it"
                )
    return reconstruct_and_report(acquisition, segmentation.binary, arguments)
