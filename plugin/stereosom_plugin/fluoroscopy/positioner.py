"""What a header says about where a plane stood in each frame; every assumption is noted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .geometry import LYING, Pose, Table
from .header import Header, label

# Patient directions in LPS, as PatientOrientation spells them.
DIRECTIONS = {
    letter: sign * np.eye(3)[axis]
    for letters, axis in (("LR", 0), ("PA", 1), ("HF", 2))
    for letter, sign in zip(letters, (1, -1), strict=True)
}
# Codes of context groups 19 to 21 (PS3.16), SNOMED CT and the older SRT.
SUPINE, PRONE = {"F-10340", "40199007"}, {"F-10310", "1240000"}
HEAD_FIRST, FEET_FIRST = {"F-10470", "102540001"}, {"F-10480", "102541002"}

TABLE_AXES = ("Vertical", "Longitudinal", "Lateral")

# What no C-arm or laboratory rig goes beyond, mm: a length beyond it is in another unit.
DISTANCES, PITCHES = (200.0, 5000.0), (0.01, 5.0)
# What C-arms commonly have, mm, where nothing in the file says it.
USUAL_SOURCE_TO_DETECTOR, USUAL_SOURCE_TO_ISOCENTER = 1050.0, 750.0
# Beyond this, deg, angles about the patient and about the room contradict each other.
AGREEING_DEG = 2.0


def read_poses(
    frames: Sequence[Header], image_size: tuple[int, int]
) -> tuple[tuple[Pose, ...], list[str]]:
    """Read where a plane stood in each frame of a file, from the header as it holds for each.

    Returns
    -------
    poses : tuple of Pose
        One per frame.
    notes : list of str
        What was assumed.

    Raises
    ------
    InputError
        Where a number is absent that nothing safe stands in for, or absurd.
    """
    notes: dict[str, None] = {}
    read: dict[int, Pose] = {}
    poses = []
    for frame in frames:
        if id(frame) not in read:
            read[id(frame)], said = _read_pose(frame, image_size)
            notes |= dict.fromkeys(said)
        poses.append(read[id(frame)])
    tables = {
        tuple(frame.numbers(f"TableTop{axis}Position") for axis in TABLE_AXES)
        for frame in {id(frame): frame for frame in frames}.values()
    }
    if len(tables) > 1 and all(pose.table is None for pose in poses):
        notes["the table moves; positions are about the isocenter, not in the patient"] = None
    moved, said = _moved(frames[0], poses)
    _check_orientation(frames[0], moved[0])
    return moved, [*notes, *said]


def _read_pose(header: Header, image_size: tuple[int, int]) -> tuple[Pose, list[str]]:
    lying, notes = _patient_position(header)
    sid, sod, said = _distances(header)
    notes += said
    spacing, said = _spacing(header, image_size)
    notes += said
    turn, flipped, said = _turned(header)
    notes += said
    # Asked by its item: the table position's group has angles of the same names.
    room = header.items("IsocenterReferenceSystemSequence")[:1]
    isocenter_angles = None
    if room:
        isocenter_angles = _angle_pair(
            room[0], "PositionerIsocenterPrimaryAngle", "PositionerIsocenterSecondaryAngle"
        )
        if isocenter_angles is None:
            notes.append("the angles about the room are absent; those about the patient are used")
    table = None
    detector_turn = 0.0
    if isocenter_angles is not None:
        angles = isocenter_angles
        turned = _angle(room[0], "PositionerIsocenterDetectorRotationAngle", 180)
        if turned is None:
            notes.append("the detector's rotation is absent; it is taken to be 0")
        detector_turn = turned or 0.0
        table, said = _table(room[0], lying)
        notes += said
    else:
        patient_angles = _angle_pair(header, "PositionerPrimaryAngle", "PositionerSecondaryAngle")
        if patient_angles is None:
            raise header.missing("PositionerPrimaryAngle")
        angles = patient_angles
    for keyword in ("DetectorPrimaryAngle", "DetectorSecondaryAngle"):
        if header.number(keyword):
            notes.append(f"the beam meets the detector aslant ({label(keyword)}); that is left out")
    pose = Pose(*angles, sid, sod, spacing, image_size, detector_turn, turn, flipped, None, table)
    center, said = _isocenter_pixel(header, pose)
    pose = replace(pose, center=center)
    notes += said
    if isocenter_angles is not None:
        notes += _agreement(header, pose)
    return pose, notes


def _angle(header: Header, keyword: str, limit: float) -> float | None:
    angle = header.number(keyword)
    if angle is not None and abs(angle) > limit:
        raise _absurd(header, keyword, f"within {limit:g} degrees")
    return angle


def _angle_pair(header: Header, first: str, second: str) -> tuple[float, float] | None:
    """Primary and secondary angle, deg; None where neither is given."""
    primary, secondary = _angle(header, first, 180), _angle(header, second, 90)
    if primary is None and secondary is None:
        return None
    for keyword, angle in ((first, primary), (second, secondary)):
        if angle is None:
            raise header.missing(keyword)
    assert primary is not None
    assert secondary is not None
    return primary, secondary


def _moved(header: Header, poses: list[Pose]) -> tuple[tuple[Pose, ...], list[str]]:
    """Add the increments of a classic XA object to its first frame's angles."""
    notes: list[str] = []
    keywords = ("PositionerPrimaryAngleIncrement", "PositionerSecondaryAngleIncrement")
    increments = [header.numbers(keyword) for keyword in keywords]
    dynamic = header.text("PositionerMotion").upper() == "DYNAMIC"
    if dynamic and not any(increments):
        raise header.missing(*keywords)
    if not dynamic and not any(map(any, increments)):
        if len(set(poses)) > 1:
            notes.append("the C-arm or the table moves: every frame has its own geometry")
        return tuple(poses), notes
    if not dynamic:
        notes.append(
            f"{label('PositionerMotion')} says {header.text('PositionerMotion')[:20]!r}, but "
            "angle increments are given; they are followed"
        )
    steps = []
    for keyword, given in zip(keywords, increments, strict=True):
        if len(given) not in (0, len(poses)):
            raise _absurd(header, keyword, f"one per frame, {len(poses)}")
        if not given:
            notes.append(f"{label(keyword)} is absent; that angle is taken not to move")
        steps.append(given or (0.0,) * len(poses))
    moved = []
    for pose, first, second in zip(poses, *steps, strict=True):
        primary, secondary = pose.primary_deg + first, pose.secondary_deg + second
        for keyword, angle, limit in zip(keywords, (primary, secondary), (180, 90), strict=True):
            if abs(angle) > limit:
                raise header.refuse(
                    f"{label(keyword)} carries the C-arm to {angle:g} degrees, "
                    f"beyond {limit}", "correct the object"
                )  # fmt: skip
        moved.append(replace(pose, primary_deg=primary, secondary_deg=secondary))
    notes.append("the C-arm moves; its angle increments were not checked against a real scanner")
    return tuple(moved), notes


