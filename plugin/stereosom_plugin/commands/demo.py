"""`stereosom demo`: the study that ships, from its DICOM to a picture."""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from ..evaluation import evaluate
from . import fluoroscopy
from .evaluate import table
from .words import add_run_words

DOES = "reconstruct and draw the study that ships"
EXAMPLE = "stereosom demo"


def add_words(parser: argparse.ArgumentParser) -> None:
    """Say which words the command takes."""
    add_run_words(parser, output="stereosom-demo")
    parser.set_defaults(**fluoroscopy.LEFT_OUT)


def run(arguments: argparse.Namespace) -> int:
    """Reconstruct the study that ships, draw it, and compare it with its truth."""
    with sample_folder() as sample:
        arguments.inputs = [str(sample / "plane_a.dcm"), str(sample / "plane_b.dcm")]
        arguments.command, arguments.render = "fluoroscopy", True
        code = fluoroscopy.run(arguments)
        if not arguments.json and not arguments.quiet:
            print("\nagainst the truth, mm:")
            print(table(evaluate(arguments.output, sample)))
            print(f"\nlook at {Path(arguments.output) / 'scene.png'}")
    return code


def sample_folder() -> Any:
    """Context that gives the folder of the sample study, from the wheel or the checkout."""
    shipped = files("stereosom_plugin") / "sample"
    if shipped.is_dir():
        return as_file(shipped)
    return nullcontext(Path(__file__).parents[3] / "data" / "biplane")
