"""The words that commands share, and how their values are read."""

from __future__ import annotations

import argparse

from stereosom.reconstruct import DEFAULT_METHOD, METHODS


def add_run_words(
    parser: argparse.ArgumentParser, output: str | None = None, *, output_required: bool = True
) -> None:
    """Add the words that every command shares which reconstructs a run."""
    parser.add_argument(
        "--output", required=output_required and output is None, default=output, metavar="OUT",
        help="folder for the .vtp files, the table and the pictures"
        + (f" (default: {output})" if output else ""),
    )  # fmt: skip
    parser.add_argument("--method", default=DEFAULT_METHOD, choices=sorted(METHODS))
    parser.add_argument(
        "--nodes",
        type=int,
        default=50,
        metavar="K",
        help="reference vectors of stereo-som (default: 50)",
    )
    prior = parser.add_argument_group("what is known beforehand")
    prior.add_argument("--base", type=_vector, metavar="X,Y,Z", help="where it begins, mm")
    prior.add_argument("--direction", type=_vector, metavar="X,Y,Z", help="of deployment there")
    prior.add_argument("--length", type=float, metavar="MM", help="deployed arc length")
    prior.add_argument("--radius", type=float, metavar="MM", help="of the device")
    parser.add_argument(
        "--frames", type=_slice, metavar="A:B", help="from frame A up to, not with, frame B"
    )
    step = parser.add_mutually_exclusive_group()
    step.add_argument(
        "--samples", type=_count, default=200, metavar="N", help="points a curve (default: 200)"
    )
    step.add_argument("--spacing", type=_positive, metavar="MM", help="longest step between points")
    parser.add_argument("--render", action="store_true", help="draw scene.png and overlays")
    parser.add_argument("--overwrite", action="store_true", help="replace results in OUT")
    parser.add_argument("--quiet", action="store_true", help="no progress, no summary")
    parser.add_argument("--json", action="store_true", help="print the table as JSON")


def _vector(text: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3:
        raise argparse.ArgumentTypeError(f"{text!r} is not X,Y,Z")
    return values


def _slice(text: str) -> tuple[int | None, int | None]:
    start, colon, stop = text.partition(":")
    if not colon:
        raise argparse.ArgumentTypeError(f"{text!r} is not A:B")
    return (int(start) if start else None, int(stop) if stop else None)


def _count(text: str) -> int:
    if (count := int(text)) < 2:
        raise argparse.ArgumentTypeError("a curve needs at least 2 points")
    return count


def _positive(text: str) -> float:
    if not 0 < (value := float(text)) < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number")
    return value
