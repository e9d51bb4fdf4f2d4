"""Where an XA plane stood: positioner angles and distances -> `Camera`, shutter -> corners.

World axes: patient LPS, mm, about the isocenter. The matrix holds for a patient who lies head
first and supine on a level table; what was not checked against a real scanner is noted.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera
from stereosom.observation import picture_border

from .header import Header, label

# Patient directions in LPS, as PatientOrientation spells them.
DIRECTIONS = {
    letter: sign * np.eye(3)[axis]
    for letters, axis in (("LR", 0), ("PA", 1), ("HF", 2))
    for letter, sign in zip(letters, (1, -1), strict=True)
}


def positioner_camera(
    primary: float,
    secondary: float,
    source_to_detector: float,
    source_to_isocenter: float,
    spacing: tuple[float, float],
    image_size: tuple[int, int],
) -> Camera:
    """Make the camera of one C-arm position.

    Parameters
    ----------
    primary, secondary : float
        Where the detector stands, rad: positive toward the patient's left, and the head.
    source_to_detector, source_to_isocenter : float
        mm.
    spacing : (float, float)
        Pixel pitch on the detector, mm: between rows, between columns.
    image_size : (int, int)
        Width and height, px.

    Returns
    -------
    Camera
        s (column, row, 1) = K [M | (0, 0, source_to_isocenter)] (X, 1). M mirrors: the picture
        is seen looking toward the source.
    """
    sin_a, cos_a, sin_b, cos_b = (
        np.sin(primary),
        np.cos(primary),
        np.sin(secondary),
        np.cos(secondary),
    )
    to_detector = [
        [cos_a, sin_a, 0],
        [sin_a * sin_b, -cos_a * sin_b, -cos_b],
        [sin_a * cos_b, -cos_a * cos_b, sin_b],
    ]
    row_pitch, column_pitch = spacing
    intrinsics = [
        [source_to_detector / column_pitch, 0, (image_size[0] - 1) / 2],
        [0, source_to_detector / row_pitch, (image_size[1] - 1) / 2],
        [0, 0, 1],
    ]
    return Camera.from_pose(intrinsics, to_detector, [0, 0, source_to_isocenter], image_size)


def read_cameras(
    header: Header, image_size: tuple[int, int], frames: int
) -> tuple[tuple[Camera, ...], list[str]]:
    """Make a plane's cameras: one, or one per frame where the positioner moves.

    Returns
    -------
    cameras : tuple of Camera
    notes : list of str
        What was assumed.

    Raises
    ------
    InputError
        Where a number is absent or absurd: nothing safe stands in for it.
    """
    notes = _check_patient(header)
    sid, sod, distance_notes = _distances(header)
    spacing = header.numbers("ImagerPixelSpacing")
    if not spacing:
        raise header.missing("ImagerPixelSpacing")
    if len(spacing) != 2 or min(spacing) <= 0:
        raise _absurd(header, "ImagerPixelSpacing", "two positive lengths")
    angles, motion_notes = _angles(header, frames)
    cameras = tuple(
        positioner_camera(primary, secondary, sid, sod, (spacing[0], spacing[1]), image_size)
        for primary, secondary in np.radians(angles)
    )
    _check_orientation(header, cameras[0])
    return cameras, notes + distance_notes + motion_notes


def read_shutter(header: Header, camera: Camera) -> Floats | None:
    """Corners, (m, 2) px, of what the shutters leave of the picture; None without a shutter.

    DICOM counts columns and rows from one.
    """
    edges = [
        header.numbers(f"Shutter{edge}Edge")
        for edge in ("LeftVertical", "RightVertical", "UpperHorizontal", "LowerHorizontal")
    ]
    center, radius = (
        header.numbers("CenterOfCircularShutter"),
        header.number("RadiusOfCircularShutter"),
    )
    vertices = header.numbers("VerticesOfThePolygonalShutter")
    clips = []
    if all(len(edge) == 1 for edge in edges):
        left, right, top, bottom = (edge[0] - 1 for edge in edges)
        clips.append(np.array([[left, top], [right, top], [right, bottom], [left, bottom]]))
    if len(center) == 2 and radius:
        turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        circle = radius * np.column_stack([np.cos(turn), np.sin(turn)])
        clips.append(circle + np.array(center[::-1]) - 1)
    polygonal = len(vertices) >= 6 and len(vertices) % 2 == 0
    if not clips and not polygonal:
        return None
    # Only the figure that is clipped may be concave: the polygon, where there is one.
    corners = picture_border(camera)
    if polygonal:
        clips.append(corners)
        corners = np.reshape(vertices, (-1, 2))[:, ::-1] - 1.0
    for clip in clips:
        corners = clip_polygon(corners, clip)
    if len(corners) < 3:
        raise header.refuse("its shutter leaves nothing of the picture", "check the shutter tags")
    return corners


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


def _distances(header: Header) -> tuple[float, float, list[str]]:
    """Source to detector, source to isocenter, mm."""
    notes: list[str] = []
    sid = header.number("DistanceSourceToDetector")
    if sid is None:
        raise header.missing("DistanceSourceToDetector")
    if sid <= 0:
        raise _absurd(header, "DistanceSourceToDetector", "a positive length")
    sod = header.number("DistanceSourceToPatient")
    if sod is None:
        magnification = header.number("EstimatedRadiographicMagnificationFactor")
        if magnification is None:
            raise header.missing("DistanceSourceToPatient")
        if magnification <= 1:
            raise _absurd(header, "EstimatedRadiographicMagnificationFactor", "above 1")
        sod = sid / magnification  # the standard defines it as this ratio
        notes.append(
            f"{label('DistanceSourceToPatient')} is absent; {sod:.1f} mm follow from "
            f"{label('EstimatedRadiographicMagnificationFactor')}"
        )
    if not 0 < sod < sid:
        raise _absurd(
            header, "DistanceSourceToPatient", f"between 0 and {sid:g} mm, the detector's"
        )
    return sid, sod, notes


def _angles(header: Header, frames: int) -> tuple[Floats, list[str]]:
    """Primary and secondary angle, (n, 2) degrees: one row, or one per frame."""
    notes: list[str] = []
    base = []
    for keyword, limit in (("PositionerPrimaryAngle", 180), ("PositionerSecondaryAngle", 90)):
        angle = header.number(keyword)
        if angle is None:
            raise header.missing(keyword)
        if abs(angle) > limit:
            raise _absurd(header, keyword, f"within {limit} degrees")
        base.append(angle)
    if header.text("PositionerMotion").upper() != "DYNAMIC":
        return np.array([base]), notes
    angles = np.tile(base, (frames, 1))
    keywords = ("PositionerPrimaryAngleIncrement", "PositionerSecondaryAngleIncrement")
    increments = [header.numbers(keyword) for keyword in keywords]
    if not any(increments):
        raise header.missing(*keywords)
    for column, (keyword, steps) in enumerate(zip(keywords, increments, strict=True)):
        if len(steps) not in (0, frames):
            raise _absurd(header, keyword, f"one per frame, {frames}")
        if steps:
            angles[:, column] += steps
        else:
            notes.append(f"{label(keyword)} is absent; that angle is taken not to move")
    notes.append("the C-arm moves; its angle increments were not checked against a real scanner")
    return angles, notes


def _check_patient(header: Header) -> list[str]:
    """Refuse what would turn or mirror the picture unnoticed; note what was not checked."""
    rotation = header.number("FieldOfViewRotation")
    flip = header.text("FieldOfViewHorizontalFlip").upper()
    if rotation:
        raise header.refuse(f"its picture is turned by {rotation:g} degrees", "export it unturned")
    if flip not in ("", "NO"):
        raise header.refuse("its picture is flipped", "export it unflipped")
    notes: list[str] = []
    position = header.text("PatientPosition").upper()
    if not position:
        notes.append(f"{label('PatientPosition')} is absent; head first, supine is assumed")
    elif position in ("HFP", "FFS", "FFP"):
        notes.append(f"patient position {position} was not checked against a real scanner")
    elif position != "HFS":
        raise header.refuse(f"patient position {position!r} is not supported", "give a supine run")
    if header.text("TableMotion").upper() == "DYNAMIC":
        notes.append("the table moves; positions are about the isocenter, not in the patient")
    if header.number("TableAngle"):
        notes.append("the table is tilted; that was not checked against a real scanner")
    return notes


def _check_orientation(header: Header, camera: Camera) -> None:
    """Refuse a picture whose rows or columns run against the matrix.

    PatientOrientation names the directions in which columns and rows grow; the first letter
    weighs most. Vendors write it roughly, so only a clear contradiction counts.
    """
    letters = header.text("PatientOrientation").upper().split("\\")
    center = camera.project([[0, 0, 0]])
    if len(letters) != 2:
        return
    for axis, spelled in enumerate(letters):
        if (direction := DIRECTIONS.get(spelled[:1])) is None:
            continue
        step = camera.project([direction])[0] - center[0]
        if step[axis] < -0.5 * camera.focal_length / camera.depth([[0, 0, 0]])[0]:
            raise header.refuse(
                f"{label('PatientOrientation')} says that its picture is flipped or turned",
                "export it as acquired",
            )


def _absurd(header: Header, keyword: str, wanted: str) -> Exception:
    return header.refuse(
        f"{label(keyword)} is {header.text(keyword)[:40]!r}, must be {wanted}", "correct the object"
    )
