"""The `stereosom` command: its words, its help, and its one line for what goes wrong."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NoReturn

from .errors import InputError

_NOT_A_DEVICE = "Research software, not a medical device."
_VECTOR_OPTIONS = {"--base", "--direction"}


def main(
    words: Sequence[str] | None = None,
    *,
    progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> int:
    """Run the command; returns the exit code.

    `progress` wraps the frames of a run, for programs that show how far it is in their own way.

    0: every frame reconstructed. 1: some frames failed, the rest are written. 2: the input
    or the call is wrong, with one line on standard error.
    """
    words = _joined(sys.argv[1:] if words is None else list(words))
    try:
        arguments = _parser().parse_args(words)
        arguments.progress = progress
        return int(arguments.run(arguments))
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
    from .commands import COMMANDS
    from .version import generator

    parser = _Parser(
        prog="stereosom",
        description="Two views of a thin flexible device in, its 3D backbone out. " + _NOT_A_DEVICE,
        epilog="Begin with: stereosom demo",
    )
    parser.add_argument("--version", action="version", version=generator())
    choices = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        words = choices.add_parser(
            name,
            help=command.does,
            description=f"{command.does[0].upper()}{command.does[1:]}. {_NOT_A_DEVICE}",
            epilog=f"Example: {command.example}",
        )
        words.set_defaults(command=name, run=command.run)
        command.add_words(words)
    return parser


def _joined(words: Sequence[str]) -> list[str]:
    """`--base -5,0,2` as `--base=-5,0,2`: argparse takes the former's value for an option."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] in _VECTOR_OPTIONS and re.match(r"-[\d.]", word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


if __name__ == "__main__":
    raise SystemExit(main())
