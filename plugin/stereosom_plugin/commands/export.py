"""`stereosom export`: results in the files of other programs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from ..centerline import Centerline, read_vtp
from ..errors import InputError
from ..output import centerline_path, read_table
from .reconstructing import say

DOES = "write results for 3D Slicer, Blender or a browser"
EXAMPLE = "stereosom export out --output run.html"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument(
        "input",
        metavar="OUT | FILE.vtp | FILE.mrk.json",
        help="a folder of results, or one curve (a .mrk.json as 3D Slicer writes it)",
    )
    parser.add_argument(
        "--output",
        required=True,
        metavar="FILE",
        help=".glb and .html (tube, a run plays), .seq.mrb or .seq.mrml (3D Slicer sequence), "
        ".mrk.json (3D Slicer curve of one frame)",
    )
    parser.add_argument("--frame", type=int, metavar="N", help="of a folder; default: all")
    parser.add_argument(
        "--color-by",
        choices=("Curvature", "StandardDeviation", "Torsion", "Radius"),
        help="what colors a .glb or .html (default: Curvature)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace FILE")
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")


def run(arguments: argparse.Namespace) -> int:
    """Write an output folder, or one curve, in another format."""
    from .. import exports

    output = Path(arguments.output)
    if not output.name.lower().endswith(tuple(exports.SUFFIXES)):
        raise InputError(
            output, "ends in no known format", f"give one of {', '.join(exports.SUFFIXES)}"
        )
    if output.exists() and not arguments.overwrite:
        raise InputError(output, "exists already", "give another name, or --overwrite")
    path = Path(arguments.input)
    if path.is_dir():
        lines = _run_of(path, arguments.frame)
        if output.name.lower().endswith(".mrk.json"):
            lines = lines[:1]
    elif path.name.lower().endswith(".mrk.json"):
        lines = [exports.read_markups(path)]
    else:
        lines = [read_vtp(path)]
    exports.export(lines, output, color_by=arguments.color_by)
    numbers = [str(line.frame) for line in lines]
    say(arguments, f"{output}: frame {' to '.join(dict.fromkeys((numbers[0], numbers[-1])))}")
    return 0


def _run_of(folder: Path, wanted: int | None) -> list[Centerline]:
    """Centerlines of a folder, or the one of a frame."""
    rows = [row for row in read_table(folder) if row["status"] in ("ok", "predicted")]
    frames = [int(row["frame"]) for row in rows if row["frame"].isdecimal()]
    if not frames:
        raise InputError(folder, "holds no centerline", "give a run with one frame that is ok")
    if wanted is not None:
        if wanted not in frames:
            raise InputError(folder, f"has no centerline of frame {wanted}", "see its table")
        frames = [wanted]
    return [
        replace(read_vtp(centerline_path(folder, frame)), frame=frame) for frame in sorted(frames)
    ]
