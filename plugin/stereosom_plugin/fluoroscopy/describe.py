"""What was understood of a run, in the words of those who took it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from stereosom.arrays import Floats

from .pairing import Run, StrPath, open_run
from .plane import Plane
from .timing import Moment


def describe_biplane(
    a: StrPath | Sequence[StrPath], b: StrPath | None = None, *, dsa: bool = False
) -> dict[str, Any]:
    """Say what is understood of a run, as `read_biplane` would read it, without its pictures.

    Returns
    -------
    dict
        `planes` (by letter: files, angles, distances in mm, pixels, frames, clock), `pairs`,
        and `notes`: what was assumed. `description_text` writes it out.

    Raises
    ------
    InputError
        Where it cannot be read.
    """
    run = open_run(a, b, dsa=dsa)
    run.rigs()  # refuses what cannot be reconstructed
    axes = [np.array([camera.axis for camera in cameras]) for cameras in _cameras(run)]
    angle = np.degrees(np.arccos(np.clip(np.sum(axes[0] * axes[1], axis=1), -1, 1)))
    gaps = _gaps(run)
    return {
        "planes": {
            letter: _described(plane, seen)
            for letter, plane, seen in zip("AB", (run.a, run.b), axes, strict=True)
        },
        "pairs": {
            "count": len(run.frames_a),
            "first_frames": [int(run.frames_a[0]), int(run.frames_b[0])],
            "b_after_a_ms": None if gaps is None else round(1000 * float(np.median(gaps)), 3),
            "convergence_deg": _range(angle),
        },
        "subtracted": dsa,
        "notes": list(run.notes),
    }


def description_text(description: dict[str, Any]) -> str:
    """Write out a description, line by line."""
    lines = []
    for letter, plane in description["planes"].items():
        first, *more = plane["files"]
        lines += [
            f"plane {letter}: {os.path.basename(first)}"
            + (f" and {len(more)} more files" if more else ""),
            f"  {plane['angles']}",
            f"  source to detector {_spelled(plane['source_to_detector_mm'])} mm, "
            f"to isocenter {_spelled(plane['source_to_isocenter_mm'])} mm",
            f"  {plane['columns']} × {plane['rows']} pixels of {plane['spacing_mm'][1]:g} × "
            f"{plane['spacing_mm'][0]:g} mm at the detector, {plane['mm_per_pixel']:.3f} mm at "
            f"the isocenter; {plane['bits']} bits, {plane['intensity'] or 'intensity unknown'}"
            + ("; shuttered" if plane["shuttered"] else ""),
            f"  {_frames_text(plane)}" + (f", from {plane['start']} on" if plane["start"] else ""),
        ]
    pairs = description["pairs"]
    lines.append(
        f"pairs: {pairs['count']}, from frame {pairs['first_frames'][0]} of plane A and frame "
        f"{pairs['first_frames'][1]} of plane B on; the views are "
        f"{_spelled(pairs['convergence_deg'])} degrees apart"
    )
    if pairs["b_after_a_ms"] is not None:
        offset = pairs["b_after_a_ms"]
        when = f"{abs(offset):.1f} ms {'after' if offset >= 0 else 'before'} plane A"
        lines.append(f"  plane B was exposed {when if offset else 'together with plane A'}")
    if description["subtracted"]:
        lines.append("  masks are subtracted")
    notes = description["notes"]
    lines += ["assumed:", *(f"  - {note}" for note in notes)] if notes else ["nothing assumed"]
    return "\n".join(lines)


def _frames_text(plane: dict[str, Any]) -> str:
    text = "1 frame" if plane["frames"] == 1 else f"{plane['frames']} frames"
    if (rate := plane["frames_per_second"]) is None:
        return text
    return f"{text} in {plane['seconds']:.3f} s, {rate:.2f} a second"


def angles_text(axes: Floats) -> str:
    """Spell out as clinicians do where the detector stands, from its directions, (n, 3) LPS.

    Examples
    --------
    >>> angles_text(np.array([[-0.5, -np.sqrt(0.75), 0]]))
    'RAO 30 / CRA 0'
    """
    primary = np.degrees(np.arctan2(axes[:, 0], -axes[:, 1]))
    secondary = np.degrees(np.arcsin(np.clip(axes[:, 2], -1, 1)))
    return f"{_turn(primary, 'LAO', 'RAO')} / {_turn(secondary, 'CRA', 'CAU')}"


def _turn(angles: Floats, positive: str, negative: str) -> str:
    ends = [round(float(angles[index]), 1) for index in (0, -1)]
    if max(angles) - min(angles) > 0.05 and ends[0] == ends[1]:  # there and back
        ends = [round(float(angles.min()), 1), round(float(angles.max()), 1)]
    spelled = [f"{positive if angle >= 0 else negative} {abs(angle):g}" for angle in ends]
    return spelled[0] if spelled[0] == spelled[1] else f"{spelled[0]} to {spelled[1]}"


def _described(plane: Plane, axes: Floats) -> dict[str, Any]:
    rows, columns = plane.stores[0].shape
    pose = plane.poses[0]
    seconds = plane.times.seconds
    length = float(seconds[-1])
    middle = np.sqrt(pose.spacing[0] * pose.spacing[1])
    frame = plane.headers[0].frames(len(plane.stores[0]))[0]
    return {
        "files": [str(header.path) for header in plane.headers],
        "angles": angles_text(axes),
        "source_to_detector_mm": _range([pose.source_to_detector for pose in plane.poses]),
        "source_to_isocenter_mm": _range([pose.source_to_isocenter for pose in plane.poses]),
        "columns": columns,
        "rows": rows,
        "spacing_mm": list(pose.spacing),
        "mm_per_pixel": float(middle * pose.source_to_isocenter / pose.source_to_detector),
        "bits": plane.stores[0].bits[1],
        "intensity": frame.text("PixelIntensityRelationship")[:16],
        "shuttered": plane.shutter is not None,
        "frames": len(plane),
        "seconds": length,
        "frames_per_second": (len(plane) - 1) / length if length > 0 else None,
        "start": _clock(plane.times.start),
    }


def _cameras(run: Run) -> list[list[Any]]:
    pairs = [run.cameras(index) for index in range(len(run.frames_a))]
    return [list(cameras) for cameras in zip(*pairs, strict=True)]


def _gaps(run: Run) -> Floats | None:
    """By how much plane B was exposed after plane A in each pair, s; None where unknown."""
    first_a, first_b = run.a.times.start, run.b.times.start
    if first_a is None or first_b is None or not (first_a.exact and first_b.exact):
        return None
    seconds_a, seconds_b = run.a.times.seconds, run.b.times.seconds
    gaps = first_a.until(first_b) + seconds_b[run.frames_b] - seconds_a[run.frames_a]
    return np.asarray(gaps)


def _clock(moment: Moment | None) -> str | None:
    """Hours, minutes and seconds; no date: a description may be shown around."""
    if moment is None:
        return None
    of_day = moment.seconds % 86400
    whole = int(of_day)
    spelled = f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"
    return spelled + (f"{of_day - whole:.3f}"[1:] if moment.exact else "")


def _range(values: Any) -> list[float]:
    """Least and greatest."""
    return [round(float(np.min(values)), 3), round(float(np.max(values)), 3)]


def _spelled(ends: Sequence[float]) -> str:
    low, high = (f"{end:g}" for end in ends)
    return low if low == high else f"{low} to {high}"
