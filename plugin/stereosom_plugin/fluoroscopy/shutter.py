"""What shutters and collimators leave of a picture: corners of the field that shows anything."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera
from stereosom.observation import picture_border

from .header import Header, label

EDGES = ("LeftVertical", "RightVertical", "UpperHorizontal", "LowerHorizontal")


def read_shutter(header: Header, camera: Camera) -> tuple[Floats | None, list[str]]:
    """Corners, (m, 2) px, of what shutters and collimators leave; None where there are none.

    DICOM counts columns and rows from one. An edge that is absent is taken to be open.

    Returns
    -------
    corners : (m, 2) array or None
    notes : list of str
        What was assumed.

    Raises
    ------
    InputError
        Where they leave nothing, or their numbers cannot be used.
    """
    whole = picture_border(camera)
    corners, notes, shut = whole, [], False
    for kind in ("Shutter", "Collimator"):
        polygon = _polygon(header, kind)
        clips = [
            clip
            for clip in (_rectangle(header, kind, whole), _circle(header, kind))
            if clip is not None
        ]
        if polygon is not None:
            # Only the figure that is clipped may be concave: the polygon, where there is one.
            clips, corners = [*clips, corners], polygon
        if clips:
            shut = True
        elif header.text(f"{kind}Shape"):
            notes.append(
                f"{label(f'{kind}Shape')} is {header.text(f'{kind}Shape')!r} without its edges; "
                "the whole picture is searched"
            )
        for clip in clips:
            corners = clip_polygon(corners, clip)
    if shut and (len(corners) < 3 or _area(corners) < 1):
        raise header.refuse("its shutter leaves nothing of the picture", "check the shutter tags")
    open_wide = not shut or _area(corners) >= _area(whole) - 1e-9
    return (None if open_wide else corners), notes


def clip_polygon(polygon: Floats, convex: Floats) -> Floats:
    """Intersect an (m, 2) polygon with a convex one (Sutherland and Hodgman 1974).

    The convex one runs clockwise on the screen (x right, y down).

    Examples
    --------
    >>> square = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4]])
    >>> clip_polygon(square, square + 3).tolist()
    [[3.0, 3.0], [4.0, 3.0], [4.0, 4.0], [3.0, 4.0]]
    """
    for start, end in pairwise([*convex, convex[0]]):
        side = end - start
        inside = side[0] * (polygon[:, 1] - start[1]) - side[1] * (polygon[:, 0] - start[0])
        kept = []
        for i in range(len(polygon)):
            if inside[i - 1] * inside[i] < 0:
                share = inside[i - 1] / (inside[i - 1] - inside[i])
                kept.append(polygon[i - 1] + share * (polygon[i] - polygon[i - 1]))
            if inside[i] >= 0:
                kept.append(polygon[i])
        polygon = np.reshape(kept, (-1, 2))
    return polygon


def _rectangle(header: Header, kind: str, whole: Floats) -> Floats | None:
    """Corners of a rectangular opening, clockwise; None where no edge is given."""
    edges = [header.number(f"{kind}{edge}Edge") for edge in EDGES]
    if all(edge is None for edge in edges):
        return None
    border = (whole[0, 0], whole[1, 0], whole[0, 1], whole[2, 1])
    left, right, top, bottom = (
        open_edge if edge is None else edge - 1
        for edge, open_edge in zip(edges, border, strict=True)
    )
    if left >= right or top >= bottom:
        raise header.refuse(
            f"the edges of its {kind.lower()} run past each other", "check the shutter tags"
        )
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def _circle(header: Header, kind: str) -> Floats | None:
    center = header.numbers(f"CenterOfCircular{kind}")
    radius = header.number(f"RadiusOfCircular{kind}")
    if not center and radius is None:
        return None
    if len(center) != 2 or radius is None or radius <= 0:
        raise header.refuse(
            f"its circular {kind.lower()} has no usable center and radius",
            "check the shutter tags",
        )
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    circle = radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.asarray(circle + np.array(center[::-1]) - 1)


def _polygon(header: Header, kind: str) -> Floats | None:
    vertices = header.numbers(f"VerticesOfThePolygonal{kind}")
    if not vertices:
        return None
    if len(vertices) < 6 or len(vertices) % 2:
        raise header.refuse(
            f"its polygonal {kind.lower()} has no usable vertices", "check the shutter tags"
        )
    return np.reshape(vertices, (-1, 2))[:, ::-1] - 1.0


def _area(polygon: Floats) -> float:
    """Area of an (m, 2) polygon (shoelace formula)."""
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
