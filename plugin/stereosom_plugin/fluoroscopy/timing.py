"""When each frame was taken, and which frames of both planes belong together."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date

import numpy as np

from stereosom.arrays import Floats, Integers
from stereosom_plugin.errors import InputError

from .header import Header, label


@dataclass(frozen=True, eq=False)
class FrameTimes:
    """A plane's clock.

    Parameters
    ----------
    seconds : (n,) array
        From the first frame.
    start : float or None
        The first frame's time of day, s, where known (with the days, where they are known).
    """

    seconds: Floats
    start: float | None


def read_times(header: Header, frames: int) -> tuple[FrameTimes, list[str]]:
    """Times of a plane's frames, and what was assumed about them.

    Raises
    ------
    InputError
        Where several frames come without any time or rate.
    """
    start = _start(header)
    if frames == 1:
        return FrameTimes(np.zeros(1), start), []
    pointed = header.value("FrameIncrementPointer")
    pointed = [pointed] if isinstance(pointed, int) else list(pointed or ())
    vector = header.numbers("FrameTimeVector")
    step = header.number("FrameTime")
    if vector and (0x00181065 in pointed or step is None):
        if len(vector) != frames or min(vector) < 0:
            raise header.refuse(
                f"{label('FrameTimeVector')} holds {len(vector)} steps for {frames} frames, "
                "or negative ones",
                "export the object again",
            )
        seconds = np.cumsum(vector) / 1000
        return FrameTimes(seconds - seconds[0], start), []
    if step is not None and step > 0:
        return FrameTimes(np.arange(frames) * step / 1000, start), []
    for keyword in ("CineRate", "RecommendedDisplayFrameRate"):
        rate = header.number(keyword)
        if rate is not None and rate > 0:
            note = f"{label('FrameTime')} is absent; times follow from {label(keyword)}"
            return FrameTimes(np.arange(frames) / rate, start), [note]
    raise header.missing("FrameTime", "FrameTimeVector")


def pair_frames(a: FrameTimes, b: FrameTimes) -> tuple[Integers, Integers, list[str]]:
    """Which frames of both planes show one instant: two (n,) arrays of numbers, and notes.

    Planes that run in step are paired by number; others by the time of day, the nearest
    frames, no further apart than half a frame.

    Raises
    ------
    InputError
        Where the planes do not run in step and no time of day relates them.
    """
    steps = [np.median(np.diff(plane.seconds)) for plane in (a, b) if len(plane.seconds) > 1]
    tolerance = float(min(steps)) / 2 if steps else 0.0
    known = a.start is not None and b.start is not None
    lag = (b.start or 0.0) - (a.start or 0.0) if known else 0.0
    counts = f"{len(a.seconds)} and {len(b.seconds)} frames"
    if len(a.seconds) == len(b.seconds) and np.abs(a.seconds - b.seconds).max() <= tolerance:
        numbers = np.arange(len(a.seconds))
        notes = []
        if abs(lag) > tolerance > 0:
            notes.append(f"the planes start {abs(lag):.3f} s apart; frames are paired by number")
        return numbers, numbers, notes
    if not known:
        raise InputError(
            "planes A and B",
            f"have {counts} that do not run in step, and no {label('AcquisitionTime')} "
            "in both to pair them by",
            "export both planes of one run",
        )
    gap = np.abs(a.seconds[:, None] - (b.seconds + lag))
    frames_b = gap.argmin(axis=1)
    frames_a = np.flatnonzero(gap.min(axis=1) <= tolerance)
    frames_b, first = np.unique(frames_b[frames_a], return_index=True)
    frames_a = frames_a[first]
    if len(frames_a) == 0:
        raise InputError("planes A and B", "were not taken at one time", "give both of one run")
    note = (
        f"{counts}: {len(frames_a)} pairs by {label('AcquisitionTime')}, "
        f"from frame {frames_a[0]} of plane A and frame {frames_b[0]} of plane B on"
    )
    return frames_a, frames_b, [note]


def _start(header: Header) -> float | None:
    """Acquisition time in seconds, with days where the date is known; None where unknown."""
    moment = header.text("AcquisitionDateTime")
    if not moment:
        moment = header.text("AcquisitionDate").rjust(8) + header.text("AcquisitionTime")
    found = re.match(r"(\d{8}| {8})(\d\d)(\d\d)(\d\d(?:\.\d+)?)", moment)
    if not found:
        return None
    day, hours, minutes, seconds = found.groups()
    try:
        days = date(int(day[:4]), int(day[4:6]), int(day[6:])).toordinal() if day.strip() else 0
    except ValueError:
        return None
    return days * 86400.0 + int(hours) * 3600 + int(minutes) * 60 + float(seconds)
