"""What a file holds, read with care: bounded size and depth, nothing in it is ever executed.

Calibration files travel between laboratories, and some formats can be made to exhaust or
crash their usual readers (aliases in YAML, entities in XML, depth in any of them). Here text
is at most 1 MiB and 32 levels deep, aliases and entities are refused, and MATLAB's binary
files are read in a child process.
"""

from __future__ import annotations

import configparser
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from stereosom.arrays import Floats

from ..errors import InputError, require
from .mat_file import load_mat

MOST_BYTES = 1 << 20
MOST_BYTES_OF_JSON = 16 << 20  # a rig.json has two matrices per frame
MOST_DEPTH = 32

Kind = Literal["json", "yaml", "xml", "ini", "text", "mat"]


@dataclass(frozen=True)
class Content:
    """A file as its syntax says, before anybody asks what it means.

    `tree` is a dict for JSON, YAML (every scalar a string), INI and MATLAB files, an Element
    for XML, and the text itself for `kind == "text"`.
    """

    path: Path
    kind: Kind
    tree: Any


def read_content(path: Path) -> Content:
    """Read a file by what its first bytes say it is.

    Raises
    ------
    InputError
        Where it cannot be read, is too large or too deep, or is broken.
    """
    data = read_bytes(path, MOST_BYTES_OF_JSON)
    if data.startswith(b"MATLAB 5.0 MAT-file"):
        return Content(path, "mat", load_mat(path))
    if data.startswith((b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file")):
        raise InputError(path, "is MATLAB 7.3", "save it with -v7 in MATLAB")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(
            path, "is no text", "give a calibration file, see docs/calibration.md"
        ) from None
    start = text.lstrip()
    if not start.startswith("{") and len(data) > MOST_BYTES:
        raise InputError(path, "is larger than 1 MiB", "keep only the matrices in it")
    if "\0" in text or not start:
        raise InputError(path, "is empty or no text", "give a calibration file")
    try:
        if start.startswith("{"):
            return Content(path, "json", _parse_json(start))
        if start.startswith("<"):
            return Content(path, "xml", parse_xml(start))
        if start.startswith(("[", ";", "#")) and "\n[" in "\n" + start and "fc_x" in start:
            return Content(path, "ini", _parse_ini(start))
        if start.lower().startswith("image size"):
            return Content(path, "text", text)
        return Content(path, "yaml", _parse_yaml(start))
    except RecursionError:
        raise InputError(path, "is nested too deeply", "give a calibration file") from None
    except ValueError as error:
        why, _, mend = " ".join(str(error).split()).partition("; ")
        raise InputError(path, why[:300], mend or "give a calibration file") from None


def read_bytes(path: Path, at_most: int) -> bytes:
    """The whole of a file that is not too large."""
    try:
        if not path.is_file():
            why = "is a folder" if path.is_dir() else "no such file"
            raise InputError(path, why, "check the path")
        with path.open("rb") as file:
            data = file.read(at_most + 1)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "check the path") from None
    if len(data) > at_most:
        raise InputError(path, f"is larger than {at_most >> 20} MiB", "give a calibration file")
    return data


def numbers(node: Any, name: str, shape: tuple[int, ...] | None = None) -> Floats:
    """Numbers as any of the formats writes them: nested lists, text, OpenCV's matrices.

    Raises
    ------
    ValueError
        Where there are others, too many, or not the shape that is wanted.
    """
    matrix: Floats
    if isinstance(node, dict) and "data" in node:
        matrix = numbers(node["data"], name).ravel()
        if "rows" in node and "cols" in node:
            rows, cols = (_whole(node[side], name) for side in ("rows", "cols"))
            if rows < 0 or cols < 0 or rows * cols != len(matrix):
                raise ValueError(f"{name}: {len(matrix)} numbers, not {rows}×{cols}")
            matrix = matrix.reshape(rows, cols)
    else:
        if isinstance(node, str):
            node = node.replace(",", " ").split()
        try:
            matrix = np.array(node).astype(np.float64)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{name}: does not hold numbers") from None
    if not np.isfinite(matrix).all():
        raise ValueError(f"{name}: holds values that are not finite numbers")
    if shape is not None:
        if matrix.size != np.prod(shape):
            wanted, have = ("×".join(map(str, sides)) for sides in (shape, matrix.shape))
            raise ValueError(f"{name}: must be {wanted}, is {have or 'a single number'}")
        matrix = matrix.reshape(shape)
    return matrix


def parse_xml(text: str) -> Element:
    """Parse XML without entities, and no deeper than 32 levels.

    Raises
    ------
    ValueError
        Where it is broken, too deep, or declares entities.
    """
    builder, parser, depth = TreeBuilder(), expat.ParserCreate(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MOST_DEPTH:
            raise ValueError("is nested too deeply")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def doctype(name: str, system: str | None, public: str | None, inside: bool) -> None:
        # A bare `<!DOCTYPE RTKGEOMETRY>` stands in every file of RTK, and does nothing.
        if system or public or inside:
            raise ValueError("declares XML entities or a DTD, which are not read; remove them")

    def entity(*_: Any) -> None:
        raise ValueError("declares XML entities, which are not read; remove them")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = parser.SkippedEntityHandler = entity
    try:
        parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise ValueError(f"is broken XML ({error})") from None
    except LookupError:  # an encoding that nobody knows
        raise ValueError("is broken XML (unknown encoding)") from None
    return builder.close()


def _parse_json(text: str) -> dict[str, Any]:
    try:
        tree = json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"is no JSON ({error})") from None
    except ValueError:  # a number of more than 4300 digits
        raise ValueError("is no JSON of a calibration (a number in it is absurd)") from None
    assert isinstance(tree, dict)  # it begins with a brace
    return tree


def _parse_ini(text: str) -> dict[str, dict[str, str]]:
    parser = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise ValueError(f"is broken INI ({error.message.splitlines()[0]})") from None
    return {section: dict(parser.items(section)) for section in parser.sections()}


def _parse_yaml(text: str) -> dict[str, Any]:
    """Parse YAML to strings, lists and dicts: no tag constructs anything, no alias is followed."""
    yaml = require("yaml", "endoscopy")

    class Plain(yaml.BaseLoader):  # type: ignore[misc, name-defined]
        """PyYAML's loader without types, which also counts levels and refuses aliases."""

        depth = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise ValueError("holds YAML aliases, which are not followed; write values out")
            self.depth += 1
            if self.depth > MOST_DEPTH:
                raise ValueError("is nested too deeply")
            node = super().compose_node(parent, index)
            self.depth -= 1
            return node

    lines = text.splitlines()
    # OpenCV up to 4 writes `%YAML:1.0`, which is no directive of YAML.
    body = "\n".join(lines[1:] if lines[0].startswith("%YAML") else lines)
    try:
        tree = yaml.load(body, Loader=Plain)
    except yaml.YAMLError as error:
        raise ValueError(f"is no calibration that is known (as YAML: {_first(error)})") from None
    if not isinstance(tree, dict):
        raise ValueError("is no calibration that is known; see docs/calibration.md")
    return tree


def _first(error: Any) -> str:
    mark = getattr(error, "problem_mark", None)
    where = f" in line {mark.line + 1}" if mark else ""
    return f"{getattr(error, 'problem', None) or 'broken'}{where}"


def _whole(node: Any, name: str) -> int:
    try:
        return int(node)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: {str(node)[:20]!r} is no number of rows") from None


def plain_keys(tree: Iterable[tuple[Any, Any]]) -> dict[str, Any]:
    """Keys in small letters, without what programs put between words."""
    return {
        "".join(letter for letter in str(key).lower() if letter.isalnum()): value
        for key, value in tree
    }