def _distances(header: Header) -> tuple[float, float, list[str]]:
    """Source to detector and source to isocenter, mm; what is absent is filled in and noted."""
    notes: list[str] = []
    sid = _length(header, "DistanceSourceToDetector", DISTANCES)
    keyword = "DistanceSourceToIsocenter"
    sod = _length(header, keyword, DISTANCES)
    if sod is None:
        keyword = "DistanceSourceToPatient"
        sod = _length(header, keyword, DISTANCES)
    magnification = header.number("EstimatedRadiographicMagnificationFactor")
    if magnification is not None and not 1 < magnification < 10:
        raise _absurd(header, "EstimatedRadiographicMagnificationFactor", "above 1 and below 10")
    # The standard defines the magnification as the ratio of the two.
    follows = f"follows from {label('EstimatedRadiographicMagnificationFactor')}"
    usual = "is assumed, as usual for a C-arm: lengths may be wrong by a tenth"
    if sid is None:
        if sod is not None and magnification is not None:
            sid, source = sod * magnification, follows
        else:
            sid, source = USUAL_SOURCE_TO_DETECTOR, usual
        notes.append(f"{label('DistanceSourceToDetector')} is absent; {sid:.1f} mm {source}")
    if sod is None:
        if magnification is not None:
            sod, source = sid / magnification, follows
        else:
            sod, source = USUAL_SOURCE_TO_ISOCENTER, usual
        notes.append(f"{label('DistanceSourceToPatient')} is absent; {sod:.1f} mm {source}")
    if not sod < sid:
        raise header.refuse(
            f"{label(keyword)} is {sod:g} mm, must be less than the detector's {sid:g} mm",
            "correct the object",
        )
    return sid, sod, notes


