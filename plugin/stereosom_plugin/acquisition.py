"""`Acquisition`: the frames of both views, read one at a time, and where the views stood."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats, check_array
from stereosom.camera import StereoRig
from stereosom.observation import View

from .lens import Lens

Image = npt.NDArray[Any]
FieldOfView = tuple[Floats, Floats]


class SourceFrame(NamedTuple):
    """The file that a picture was read from, and the picture's number in it, from zero."""

    path: Path
    number: int


@dataclass(frozen=True, eq=False)
class FramePair:
    """Both pictures of one instant, (rows, columns) each."""

    image_a: Image
    image_b: Image
    rig: StereoRig
    time: float
    index: int
    field_of_view: FieldOfView | None = None


@dataclass(frozen=True, eq=False)
class Acquisition:
    """A run of frame pairs. Nothing is read before it is asked for, and nothing is kept.

    Parameters
    ----------
    read : callable
        Frame number to both pictures, `(image_a, image_b)`, (rows, columns) each.
    rigs : tuple of StereoRig
        One that holds for all frames, or one per frame.
    times : (n,) array
        Seconds, not decreasing; its length is the number of frames.
    sources : tuple of Path
        The files that are read.
    source_uids : tuple of str
        SOP Instance UIDs, where DICOM was read.
    field_of_view : pair of (m, 2) arrays, optional
        As in `stereosom.Observation`.
    notes : tuple of str
        What was assumed, one sentence each, for the user to read.
    source_frames : pair of sequences of SourceFrame, optional
        Of view a and of view b, one per frame: which pictures were paired, where DICOM was read.
    lenses : pair of Lens, optional
        How view a and view b distort. The pictures and `field_of_view` are as seen, the rigs
        those of ideal cameras: `segmentation.observe` undistorts the device's pixels, and what
        is drawn over a picture goes through `seen` first.
    """

    read: Callable[[int], tuple[Image, Image]]
    rigs: tuple[StereoRig, ...]
    times: Floats
    sources: tuple[Path, ...] = ()
    source_uids: tuple[str, ...] = ()
    field_of_view: FieldOfView | None = None
    notes: tuple[str, ...] = ()
    source_frames: tuple[Sequence[SourceFrame], Sequence[SourceFrame]] | None = None
    lenses: tuple[Lens, Lens] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", check_array(self.times, "times", (None,)))
        if len(self.rigs) not in (1, len(self.times)):
            raise ValueError(f"rigs: {len(self.rigs)} for {len(self.times)} frames")
        if np.any(np.diff(self.times) < 0):
            raise ValueError("times: must not decrease")

    def __len__(self) -> int:
        return len(self.times)

    def rig(self, index: int) -> StereoRig:
        """Where the views stood in a frame."""
        return self.rigs[index if len(self.rigs) > 1 else 0]

    def seen(self, view: View, pixels: Floats) -> Floats:
        """Where a view's picture shows what an ideal camera shows at (n, 2) pixels.

        Not a number where the lens model describes nothing: there is nothing to draw.
        """
        if self.lenses is None:
            return pixels
        return self.lenses[0 if view == "a" else 1].distort_where_defined(pixels)

    def __getitem__(self, index: int) -> FramePair:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        image_a, image_b = self.read(index)
        time = float(self.times[index])
        return FramePair(image_a, image_b, self.rig(index), time, index, self.field_of_view)

    def __iter__(self) -> Iterator[FramePair]:
        return (self[index] for index in range(len(self)))
