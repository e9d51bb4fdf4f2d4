"""When each frame was taken, and which frames of both planes belong together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from stereosom.arrays import Floats, Integers
from stereosom_plugin.errors import InputError

from .header import Header, label

# What a plane's exposures may be apart within a pair without a word, s.
TOGETHER = 0.001


@dataclass(frozen=True)
class Moment:
    """A time of day, s, and the day's number where it is known. `exact`: finer than a second."""

    seconds: float
    day: int | None = None
    exact: bool = False

    def until(self, later: Moment) -> float:
        """Seconds from this moment to another; where one has no day, both are of one day."""
        days = 0 if self.day is None or later.day is None else later.day - self.day
        return 86400.0 * days + later.seconds - self.seconds


@dataclass(frozen=True, eq=False)
class FrameTimes:
    """A plane's clock.

    Parameters
    ----------
    seconds : (n,) array
        From the first frame.
    start : Moment or None
        When the first frame was taken, where known.
    stamped : bool
        Whether each frame has a time of its own, not one counted from a rate.
    """

    seconds: Floats
    start: Moment | None = None
    stamped: bool = False

    def __getitem__(self, frames: Sequence[int]) -> FrameTimes:
        """The clock of some of the frames."""
        seconds = self.seconds[np.asarray(frames)]
        start = self.start
        if start is not None:
            start = replace(start, seconds=start.seconds + float(seconds[0]))
        return FrameTimes(seconds - seconds[0], start, self.stamped)


def read_times(headers: Sequence[Header]) -> tuple[FrameTimes, list[str]]:
    """Times of the frames of one file, from the header as it holds for each; and what was assumed.

    Raises
    ------
    InputError
        Where several frames come without any time or rate.
    """
    header, frames = headers[0], len(headers)
    start = _start(header)
    if (times := _frame_moments(headers)) is not None:
        return times, []
    if frames == 1:
        return FrameTimes(np.zeros(1), start), []
    pointed = header.value("FrameIncrementPointer")
    pointed = [pointed] if isinstance(pointed, int) else list(pointed or ())
    vector = header.numbers("FrameTimeVector")
    step = header.number("FrameTime")
    zero = len(vector) > 1 and not any(vector[1:])
    if vector and not zero and (0x00181065 in pointed or step is None):
        if len(vector) != frames or min(vector) < 0 or sum(vector) > 1e8:
            raise header.refuse(
                f"{label('FrameTimeVector')} holds {len(vector)} steps for {frames} frames, "
                "or absurd ones",
                "export the object again",
            )
        seconds = np.cumsum(vector) / 1000
        return FrameTimes(seconds - seconds[0], start), []
    if step is not None and 0 < step < 1e5:
        return FrameTimes(np.arange(frames) * step / 1000, start), []
    if (found := _rate(header)) is not None:
        rate, keyword = found
        said = "absent" if step is None else f"{step:g} ms"
        lacking = (
            f"{label('FrameTimeVector')} is all zero" if zero else f"{label('FrameTime')} is {said}"
        )
        note = f"{lacking}; times follow from {label(keyword)}"
        return FrameTimes(np.arange(frames) / rate, start), [note]
    raise header.missing("FrameTime", "FrameTimeVector")


def read_series_times(headers: Sequence[Header]) -> tuple[FrameTimes, list[str]]:
    """Times of a plane whose frames are a file each, in order; and what was assumed.

    Raises
    ------
    InputError
        Where neither the files' times nor a rate put them in order.
    """
    for keywords in (("AcquisitionDateTime", "AcquisitionTime"), ("ContentTime",)):
        moments = [_start(header, keywords) for header in headers]
        first = moments[0]
        if first is None or None in moments:
            continue
        seconds = np.array([first.until(moment) for moment in moments if moment is not None])
        if np.all(np.diff(seconds) > 0):
            return FrameTimes(seconds, first), []
    first_header, numbers = headers[0], [header.number("InstanceNumber") for header in headers]
    step = first_header.number("FrameTime")
    found = (1000 / step, "FrameTime") if step and 0 < step < 1e5 else _rate(first_header)
    if found is None or None in numbers:
        raise first_header.refuse(
            "and the other files of its series do not say when each was taken",
            "export them with their acquisition times",
        )
    rate, keyword = found
    counted = np.array(numbers, dtype=float)
    note = (
        f"the files' times do not tell them apart; times follow from {label('InstanceNumber')} "
        f"and {label(keyword)}"
    )
    return FrameTimes((counted - counted[0]) / rate, _start(first_header)), [note]


