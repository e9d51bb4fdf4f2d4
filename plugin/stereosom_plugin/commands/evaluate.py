"""`stereosom evaluate`: centerlines against the truth."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict

from ..evaluation import FrameErrors, evaluate

DOES = "compare centerlines with the truth"
EXAMPLE = "stereosom evaluate out --truth study/"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument("input", metavar="OUT | FILE.vtp")
    parser.add_argument(
        "--truth",
        required=True,
        metavar="TRUTH.csv | FOLDER",
        help="x, y, z in mm from base to tip; a folder holds truth_NNN.csv by frame",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")


def run(arguments: argparse.Namespace) -> int:
    """Compare centerlines with the truth."""
    errors = evaluate(arguments.input, arguments.truth)
    if arguments.json:
        print(json.dumps([asdict(frame) for frame in errors], indent=1))
    else:
        print(table(errors))
    return 0


def table(errors: Sequence[FrameErrors]) -> str:
    """Errors of each frame, mm, as lines of text."""
    columns = ("distance", "mean", "p95", "maximum", "base", "tip")
    lines = ["frame " + "".join(f"{name:>10}" for name in columns) + "   covered"]
    lines += [
        f"{frame.frame:5d} "
        + "".join(f"{getattr(frame, name):10.3f}" for name in columns)
        + f"{frame.covered:10.1%}"
        for frame in errors
    ]
    return "\n".join(lines)
