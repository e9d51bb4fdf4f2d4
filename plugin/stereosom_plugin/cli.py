"""The `stereosom` command: its words, its help, and its one line for what goes wrong."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from stereosom.reconstruct import DEFAULT_METHOD, METHODS

from .errors import InputError
from .experiments import EXPERIMENTS

_NOT_A_DEVICE = "Research software, not a medical device."
_VECTOR_OPTIONS = {"--base", "--direction"}


def main(words: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code.

    0: every frame reconstructed. 1: some frames failed, the rest are written. 2: the input
    or the call is wrong, with one line on standard error.
    """
    words = _joined(sys.argv[1:] if words is None else list(words))
    try:
        arguments = _parser().parse_args(words)
        from . import commands

        run: Callable[[argparse.Namespace], int] = getattr(commands, arguments.run)
        return run(arguments)
    except (_WrongCall, InputError, ImportError) as error:
        return _refuse(str(error))
    except ValueError as error:  # an option that the core refuses says what, why and how
        return _refuse(f"{error}; see stereosom --help")
    except KeyboardInterrupt:
        print("stereosom: interrupted; the same call goes on where it stopped", file=sys.stderr)
        return 130
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if os.environ.get("STEREOSOM_TRACEBACK"):
            raise
        return _refuse(
            f"unexpected {type(error).__name__}: {error}; this is a fault of stereosom: "
            "set STEREOSOM_TRACEBACK=1, run it again and report what it prints"
        )


class _WrongCall(Exception):
    """The words of the call are not understood."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, as everywhere else."""
        raise _WrongCall(f"{message}; see {self.prog} --help")


def _refuse(text: str) -> int:
    print("stereosom: error: " + " ".join(text.split()), file=sys.stderr)
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="stereosom",
        description="Two views of a thin flexible device in, its 3D backbone out. " + _NOT_A_DEVICE,
        epilog="Begin with: stereosom demo",
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    fluoroscopy = _command(
        commands, "fluoroscopy", "reconstruct a biplane X-ray run from DICOM",
        "stereosom fluoroscopy plane_a.dcm plane_b.dcm --output out --render",
    )  # fmt: skip
    fluoroscopy.add_argument(
        "inputs", nargs="+", metavar="A.dcm B.dcm | FOLDER",
        help="the two planes in either order, or a folder that holds one pair",
    )  # fmt: skip
    _add_run_options(fluoroscopy)

    masks = _command(
        commands, "masks", "reconstruct pairs of mask pictures",
        "stereosom masks a.png b.png --rig rig.json --output out",
        run="from_masks",
    )  # fmt: skip
    masks.add_argument("a", metavar="A.png | FOLDER_A", help="view a, white on the device")
    masks.add_argument("b", metavar="B.png | FOLDER_B", help="view b")
    masks.add_argument(
        "--rig", required=True, metavar="RIG", help="rig.json: where the views stood"
    )
    masks.add_argument("--rate", type=float, metavar="HZ", help="frames per second of folders")
    _add_run_options(masks)

    render = _command(
        commands, "render", "draw a result, without a screen",
        "stereosom render out --output picture.png",
    )  # fmt: skip
    render.add_argument("input", metavar="OUT | FILE.vtp", help="a folder of results, or one file")
    render.add_argument("--output", required=True, metavar="PICTURE.png")
    render.add_argument("--frame", type=int, metavar="N", help="of a folder; default: the first")
    render.add_argument(
        "--color-by", default="Curvature", choices=("Curvature", "StandardDeviation")
    )
    render.add_argument("--quiet", action="store_true", help="say nothing but errors")

    evaluate = _command(
        commands, "evaluate", "compare centerlines with the truth",
        "stereosom evaluate out --truth study/",
        run="evaluation",
    )  # fmt: skip
    evaluate.add_argument("input", metavar="OUT | FILE.vtp")
    evaluate.add_argument(
        "--truth", required=True, metavar="TRUTH.csv | FOLDER",
        help="x, y, z in mm from base to tip; a folder holds truth_NNN.csv by frame",
    )  # fmt: skip
    evaluate.add_argument("--json", action="store_true", help="print JSON instead of a table")

    experiment = _command(
        commands, "experiment", "repeat a published experiment, or one of ours",
        "stereosom experiment table1 --output table1",
    )  # fmt: skip
    experiment.add_argument("name", choices=sorted(EXPERIMENTS))
    experiment.add_argument("--output", metavar="OUT", help="folder (default: the name)")
    experiment.add_argument("--quiet", action="store_true", help="no progress")

    demo = _command(commands, "demo", "reconstruct and draw the study that ships", "stereosom demo")
    _add_run_options(demo, output="stereosom-demo")
    return parser


def _command(
    commands: argparse._SubParsersAction[_Parser],
    name: str,
    does: str,
    example: str,
    run: str | None = None,
) -> argparse.ArgumentParser:
    parser = commands.add_parser(
        name,
        help=does,
        description=f"{does[0].upper()}{does[1:]}. {_NOT_A_DEVICE}",
        epilog=f"Example: {example}",
    )
    parser.set_defaults(command=name, run=run or name)
    return parser


def _add_run_options(parser: argparse.ArgumentParser, output: str | None = None) -> None:
    parser.add_argument(
        "--output", required=output is None, default=output, metavar="OUT",
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


def _joined(words: Sequence[str]) -> list[str]:
    """`--base -5,0,2` as `--base=-5,0,2`: argparse takes the former's value for an option."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in _VECTOR_OPTIONS and re.match(r"-[\d.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _vector(text: str) -> list[float]:
    values = [float(part) for part in text.split(",")]
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


if __name__ == "__main__":
    raise SystemExit(main())
