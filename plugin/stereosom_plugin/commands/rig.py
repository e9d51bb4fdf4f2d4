"""`stereosom rig`: any calibration as a `rig.json`, and what it says in millimetres."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import get_args

from ..calibration import Calibration, read_calibration, write_rig
from ..calibration.board import Pattern, calibrate
from ..calibration.model import MM_PER
from ..calibration.plausibility import measure
from ..errors import InputError

DOES = "read a calibration of any known format, and write a rig.json"
EXAMPLE = "stereosom rig cam1.txt cam2.txt --units cm --output rig.json"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument(
        "calibration", nargs="*", metavar="CALIBRATION",
        help="one file for both views, or one per view: first view a (left)",
    )  # fmt: skip
    parser.add_argument("--output", metavar="RIG.json", help="where to write it")
    parser.add_argument("--units", choices=sorted(MM_PER), help="of the file (default: mm)")
    parser.add_argument(
        "--image-size", type=_size, metavar="WxH", help="of the pictures, where the file is silent"
    )
    parser.add_argument("--rectified", action="store_true", help="take P1 and P2")
    parser.add_argument(
        "--fisheye", action="store_true", help="four coefficients are of the fisheye model"
    )
    parser.add_argument("--pixel-spacing", type=float, metavar="MM", help="on the detector (RTK)")
    parser.add_argument(
        "--pitch", type=float, metavar="MM", help="between dots (fundamental matrix)"
    )
    board = parser.add_argument_group("a calibration from pictures of a board")
    board.add_argument(
        "--calibrate", nargs=2, metavar=("LEFT_FOLDER", "RIGHT_FOLDER"), help="pictures of a board"
    )
    board.add_argument("--board", type=_size, metavar="9x6", help="inner corners, or circles")
    board.add_argument("--square", type=float, metavar="MM", help="between neighboring corners")
    board.add_argument(
        "--pattern", choices=get_args(Pattern), default="chessboard", help="of the board"
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of text")


def run(arguments: argparse.Namespace) -> int:
    """Read, report and write a calibration."""
    if arguments.calibrate:
        return _calibrate(arguments)
    calibration = read_calibration(
        arguments.calibration,
        units=arguments.units,
        image_size=arguments.image_size,
        rectified=arguments.rectified,
        fisheye=arguments.fisheye,
        pixel_spacing=arguments.pixel_spacing,
        pitch=arguments.pitch,
    )
    return report_and_write(calibration, arguments)


def _calibrate(arguments: argparse.Namespace) -> int:
    if arguments.calibration or not arguments.board or not arguments.square:
        raise InputError(
            "--calibrate",
            "needs --board and --square, and no other calibration",
            "give e.g. --calibrate left right --board 9x6 --square 5",
        )
    calibration, table = calibrate(
        *arguments.calibrate,
        board=arguments.board,
        square=arguments.square,
        pattern=arguments.pattern,
    )
    if not arguments.json:
        print("reprojection error, px RMS: left, right")
        for row in table:
            print(f"  {row.left_px:6.3f} {row.right_px:6.3f}  {row.left}, {row.right}")
    return report_and_write(calibration, arguments)


def report_and_write(calibration: Calibration, arguments: argparse.Namespace) -> int:
    """Say what was understood, and write it where asked."""
    if arguments.output and not Path(arguments.output).name.endswith(".json"):
        raise InputError("--output", f"{arguments.output} is no .json", "name a rig.json")
    for note in calibration.notes:
        print(f"stereosom: note: {note}", file=sys.stderr)
    if arguments.output:
        write_rig(calibration.rigs, arguments.output, calibration.lenses)
    if arguments.json:
        print(json.dumps(_measured(calibration), indent=1))
    else:
        print("\n".join(_lines(calibration)))
        if arguments.output:
            print(f"written to {arguments.output}")
    return 0


def _measured(calibration: Calibration) -> dict[str, object]:
    measures = asdict(measure(calibration.rigs[0]))
    lenses = [type(lens).__name__ for lens in calibration.lenses or ()]
    return {
        "recognized": calibration.source,
        "rigs": len(calibration.rigs),
        **measures,
        "lenses": lenses,
        "notes": list(calibration.notes),
    }


def _lines(calibration: Calibration) -> list[str]:
    rig = calibration.rigs[0]
    measures = measure(rig)
    count = len(calibration.rigs)
    frames = f", {count} frames (the first is shown)" if count > 1 else ""
    lines = [
        f"recognized: {calibration.source}{frames}",
        f"baseline {measures.baseline_mm:.2f} mm, views {measures.convergence_deg:.1f}° apart",
    ]
    for name, camera, scale, lens in zip(
        "ab", (rig.a, rig.b), measures.mm_per_pixel, calibration.lenses or (None, None), strict=True
    ):
        width, height = camera.image_size
        lines.append(
            f"view {name}: {width}×{height} px, focal length {camera.focal_length:.1f} px, "
            f"{scale:.4f} mm per pixel {measures.center_named}, {lens or 'no lens distortion'}"
        )
    return lines


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and 0 < int(width) < 1 << 16
            and 0 < int(height) < 1 << 16):  # fmt: skip
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT")
    return int(width), int(height)
