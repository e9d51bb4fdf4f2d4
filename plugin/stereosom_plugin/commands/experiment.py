"""`stereosom experiment`: published experiments, and ours."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..experiments import EXPERIMENTS
from .reconstructing import progress_bar

DOES = "repeat a published experiment, or one of ours"
EXAMPLE = "stereosom experiment table1 --output table1"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    parser.add_argument("name", choices=sorted(EXPERIMENTS))
    parser.add_argument("--output", metavar="OUT", help="folder (default: the name)")
    parser.add_argument("--quiet", action="store_true", help="no progress")


def run(arguments: argparse.Namespace) -> int:
    """Repeat an experiment; print what it found."""
    output = Path(arguments.output or arguments.name)
    progress = progress_bar(arguments, arguments.name)
    print(EXPERIMENTS[arguments.name](output, progress=progress))
    return 0
