"""One polyline with its arrays as the text of a `.vtp`, without VTK: in a third of its time."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from stereosom.arrays import Floats

from .centerline import Centerline

OF_CELLS = ("Length", "Tortuosity")
ACTIVE = {
    "Scalars": "Abscissas",
    "Vectors": "FrenetTangent",
    "Normals": "ParallelTransportNormals",
}
_HEAD = (
    '<?xml version="1.0"?>\n'
    '<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian" header_type="UInt32">\n'
)


def vtp_text(points: Floats, point_data: Mapping[str, Any], described: Mapping[str, Any]) -> str:
    """The text of a `.vtp` that holds what `make_polydata` makes of the same.

    Numbers are not compressed: as they all differ, they would be but a sixth shorter.

    Examples
    --------
    >>> text = vtp_text(np.zeros((2, 3)), {"Radius": [1.0, 1.0]}, {"SPACE": ["LPS"]})
    >>> '<Array type="String" Name="SPACE" NumberOfTuples="1" format="ascii">76 80 83 0<' in text
    True
    """
    of_cells = {name: described[name] for name in OF_CELLS if name in described}
    field = {name: values for name, values in described.items() if name not in of_cells}
    active = "".join(f' {role}="{name}"' for role, name in ACTIVE.items() if name in point_data)
    line = {"connectivity": np.arange(len(points)), "offsets": np.array([len(points)])}
    return "".join([
        _HEAD, "<PolyData>\n",
        _element("FieldData", field, tuples=True),
        f'<Piece NumberOfPoints="{len(points)}" NumberOfVerts="0" NumberOfLines="1" '
        'NumberOfStrips="0" NumberOfPolys="0">\n',
        _element("PointData", point_data, active),
        _element("CellData", of_cells),
        _element("Points", {"Points": points}),
        _element("Lines", line),
        "</Piece>\n</PolyData>\n</VTKFile>\n",
    ])  # fmt: skip


def text_of(line: Centerline) -> str:
    """The text of a `.vtp` of what was read from a file; its space is LPS."""
    described = {**line.field, "SPACE": ("LPS",), "TimeValue": [line.time], "Frame": [line.frame]}
    return vtp_text(line.points, line.arrays, described)


def is_text(values: Any) -> bool:
    """Whether field data is a list of words, not of numbers."""
    return isinstance(values, (list, tuple)) and all(isinstance(value, str) for value in values)


def _element(kind: str, arrays: Mapping[str, Any], active: str = "", tuples: bool = False) -> str:
    inner = "".join(_array(name, values, tuples) for name, values in arrays.items())
    return f"<{kind}{active}>\n{inner}</{kind}>\n"


def _array(name: str, values: Any, tuples: bool) -> str:
    """An array; only that of field data says how many tuples it holds."""
    count = f' NumberOfTuples="{len(values)}"' if tuples else ""
    if is_text(values):
        letters = " ".join(str(byte) for word in values for byte in (*word.encode(), 0))
        named = f'<Array type="String" Name={quoteattr(name)}{count} format="ascii">'
        return f"{named}{letters}</Array>\n"
    numbers = np.asarray(values)
    whole = numbers.dtype == np.intp
    numbers = np.ascontiguousarray(numbers, dtype="<i8" if whole else "<f8")
    size = f' NumberOfComponents="{numbers.shape[1]}"' if numbers.ndim > 1 else ""
    content = b64encode(np.uint32(numbers.nbytes).astype("<u4").tobytes() + numbers.tobytes())
    return (
        f'<DataArray type="{"Int64" if whole else "Float64"}" Name={quoteattr(name)}{size}{count} '
        f'format="binary">{content.decode()}</DataArray>\n'
    )