def pair_frames(a: FrameTimes, b: FrameTimes) -> tuple[Integers, Integers, list[str]]:
    """Which frames of both planes show one instant: two (n,) arrays of numbers, and notes.

    The nearest in time, no further apart than half a frame. Planes that run in step and whose
    clocks do not say otherwise (they may give whole seconds only) are paired by number.

    Raises
    ------
    InputError
        Where the planes do not run in step and no time of day relates them.
    """
    steps = [np.median(np.diff(plane.seconds)) for plane in (a, b) if len(plane.seconds) > 1]
    tolerance = float(min(steps)) / 2 if steps else 0.0
    counts = f"{len(a.seconds)} and {len(b.seconds)} frames"
    lag = None
    coarse = True
    if a.start is not None and b.start is not None:
        lag = a.start.until(b.start)
        coarse = not (a.start.exact and b.start.exact)
    in_step = len(a.seconds) == len(b.seconds) and np.abs(a.seconds - b.seconds).max() <= tolerance
    unknown = lag is None or (coarse and abs(lag) <= 1 + tolerance)
    if in_step and (unknown or abs(lag or 0.0) <= tolerance):
        numbers = np.arange(len(a.seconds))
        notes = []
        if lag is not None and abs(lag) > max(tolerance, TOGETHER):
            notes.append(f"the planes start {abs(lag):.3f} s apart; frames are paired by number")
        elif lag is not None and abs(lag) > TOGETHER:
            notes.append(_apart(lag))
        return numbers, numbers, notes
    if lag is None:
        raise InputError(
            "planes A and B",
            f"have {counts} that do not run in step, and no {label('AcquisitionTime')} "
            "in both to pair them by",
            "export both planes of one run",
        )
    moments_b = b.seconds + lag
    later = np.searchsorted(moments_b, a.seconds).clip(0, len(moments_b) - 1)
    earlier = np.maximum(later - 1, 0)
    closer = np.abs(moments_b[earlier] - a.seconds) < np.abs(moments_b[later] - a.seconds)
    frames_b = np.where(closer, earlier, later)
    gap = moments_b[frames_b] - a.seconds
    nearest = np.abs(gap)
    # Of several frames of plane A that one of plane B is nearest to, the nearest has it.
    order = np.lexsort((nearest, frames_b))
    order = order[nearest[order] <= max(tolerance, 1e-6)]
    _, first = np.unique(frames_b[order], return_index=True)
    frames_a = np.sort(order[first])
    frames_b = frames_b[frames_a]
    if len(frames_a) == 0:
        raise InputError("planes A and B", "were not taken at one time", "give both of one run")
    notes = [
        f"{counts}: {len(frames_a)} pairs by {label('AcquisitionTime')}, "
        f"from frame {frames_a[0]} of plane A and frame {frames_b[0]} of plane B on; "
        f"plane B starts {abs(lag):.3f} s {'after' if lag >= 0 else 'before'} plane A"
    ]
    offset = float(np.median(gap[frames_a]))
    if abs(offset) > TOGETHER:
        notes.append(_apart(offset))
    return frames_a, frames_b, notes


def _apart(offset: float) -> str:
    return (
        f"in each pair, plane B was exposed {1000 * abs(offset):.1f} ms "
        f"{'after' if offset > 0 else 'before'} plane A; what moved meanwhile is not corrected"
    )


def _rate(header: Header) -> tuple[float, str] | None:
    """Frames a second, and the element that says so."""
    for keyword in ("CineRate", "RecommendedDisplayFrameRate"):
        rate = header.number(keyword)
        if rate is not None and 0 < rate < 1e4:
            return rate, keyword
    return None


def _frame_moments(headers: Sequence[Header]) -> FrameTimes | None:
    """The clock in the functional groups of an enhanced object; None where it has none."""
    for keyword in ("FrameReferenceDateTime", "FrameAcquisitionDateTime"):
        moments = [_moment(header.text(keyword)) for header in headers]
        first = moments[0]
        if first is None or None in moments:
            continue
        seconds = np.array([first.until(moment) for moment in moments if moment is not None])
        if np.ptp(seconds) > 0 or len(headers) == 1:
            return FrameTimes(seconds, first, stamped=True)
    return None


def _start(
    header: Header, keywords: Sequence[str] = ("AcquisitionDateTime", "AcquisitionTime")
) -> Moment | None:
    """When an object was taken; None where it does not say."""
    for keyword in keywords:
        text = header.text(keyword)
        if text and keyword.endswith("Time") and not keyword.endswith("DateTime"):
            text = header.text(keyword.replace("Time", "Date")).rjust(8) + text
        if (moment := _moment(text)) is not None:
            return moment
    return None


def _moment(text: str) -> Moment | None:
    found = re.match(r"(\d{8}| {8})(\d\d)(\d\d)(\d\d)(\.\d+)?", text)
    if not found:
        return None
    day, hours, minutes, seconds, fraction = found.groups()
    try:
        known = date(int(day[:4]), int(day[4:6]), int(day[6:])).toordinal() if day.strip() else None
    except ValueError:
        return None
    of_day = int(hours) * 3600 + int(minutes) * 60 + int(seconds) + float(fraction or 0)
    return Moment(of_day, known, fraction is not None)
