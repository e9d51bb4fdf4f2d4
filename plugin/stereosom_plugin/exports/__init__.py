"""Centerlines in the files of other programs: by suffix, one writer each.

`markups` and `sequence` are for 3D Slicer, `gltf` for Blender and web viewers, `web_page` for
a browser. Each takes the centerlines of a run, in order of time, and writes one file, whole or
not at all (`.seq.mrml` keeps its data in a folder beside it).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..centerline import Centerline
from ..errors import InputError
from .gltf import write_glb
from .markups import read_markups, write_markups
from .sequence import write_sequence
from .web_page import write_web_page

__all__ = [
    "SUFFIXES",
    "export",
    "read_markups",
    "write_glb",
    "write_markups",
    "write_sequence",
    "write_web_page",
]

SUFFIXES = {
    ".glb": "the tube for Blender, PowerPoint and web viewers; a run plays",
    ".html": "a page that any browser opens without a network; a run plays",
    ".mrk.json": "a curve that 3D Slicer edits, of one frame",
    ".seq.mrb": "a sequence that 3D Slicer plays",
    ".seq.mrml": "the same, its data in a folder beside it",
}


def export(lines: Sequence[Centerline], path: str | Path, *, color_by: str | None = None) -> None:
    """Write centerlines in the format that the file's name ends in.

    Parameters
    ----------
    lines : sequence of Centerline
        In order of time; at least one.
    path : path
        Ends in one of `SUFFIXES`.
    color_by : str, optional
        Point array that colors the tube (`.glb`, `.html`). Default: curvature, where known.

    Raises
    ------
    InputError
        Where the suffix is unknown, an array is missing or not finite, or the file cannot be
        written.
    """
    name = Path(path).name.lower()
    if not lines:
        raise InputError(path, "would be empty", "give a run with one frame that is ok")
    if name.endswith(".glb"):
        write_glb(lines, path, color_by=color_by)
    elif name.endswith(".html"):
        write_web_page(lines, path, color_by=color_by)
    elif name.endswith((".seq.mrb", ".seq.mrml")):
        write_sequence(lines, path)
    elif name.endswith(".mrk.json"):
        if len(lines) > 1:
            raise InputError(
                path, f"holds one curve, not {len(lines)}", "choose one with --frame N"
            )
        write_markups(lines[0], path)
    else:
        raise InputError(path, "ends in no known format", f"give one of {', '.join(SUFFIXES)}")
