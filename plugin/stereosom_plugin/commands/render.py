"""`stereosom render`: pictures of a result, without a screen."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..calibration import read_rig
from ..centerline import read_vtp
from ..errors import InputError
from ..output import RIG, centerline_path, read_table
from .drawing import draw, source_pictures
from .reconstructing import say, warn

DOES = "draw a result, without a screen"
EXAMPLE = "stereosom render out --output picture.png"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument("input", metavar="OUT | FILE.vtp", help="a folder of results, or one file")
    parser.add_argument("--output", required=True, metavar="PICTURE.png")
    parser.add_argument("--frame", type=int, metavar="N", help="of a folder; default: the first")
    parser.add_argument(
        "--color-by", default="Curvature", choices=("Curvature", "StandardDeviation")
    )
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")


def run(arguments: argparse.Namespace) -> int:
    """Draw one frame of an output folder, or a `.vtp`."""
    path, picture = Path(arguments.input), Path(arguments.output)
    if picture.suffix.lower() != ".png":
        raise InputError(picture, "is no .png", "give --output a name that ends in .png")
    folder = path if path.is_dir() else path.parent
    if path.is_dir():
        rows = read_table(path)
        with_curve = [int(row["frame"]) for row in rows if row["status"] in ("ok", "predicted")]
        if not with_curve:
            raise InputError(path, "holds no centerline", "render a run with one frame that is ok")
        frame = with_curve[0] if arguments.frame is None else arguments.frame
        path = centerline_path(path, frame)
    line = read_vtp(path)
    rigs = read_rig(folder / RIG) if (folder / RIG).exists() else ()
    images = source_pictures(folder, line.frame)
    if images is None and not arguments.quiet:
        warn("the pictures that it was made of are not found: it is drawn without them")
    draw(line, rigs, images, picture, color_by=arguments.color_by)
    say(arguments, str(picture))
    return 0
