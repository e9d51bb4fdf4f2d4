"""One polyline with its arrays as the text of a `.vtp`, without VTK, which takes ten times as long.

As `vtkXMLPolyDataWriter` does it, numbers stand behind the XML, in base 64: of each array, how many
bytes, and those.
"""

from __future__ import annotations

import struct
from base64 import b64encode
from collections.abc import Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from stereosom.arrays import Floats

OF_CELLS = ("Length", "Tortuosity")
# What is drawn where nothing else is asked for, and how many components it has.
ACTIVE = {
    "Scalars": ("Abscissas", 1),
    "Vectors": ("FrenetTangent", 3),
    "Normals": ("ParallelTransportNormals", 3),
}


def vtp_text(points: Floats, point_data: Mapping[str, Any], described: Mapping[str, Any]) -> str:
    """The text of a `.vtp` that holds what `vtp_writer.make_polydata` makes of the same.

    Parameters
    ----------
    points : (n, 3) array
        Base to tip, mm.
    point_data : mapping of str to (n,) or (n, k) array
    described : mapping of str to numbers or sequence of str
    """
    blocks: list[str] = []

    def elements(data: Mapping[str, Any], kind: str = "Float64") -> str:
        return "".join(_element(name, values, kind, blocks) for name, values in data.items())

    active = "".join(
        f' {role}="{name}"'
        for role, (name, components) in ACTIVE.items()
        if np.size(point_data.get(name, ())) == components * len(points)
    )
    field = elements({name: described[name] for name in described if name not in OF_CELLS})
    of_points = elements(point_data)
    of_cells = elements({name: described[name] for name in OF_CELLS if name in described})
    places = elements({"Points": points})
    line = elements({"connectivity": np.arange(len(points)), "offsets": [len(points)]}, "Int64")
    return f"""<?xml version="1.0"?>
<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian" header_type="UInt32">
  <PolyData>
    <FieldData>{field}
    </FieldData>
    <Piece NumberOfPoints="{len(points)}" NumberOfLines="1">
      <PointData{active}>{of_points}
      </PointData>
      <CellData>{of_cells}
      </CellData>
      <Points>{places}
      </Points>
      <Lines>{line}
      </Lines>
    </Piece>
  </PolyData>
  <AppendedData encoding="base64">
   _{"".join(blocks)}
  </AppendedData>
</VTKFile>
"""


def is_text(values: Any) -> bool:
    """Whether values are strings, not numbers."""
    return isinstance(values, (list, tuple)) and all(isinstance(one, str) for one in values)


def _element(name: str, values: Any, kind: str, blocks: list[str]) -> str:
    """The element of an array, whose bytes are added to the blocks that are appended."""
    if is_text(values):
        tag, kind, components = "Array", "String", 1
        content = "".join(f"{one}\0" for one in values).encode("utf-8")
    else:
        array = np.asarray(values, dtype="<i8" if kind == "Int64" else "<f8")
        tag, components = "DataArray", array.shape[1] if array.ndim > 1 else 1
        content = array.tobytes()
    offset = sum(map(len, blocks))
    blocks.append(b64encode(struct.pack("<I", len(content)) + content).decode("ascii"))
    return (
        f'\n<{tag} type="{kind}" Name={quoteattr(name)} NumberOfComponents="{components}" '
        f'NumberOfTuples="{len(values)}" format="appended" offset="{offset}"/>'
    )
