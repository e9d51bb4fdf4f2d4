"""Where a C-arm and a table stood -> `Camera`.

World axes: patient LPS, mm, about the isocenter of the first frame. The room's axes, in which
Enhanced XA gives angles and table, are the same for a patient who lies head first and supine on
a level table: x to the table's left, y down, z to its head (PS3.3 C.8.19.6.13).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera

# How the patient lies on the table: patient LPS to table axes, their diagonals.
LYING = {"HFS": (1, 1, 1), "HFP": (-1, -1, 1), "FFS": (-1, 1, -1), "FFP": (1, -1, -1)}


def positioner_camera(
    primary: float,
    secondary: float,
    source_to_detector: float,
    source_to_isocenter: float,
    spacing: tuple[float, float],
    image_size: tuple[int, int],
    *,
    detector_turn: float = 0.0,
    picture_turn: float = 0.0,
    flipped: bool = False,
    center: tuple[float, float] | None = None,
    world_to_room: tuple[Floats, Floats] | None = None,
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
    detector_turn : float
        Rotation of the detector in its plane, rad (Positioner Isocenter Detector Rotation
        Angle, the third of PS3.17 Z.2).
    picture_turn : float
        Clockwise rotation of the stored picture against the detector, rad.
    flipped : bool
        Whether left and right were exchanged after that.
    center : (float, float), optional
        Column and row onto which the isocenter falls. Default: the center of the picture, as
        PS3.17 FFF.2.1.5.2 says of XA.
    world_to_room : ((3, 3) array, (3,) array), optional
        Rotation and translation from the patient to the room. Default: none.

    Returns
    -------
    Camera
        s (column, row, 1) = K [M | (0, 0, source_to_isocenter)] (X, 1). M mirrors: the picture
        is seen looking toward the source. M is Xp, -Zp, -Yp of PS3.17 Z.2.
    """
    sin_a, cos_a, sin_b, cos_b = (
        np.sin(primary),
        np.cos(primary),
        np.sin(secondary),
        np.cos(secondary),
    )
    to_detector = np.array(
        [
            [cos_a, sin_a, 0],
            [sin_a * sin_b, -cos_a * sin_b, -cos_b],
            [sin_a * cos_b, -cos_a * cos_b, sin_b],
        ]
    )
    turn = detector_turn - picture_turn
    in_picture = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    if flipped:
        in_picture[0] *= -1
    to_detector[:2] = in_picture @ to_detector[:2]
    row_pitch, column_pitch = spacing
    column, row = center or ((image_size[0] - 1) / 2, (image_size[1] - 1) / 2)
    intrinsics = [
        [source_to_detector / column_pitch, 0, column],
        [0, source_to_detector / row_pitch, row],
        [0, 0, 1],
    ]
    translation = np.array([0, 0, source_to_isocenter])
    if world_to_room is not None:
        rotation, shift = world_to_room
        translation = to_detector @ shift + translation
        to_detector = to_detector @ rotation
    return Camera.from_pose(intrinsics, to_detector, translation, image_size)


@dataclass(frozen=True)
class Table:
    """Where the table stood in the room, and how the patient lies on it.

    Parameters
    ----------
    position : (float, float, float)
        Of its reference point from the isocenter, mm.
    angles_deg : (float, float, float)
        Horizontal rotation (+z toward +x), head tilt (head up), cradle tilt (left up).
    lying : str
        Patient position: HFS, HFP, FFS or FFP.
    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angles_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lying: str = "HFS"

    @property
    def to_room(self) -> Floats:
        """Rotation from table to room axes, (3, 3): (R3 R2 R1) transposed of PS3.17 Z.3.

        Examples
        --------
        >>> (Table(angles_deg=(0, 90, 0)).to_room @ [0, 0, 1]).round(6).tolist()  # head up
        [0.0, -1.0, 0.0]
        """
        (s1, s2, s3), (c1, c2, c3) = (f(np.radians(self.angles_deg)) for f in (np.sin, np.cos))
        horizontal = np.array([[c1, 0, -s1], [0, 1, 0], [s1, 0, c1]])
        head = np.array([[1, 0, 0], [0, c2, s2], [0, -s2, c2]])
        cradle = np.array([[c3, -s3, 0], [s3, c3, 0], [0, 0, 1]])
        return np.asarray((cradle @ head @ horizontal).T)

    def world_to_room(self, first: Table) -> tuple[Floats, Floats]:
        """Rotation and translation from the patient to the room.

        The patient moves with the table; the world's origin is the point of the patient that
        lay in the isocenter when the table stood as `first`.
        """
        patient_to_room = self.to_room @ np.diag(np.array(LYING[self.lying], dtype=float))
        carried = self.to_room @ first.to_room.T @ np.array(first.position)
        return patient_to_room, np.array(self.position) - carried


@dataclass(frozen=True)
class Pose:
    """What a header says about where one frame was taken; as `positioner_camera`, but degrees."""

    primary_deg: float
    secondary_deg: float
    source_to_detector: float
    source_to_isocenter: float
    spacing: tuple[float, float]
    image_size: tuple[int, int]
    detector_turn_deg: float = 0.0
    picture_turn_deg: float = 0.0
    flipped: bool = False
    center: tuple[float, float] | None = None
    table: Table | None = None

    def camera(self, first_table: Table | None = None) -> Camera:
        """Make the frame's camera; the table's position counts from `first_table`'s on."""
        room = None
        if self.table is not None:
            room = self.table.world_to_room(first_table or self.table)
        return positioner_camera(
            float(np.radians(self.primary_deg)),
            float(np.radians(self.secondary_deg)),
            self.source_to_detector,
            self.source_to_isocenter,
            self.spacing,
            self.image_size,
            detector_turn=float(np.radians(self.detector_turn_deg)),
            picture_turn=float(np.radians(self.picture_turn_deg)),
            flipped=self.flipped,
            center=self.center,
            world_to_room=room,
        )
