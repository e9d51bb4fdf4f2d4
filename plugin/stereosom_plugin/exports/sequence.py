"""3D Slicer's sequence bundle, `.seq.mrb`: the models of a run by time, in a zip.

The layout is the one that `vtkMRMLSequenceStorageNode` of Slicer 5.11 writes: a scene of one
model node per time, a singleton sequence node that says which belongs to which time, and a
data file each.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ..centerline import Centerline
from ..files import write_whole
from ..vtp_writer import polydata_of, vtp_text

# No clock: the same centerlines give the same bytes.
_STAMP = (1980, 1, 1, 0, 0, 0)


def write_sequence(lines: Sequence[Centerline], path: str | Path) -> None:
    """Write a `.seq.mrb` of models with all their arrays, by time in seconds.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    folder = Path(path).name.removesuffix(".mrb")
    with write_whole(path) as part, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as bundle:

        def add(name: str, text: str) -> None:
            bundle.writestr(zipfile.ZipInfo(f"{folder}/{name}", _STAMP), text.encode("utf-8"))

        add(f"{folder.removesuffix('.seq')}.mrml", _scene(lines))
        for number, line in enumerate(lines):
            add(f"Data/{_file_name(number)}", vtp_text(polydata_of(line)))


def _file_name(number: int) -> str:
    return f"centerline_{number}.vtp"


def _scene(lines: Sequence[Centerline]) -> str:
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
            "fileName": f"Data/{_file_name(number)}",
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


def _node(tag: str, attributes: dict[str, str]) -> str:
    described = " ".join(f"{name}={quoteattr(value)}" for name, value in attributes.items())
    return f"<{tag} {described}></{tag}>"
