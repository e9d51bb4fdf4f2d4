"""`read_biplane`: the two planes of one run, joined to an `Acquisition`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats, Integers
from stereosom.camera import Camera, StereoRig
from stereosom_plugin.acquisition import Acquisition, Image
from stereosom_plugin.errors import InputError

from .finding import find_planes, plane_letter
from .geometry import Table
from .header import label
from .plane import Plane, read_plane
from .timing import pair_frames

StrPath = str | os.PathLike[str]
# Frames of one file are of two planes where their directions fall into two groups: this far
# apart, and each this close together, deg.
PLANES_APART_DEG, PLANE_TOGETHER_DEG = 20.0, 5.0


@dataclass(frozen=True, eq=False)
class Run:
    """A biplane run as it was understood: both planes, and which frames belong together."""

    a: Plane
    b: Plane
    frames_a: Integers
    frames_b: Integers
    notes: tuple[str, ...]

    def cameras(self, index: int) -> tuple[Camera, Camera]:
        """The cameras of a pair of frames."""
        first = self.a.poses[int(self.frames_a[0])].table or Table()
        return (
            self.a.poses[int(self.frames_a[index])].camera(first),
            self.b.poses[int(self.frames_b[index])].camera(first),
        )

    def rigs(self) -> tuple[StereoRig, ...]:
        """One rig that holds for all pairs of frames, or one per pair.

        Raises
        ------
        InputError
            Where both planes stand in the same place.
        """
        used = [
            [plane.poses[int(frame)] for frame in frames]
            for plane, frames in ((self.a, self.frames_a), (self.b, self.frames_b))
        ]
        moving = any(len(set(poses)) > 1 for poses in used)
        try:
            return tuple(
                StereoRig(*self.cameras(index), "isocenter_lps")
                for index in range(len(self.frames_a) if moving else 1)
            )
        except ValueError:
            raise InputError(
                "planes A and B", "stand in the same place", "give two different views"
            ) from None

    def acquisition(self) -> Acquisition:
        """The run for reconstruction; nothing is read before it is asked for."""

        def read(index: int) -> tuple[Image, Image]:
            return (
                self.a.read(int(self.frames_a[index])),
                self.b.read(int(self.frames_b[index])),
            )

        times = self.a.times.seconds[self.frames_a]
        headers = dict.fromkeys((*self.a.headers, *self.b.headers))
        views = None
        if self.a.shutter is not None or self.b.shutter is not None:
            views = self.a.field_of_view, self.b.field_of_view
        return Acquisition(
            read,
            self.rigs(),
            times - times[0],
            tuple(header.path for header in headers),
            tuple(header.text("SOPInstanceUID") for header in headers),
            views,
            self.notes,
            (
                [self.a.source(int(frame)) for frame in self.frames_a],
                [self.b.source(int(frame)) for frame in self.frames_b],
            ),
        )


def read_biplane(
    a: StrPath | Sequence[StrPath], b: StrPath | None = None, *, dsa: bool = False
) -> Acquisition:
    """Open a biplane X-ray angiography run; its pictures stay on the disk until asked for.

    Parameters
    ----------
    a : path, or sequence of paths
        A DICOM XA or Enhanced XA object, a folder that holds exactly one biplane pair, or the
        files of single-frame series.
    b : path, optional
        The other plane. The order does not matter: the objects say which is which.
    dsa : bool
        Whether to subtract the masks that the objects prescribe.

    Returns
    -------
    Acquisition
        View a is plane A. Frame `isocenter_lps`: mm, patient axes about the isocenter.
        `notes` says what had to be assumed.

    Raises
    ------
    InputError
        Where the objects are not two planes of one run, or leave their geometry open.
    """
    return open_run(a, b, dsa=dsa).acquisition()


def open_run(a: StrPath | Sequence[StrPath], b: StrPath | None = None, *, dsa: bool = False) -> Run:
    """Find and read both planes of a run, without their pictures; as `read_biplane`."""
    given = [a] if isinstance(a, (str, os.PathLike)) else list(a)
    paths = [Path(path) for path in (*given, *(() if b is None else (b,)))]
    found = find_planes(paths)
    notes = list(found.notes)
    plane_a = read_plane(found.a.headers, dsa=dsa)
    if found.b is None:
        plane_a, plane_b, note = _split(plane_a)
        notes.append(note)
    else:
        plane_b = read_plane(found.b.headers, dsa=dsa)
    for name, plane in (("A", plane_a), ("B", plane_b)):
        notes += [f"plane {name}: {note}" for note in plane.notes]
        if np.any(np.diff(plane.times.seconds) < 0):
            raise plane.headers[0].refuse("its frames run backwards in time", "export it again")
    if (plane_a.poses[0].table is None) != (plane_b.poses[0].table is None):
        notes.append(
            "only one plane gives its angles about the room; both are taken to be about the "
            "same isocenter"
        )
    frames_a, frames_b, said = pair_frames(plane_a.times, plane_b.times)
    return Run(plane_a, plane_b, frames_a, frames_b, (*notes, *said))


def _split(both: Plane) -> tuple[Plane, Plane, str]:
    """Part the frames of one file, or series, into two planes.

    Raises
    ------
    InputError
        Where all of them are of one plane, or it cannot be told which is which.
    """
    header = both.headers[0]
    frames = both.headers if len(both.headers) > 1 else header.frames(len(both))
    letters = [plane_letter(frame) for frame in frames]
    if set(letters) == {"A", "B"}:
        in_a = np.array(letters) == "A"
        how = f"as {label('FrameType')} says"
    else:
        in_a = _nearer_first(both)
        how = "by the direction they look in, the first one being of plane A"
    if in_a.all():
        raise header.refuse("is one plane only", "give the other one too, or their folder")
    planes = [both.part(np.flatnonzero(chosen).tolist()) for chosen in (in_a, ~in_a)]
    for index, plane in enumerate(planes):
        if len(set(plane.poses)) == 1:  # what moved was the other plane coming next
            still = tuple(note for note in plane.notes if not note.startswith("the C-arm"))
            planes[index] = replace(plane, notes=still)
    if np.count_nonzero(np.diff(in_a.astype(int))) == 1 and not both.times.stamped:
        # One plane after the other in the file: a counted clock runs on, the planes did not.
        planes[1] = replace(planes[1], times=replace(planes[1].times, start=planes[0].times.start))
        how += "; they are taken to start together"
    return planes[0], planes[1], f"one object holds both planes: its frames are parted {how}"


def _nearer_first(plane: Plane) -> npt.NDArray[np.bool_]:
    """Which frames look as the first one does; all, where they do not fall into two groups."""
    axes = np.array([pose.camera().axis for pose in plane.poses])
    from_first = _degrees(axes @ axes[0])
    from_other = _degrees(axes @ axes[from_first.argmax()])
    near = from_first <= from_other
    apart = from_first.max() >= PLANES_APART_DEG
    together = max(from_first[near].max(), from_other[~near].max(initial=0)) <= PLANE_TOGETHER_DEG
    return near if apart and together else np.ones(len(near), dtype=bool)


def _degrees(cosine: Floats) -> Floats:
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))
