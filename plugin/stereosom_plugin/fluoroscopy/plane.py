"""`Plane`: the frames of one plane, wherever they lie, with everything known about them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from stereosom.arrays import Floats
from stereosom.observation import picture_border
from stereosom_plugin.acquisition import Image, SourceFrame

from .geometry import Pose
from .header import Header, label
from .light import Light, read_light
from .pixels import PixelStore, open_pixels
from .positioner import read_poses
from .shutter import clip_polygon, read_shutter
from .subtraction import Subtraction, read_subtractions
from .timing import FrameTimes, read_series_times, read_times


@dataclass(frozen=True, eq=False)
class Plane:
    """One plane of a run, from whatever kind of objects.

    Parameters
    ----------
    headers : tuple of Header
        The file that holds the frames, or the files with one frame each.
    numbers : tuple of int
        Of each frame, its number in its file; for files with one frame each, the file's.
    stores : tuple of PixelStore
        One per file.
    poses : tuple of Pose
        One per frame.
    times : FrameTimes
    light : Light
    shutter : (m, 2) array or None
        Corners of what shutters and collimators leave in every frame, px.
    subtractions : tuple of Subtraction
        Mask operations to apply; none unless asked for.
    notes : tuple of str
        What was assumed.
    """

    headers: tuple[Header, ...]
    numbers: tuple[int, ...]
    stores: tuple[PixelStore, ...]
    poses: tuple[Pose, ...]
    times: FrameTimes
    light: Light
    shutter: Floats | None
    subtractions: tuple[Subtraction, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height, px."""
        rows, columns = self.stores[0].shape
        return columns, rows

    @property
    def field_of_view(self) -> Floats:
        """Corners of the region that shows anything, (m, 2) px."""
        if self.shutter is not None:
            return self.shutter
        return picture_border(self.poses[0].camera())

    def read(self, index: int) -> Image:
        """Read one frame as light, (rows, columns): larger is more X-rays.

        Raises
        ------
        InputError
            Where this frame is broken; others may be well.
        """
        number = self.numbers[index]
        for subtraction in self.subtractions:
            if number in subtraction.masks:
                return subtraction.apply(self._light, number)
        return self._light(number)

    def source(self, index: int) -> SourceFrame:
        """Where a frame lies."""
        number = self.numbers[index]
        if len(self.headers) > 1:
            return SourceFrame(self.headers[number].path, 0)
        return SourceFrame(self.headers[0].path, number)

    def part(self, indices: Sequence[int]) -> Plane:
        """Only some of the frames."""
        return replace(
            self,
            numbers=tuple(self.numbers[index] for index in indices),
            poses=tuple(self.poses[index] for index in indices),
            times=self.times[indices],
        )

    def _light(self, number: int) -> Image:
        if len(self.stores) > 1:
            return self.light(self.stores[number].read(0))
        return self.light(self.stores[0].read(number))


def read_plane(headers: tuple[Header, ...], *, dsa: bool = False) -> Plane:
    """Read everything about a plane but its pictures.

    Parameters
    ----------
    headers : tuple of Header
        One file with all frames, or files with one frame each, in order.
    dsa : bool
        Whether to subtract the masks that the object prescribes.

    Raises
    ------
    InputError
        Where the geometry, the times or the pixels cannot be used.
    """
    stores = tuple(open_pixels(header) for header in headers)
    rows, columns = stores[0].shape
    frames: list[Header] = []
    poses: list[Pose] = []
    notes: dict[str, None] = {}
    for header, store in zip(headers, stores, strict=True):
        if store.shape != stores[0].shape or store.bits != stores[0].bits:
            raise header.refuse("has other pictures than its series", "give files of one run")
        of_file = header.frames(len(store))
        read, said = read_poses(of_file, (columns, rows))
        frames += of_file
        poses += read
        notes |= dict.fromkeys(said)
    if len(headers) > 1:
        times, said = read_series_times(headers)
        if len(set(poses)) > 1:
            said.append("the C-arm or the table moves: every frame has its own geometry")
    else:
        times, said = read_times(frames)
    notes |= dict.fromkeys(said)
    light, said = read_light(frames[0], stores[0].bits[1], stores[0].signed)
    notes |= dict.fromkeys(said)
    shutter, said = _common_shutter(frames, poses[0])
    notes |= dict.fromkeys(said)
    subtractions: tuple[Subtraction, ...] = ()
    if dsa:
        subtractions = read_subtractions(headers[0], len(stores[0]))
    elif headers[0].value("MaskSubtractionSequence"):
        notes["a mask is meant to be subtracted for display; frames are taken as stored"] = None
    return Plane(
        headers,
        tuple(range(len(poses))),
        stores,
        tuple(poses),
        times,
        light,
        shutter,
        subtractions,
        tuple(notes),
    )


def _common_shutter(headers: Sequence[Header], pose: Pose) -> tuple[Floats | None, list[str]]:
    """What the shutters of all frames leave."""
    camera = pose.camera()
    first, notes = read_shutter(headers[0], camera)
    if all(header is headers[0] for header in headers):
        return first, notes
    common, moves = first, False
    for header in headers[1:]:
        shutter, said = read_shutter(header, camera)
        notes += [note for note in said if note not in notes]
        if shutter is None or (common is not None and np.array_equal(shutter, common)):
            continue
        moves = True
        common = shutter if common is None else clip_polygon(common, shutter)
    if common is not None and len(common) < 3:
        raise headers[0].refuse(
            "its shutter moves so far that no part of the picture is always open",
            f"check {label('ShutterShape')}",
        )
    if moves:
        notes.append("the shutter moves; only what is always open is searched")
    return common, notes