def _spacing(header: Header, image_size: tuple[int, int]) -> tuple[tuple[float, float], list[str]]:
    """Pixel pitch at the detector, mm: between rows, between columns."""
    keyword = "ImagerPixelSpacing"
    pitch = header.numbers(keyword)
    notes = []
    if not pitch:
        columns, rows = image_size
        for keyword in ("FieldOfViewDimensionsInFloat", "FieldOfViewDimensions", "IntensifierSize"):
            if sides := header.numbers(keyword):
                height, width = sides[0], sides[-1]
                pitch = (height / rows, width / columns)
                notes.append(
                    f"{label('ImagerPixelSpacing')} is absent; {pitch[0]:.4f} × {pitch[1]:.4f} mm "
                    f"follow from {label(keyword)}, if the picture fills it"
                )
                break
        else:
            raise header.missing("ImagerPixelSpacing")
    low, high = PITCHES
    if len(pitch) != 2 or not all(low <= step <= high for step in pitch):
        raise _absurd(header, keyword, f"two lengths between {low:g} and {high:g} mm a pixel")
    if max(pitch) > 4 * min(pitch):
        raise _absurd(header, keyword, "two lengths of one magnitude")
    return (pitch[0], pitch[1]), notes


def _turned(header: Header) -> tuple[float, bool, list[str]]:
    """How the stored picture was turned, deg clockwise, and whether it was flipped after that."""
    turn = header.number("FieldOfViewRotation") or 0.0
    if turn % 90:
        raise _absurd(header, "FieldOfViewRotation", "a multiple of 90 degrees")
    word = header.text("FieldOfViewHorizontalFlip").upper()
    if word not in ("", "NO", "YES"):
        raise _absurd(header, "FieldOfViewHorizontalFlip", "YES or NO")
    turn, flipped = turn % 360, word == "YES"
    done = [f"turned by {turn:g} degrees"] if turn else []
    done += ["flipped"] if flipped else []
    notes = []
    if done:
        notes.append(
            f"the picture was {' and '.join(done)} against the detector, and the geometry "
            "follows it; that was not checked against a real scanner"
        )
    return turn, flipped, notes


def _isocenter_pixel(header: Header, pose: Pose) -> tuple[tuple[float, float] | None, list[str]]:
    """Column and row onto which the isocenter falls, where the detector says it.

    It is counted in detector elements from the center of the first one; the field of view
    begins some elements later, may bin them, and is turned only after that (PS3.3 C.8.19.5).
    """
    isocenter = header.numbers("PositionOfIsocenterProjection")
    if not isocenter:
        return None, []
    origin = header.numbers("FieldOfViewOrigin")
    element = header.numbers("DetectorElementSpacing")
    if len(isocenter) != 2 or len(origin) != 2 or len(element) != 2 or min(element) <= 0:
        return None, [
            f"{label('PositionOfIsocenterProjection')} cannot be carried to the picture without "
            f"{label('FieldOfViewOrigin')} and {label('DetectorElementSpacing')}; the isocenter "
            "is taken to fall on the picture's center"
        ]
    size = np.array(pose.image_size[::-1])  # rows, columns
    pitch = np.array(pose.spacing)
    if pose.picture_turn_deg % 180:  # rows and columns before the turn
        size, pitch = size[::-1], pitch[::-1]
    binning = pitch / np.array(element)
    pixel = (np.array(isocenter) - np.array(origin) + 0.5) / binning - 0.5
    down, right = (pixel - (size - 1) / 2) * pitch
    turn = np.radians(pose.picture_turn_deg)
    x = np.cos(turn) * right - np.sin(turn) * down
    y = np.sin(turn) * right + np.cos(turn) * down
    if pose.flipped:
        x = -x
    columns, rows = pose.image_size
    center = (columns - 1) / 2 + x / pose.spacing[1], (rows - 1) / 2 + y / pose.spacing[0]
    if not (-columns < center[0] < 2 * columns and -rows < center[1] < 2 * rows):
        raise header.refuse(
            f"{label('PositionOfIsocenterProjection')} lies far outside of the picture",
            "correct the object",
        )
    return center, []


