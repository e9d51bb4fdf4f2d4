"""The subcommands of `stereosom`, a file each: its words, and what it does with them."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

from . import demo, endoscopy, evaluate, experiment, export, fluoroscopy, masks, render, rig

__all__ = ["COMMANDS", "Command"]


@dataclass(frozen=True)
class Command:
    """One subcommand: what it does, a call as an example, its words, and how it is run."""

    does: str
    example: str
    add_words: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]


COMMANDS = {
    module.__name__.rpartition(".")[2]: Command(
        module.DOES, module.EXAMPLE, module.add_words, module.run
    )
    for module in (fluoroscopy, endoscopy, masks, render, export, evaluate, rig, experiment, demo)
}
