"""3D Slicer's sequences: the models of a run by time, as `.seq.mrb` or `.seq.mrml`.

The layout is the one that `vtkMRMLSequenceStorageNode` of Slicer 5.11 writes: a scene of one
model node per time, a singleton sequence node that says which belongs to which time, and a
data file each. A bundle (`.seq.mrb`) holds them in a zip; beside a `.seq.mrml` the data files
lie in a folder, where any program finds them.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from urllib.parse import quote
from xml.sax.saxutils import quoteattr

from ..centerline import Centerline
from ..errors import InputError
from ..files import sweep, write_whole
from ..vtp_text import text_of

# No clock: the same centerlines give the same bytes.
_STAMP = (1980, 1, 1, 0, 0, 0)
_DATA_FILE = re.compile(r"centerline_\d+\.vtp")


def write_sequence(lines: Sequence[Centerline], path: str | Path) -> None:
    """Write a `.seq.mrb` or `.seq.mrml` of models with all their arrays, by time in seconds.

    The data files of `run.seq.mrml` go into the folder `run.seq.data`; the scene, which names
    them, is written last.

    Raises
    ------
    InputError
        Where a file cannot be written, or the data folder holds files of others.
    """
    path = Path(path)
    if path.suffix.lower() == ".mrml":
        _write_scene_and_data(lines, path)
        return
    folder = path.name.removesuffix(".mrb")
    with write_whole(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as bundle:

        def add(name: str, text: str) -> None:
            bundle.writestr(zipfile.ZipInfo(f"{folder}/{name}", _STAMP), text.encode("utf-8"))

        add(f"{folder.removesuffix('.seq')}.mrml", _scene(lines, "Data"))
        for number, line in enumerate(lines):
            add(f"Data/{_file_name(number)}", text_of(line))


def _write_scene_and_data(lines: Sequence[Centerline], path: Path) -> None:
    data = path.with_name(f"{path.name[: -len('.mrml')]}.data")
    if path.is_dir():
        raise InputError(path, "cannot be written (it is a folder)", "give another name")
    try:
        data.mkdir(exist_ok=True)
        sweep(data)
        left = [file.name for file in data.iterdir()]
        if not all(_DATA_FILE.fullmatch(name) for name in left):
            raise InputError(data, "holds other files", "give --output another name")
        path.unlink(missing_ok=True)  # a scene never names data of another run
        for name in left:
            (data / name).unlink()
    except OSError as error:
        why = f"cannot be written ({error.strerror or error})"
        raise InputError(data, why, "give a folder that exists and may be written to") from error
    try:
        for number, line in enumerate(lines):
            with write_whole(data / _file_name(number)) as part:
                part.write_text(text_of(line), encoding="utf-8")
        with write_whole(path) as part:
            part.write_text(_scene(lines, data.name), encoding="utf-8")
    except InputError:  # the disk is full: what nothing names is not left behind
        for number in range(len(lines)):
            (data / _file_name(number)).unlink(missing_ok=True)
        data.rmdir()
        raise


def _file_name(number: int) -> str:
    return f"centerline_{number}.vtp"


def _scene(lines: Sequence[Centerline], folder: str) -> str:
    # Slicer tells the times apart by this tolerance.
    gaps = [b.time - a.time for a, b in pairwise(lines) if b.time > a.time]
    tolerance = min([1e-3, *(gap / 10 for gap in gaps)])
    nodes = []
    for number in range(len(lines)):
        model = {
            "id": f"vtkMRMLModelNode{number + 1}",
            "name": "centerline",
            "hideFromEditors": "false",
            "attributes": "Sequences.BaseName:centerline",
            "references": f"storage:vtkMRMLModelStorageNode{number + 1};",
        }
        storage = {
            "id": f"vtkMRMLModelStorageNode{number + 1}",
            "name": f"ModelStorage_{number}",
            "fileName": f"{_encoded(folder)}/{_file_name(number)}",
            "useCompression": "1",
            "coordinateSystem": "LPS",
        }
        nodes += [_node("Model", model), _node("ModelStorage", storage)]
    index = {
        "id": "vtkMRMLSequenceNodeSequenceIndex",
        "name": "Sequence",
        "hideFromEditors": "false",
        "singletonTag": "SequenceIndex",
        "indexName": "time",
        "indexUnit": "s",
        "indexType": "numeric",
        "numericIndexValueTolerance": f"{tolerance:.3g}",
        "indexValues": ";".join(
            f"vtkMRMLModelNode{number + 1}:{line.time:.9g}" for number, line in enumerate(lines)
        ),
    }
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<MRML version="Slicer 5.11.0" userTags="">\n'
        + "\n".join([*nodes, _node("Sequence", index)])
        + "\n</MRML>\n"
    )


def _encoded(name: str) -> str:
    """Percent signs for what Slicer decodes; it takes other letters as they are."""
    return "".join(quote(letter) if letter.isascii() else letter for letter in name)


def _node(tag: str, attributes: dict[str, str]) -> str:
    described = " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{tag} {described}></{tag}>"