def _table(header: Header, lying: str) -> tuple[Table, list[str]]:
    """Where the table stood about the isocenter."""
    position = [header.number(f"Table{axis}PositionToIsocenter") for axis in "XYZ"]
    angles = [
        _angle(header, keyword, limit)
        for keyword, limit in (
            ("TableHorizontalRotationAngle", 180),
            ("TableHeadTiltAngle", 90),
            ("TableCradleTiltAngle", 90),
        )
    ]
    notes = []
    if None in position or None in angles:
        notes.append("the table's place is not given in full; what is absent is taken to be 0")
    if any(value is not None and abs(value) > 5000 for value in position):
        raise _absurd(header, "TableXPositionToIsocenter", "within 5 m, like the other two")
    x, y, z = (value or 0.0 for value in position)
    around, head, cradle = (value or 0.0 for value in angles)
    if head or cradle or around:
        notes.append("the table is turned or tilted; that was not checked against a real scanner")
    return Table((x, y, z), (around, head, cradle), lying), notes


def _agreement(header: Header, pose: Pose) -> list[str]:
    """Note where angles about the patient contradict those about the room."""
    patient = _angle_pair(header, "PositionerPrimaryAngle", "PositionerSecondaryAngle")
    if patient is None:
        return []
    alone = replace(pose, primary_deg=patient[0], secondary_deg=patient[1], table=None)
    cosine = float(np.clip(pose.camera().axis @ alone.camera().axis, -1, 1))
    apart = np.degrees(np.arccos(cosine))
    if apart <= AGREEING_DEG:
        return []
    return [
        f"angles about the patient and about the room are {apart:.1f} degrees apart; those about "
        f"the room are used ({label('IsocenterReferenceSystemSequence')})"
    ]


def _patient_position(header: Header) -> tuple[str, list[str]]:
    """HFS, HFP, FFS or FFP; note what was assumed or not checked."""
    position = header.text("PatientPosition").upper() or _coded_position(header)
    notes = []
    if not position:
        position = "HFS"
        notes.append(f"{label('PatientPosition')} is absent; head first, supine is assumed")
    elif position not in LYING:
        raise header.refuse(
            f"patient position {position[:16]!r} is not supported", "give a supine run"
        )
    elif position != "HFS":
        notes.append(f"patient position {position} was not checked against a real scanner")
    if header.text("TableMotion").upper() == "DYNAMIC":
        notes.append("the table moves; positions are about the isocenter, not in the patient")
    if header.number("TableAngle"):
        notes.append("the table is tilted; that was not checked against a real scanner")
    return position, notes


def _coded_position(header: Header) -> str:
    """The same from the code sequences of Enhanced XA; empty where they do not say it."""
    codes = set()
    for recumbent in header.items("PatientOrientationCodeSequence"):
        codes |= {
            m.text("CodeValue") for m in recumbent.items("PatientOrientationModifierCodeSequence")
        }
    codes |= {g.text("CodeValue") for g in header.items("PatientGantryRelationshipCodeSequence")}
    first = "HF" if codes & HEAD_FIRST else "FF" if codes & FEET_FIRST else ""
    side = "S" if codes & SUPINE else "P" if codes & PRONE else ""
    return first + side if first and side else ""


def _check_orientation(header: Header, pose: Pose) -> None:
    """Refuse a picture whose rows or columns run against the matrix.

    PatientOrientation names the directions in which columns and rows grow; the first letter
    weighs most. Vendors write it roughly, so only a clear contradiction counts.
    """
    letters = header.text("PatientOrientation").upper().split("\\")
    if len(letters) != 2:
        return
    camera = pose.camera()
    center = camera.project([[0, 0, 0]])
    for axis, spelled in enumerate(letters):
        if (direction := DIRECTIONS.get(spelled[:1])) is None:
            continue
        step = camera.project([direction])[0] - center[0]
        if step[axis] < -0.5 * camera.focal_length / camera.depth([[0, 0, 0]])[0]:
            raise header.refuse(
                f"{label('PatientOrientation')} says that its picture is flipped or turned",
                "export it as acquired",
            )


def _length(header: Header, keyword: str, limits: tuple[float, float]) -> float | None:
    length = header.number(keyword)
    low, high = limits
    if length is not None and not low <= length <= high:
        raise _absurd(header, keyword, f"between {low:g} and {high:g} mm")
    return length


def _absurd(header: Header, keyword: str, wanted: str) -> Exception:
    return header.refuse(
        f"{label(keyword)} is {header.text(keyword)[:40]!r}, must be {wanted}", "correct the object"
    )
