"""Does the device itself agree with the geometry that was given? Told always, mended if asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np

from stereosom.observation import Observation
from stereosom.self_calibration import (
    LEAST_PLACES,
    Change,
    RigRefinement,
    agreement,
    isocenter,
    refine_rig,
)

from .acquisition import Acquisition
from .segmentation import Segmentation, observe

# Frames that are looked at to check, and to refine.
CHECKED, REFINED_FROM = 8, 30
# Disagreement that no device explains: mm at the isocenter, and shares of the device's width.
# Where the geometry was right, segmented clinical backgrounds gave up to 0.5 mm.
LEAST_MM, LEAST_WIDTHS = 1.0, 0.5


def evenly(frames: Sequence[int], count: int) -> list[int]:
    """At most `count` of the frames, evenly chosen, with the first and the last.

    Examples
    --------
    >>> evenly(range(100), 3)
    [0, 49, 99]
    """
    chosen = np.linspace(0, len(frames) - 1, min(count, len(frames)))
    return [frames[int(place)] for place in chosen]


@dataclass(eq=False)
class GeometryCheck:
    """Looks on while a run is reconstructed, and says what its views disagree about.

    Parameters
    ----------
    frames : sequence of int
        Of the run.
    """

    frames: Sequence[int]
    _kept: list[Observation] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._wanted = set(evenly(self.frames, CHECKED)) if self.frames else set()

    def see(self, observation: Observation) -> None:
        """Keep a frame, if it is one of the few that are wanted."""
        if observation.index in self._wanted:
            self._kept.append(observation)

    def warning(self) -> str:
        """What is wrong, with advice; empty where nothing is, or too little was seen to tell."""
        found = agreement(self._kept)
        if found.places < LEAST_PLACES // 2:
            return ""
        size = _pixel_size(self._kept[0])
        error = found.epipolar_error
        if error * size < LEAST_MM or error < LEAST_WIDTHS * found.width:
            return ""
        return (
            f"the views disagree by {error:.1f} px ({error * size:.1f} mm) across epipolar lines, "
            f"the median over {found.places} places of the device: the stated geometry cannot "
            "be right; --refine-geometry refines it from the device"
        )


def refine_geometry(
    acquisition: Acquisition, segment: Segmentation, frames: Sequence[int] | None = None
) -> Acquisition:
    """Refine the relative geometry of a run's views from the device, and note what was changed.

    Parameters
    ----------
    acquisition : Acquisition
    segment : callable
        Image to mask.
    frames : sequence of int, optional
        Numbers of the frames that may be used; up to thirty are. Default: all.

    Returns
    -------
    Acquisition
        With refined rigs, and notes of every change; with the rigs as they were, and a note
        why, where the device does not tell enough.
    """
    chosen = evenly(range(len(acquisition)) if frames is None else frames, REFINED_FROM)
    observations = list(observe(acquisition, segment, frames=chosen))
    try:
        found = refine_rig(observations)
    except (ValueError, np.linalg.LinAlgError) as reason:  # HardFrame, or no rig is left
        note = f"the geometry was not refined: {reason}"
        return replace(acquisition, notes=(*acquisition.notes, note))
    return replace(
        acquisition,
        rigs=tuple(found.apply(rig) for rig in acquisition.rigs),
        notes=(*acquisition.notes, *_told(found, len(chosen))),
    )


def _told(found: RigRefinement, frames: int) -> list[str]:
    """Every change in words, plane by plane."""
    notes = [
        f"the relative geometry was refined from {found.places} places of the device in {frames} "
        f"frames: epipolar error {found.epipolar_error_before:.2f} px before, "
        f"{found.epipolar_error_after:.2f} px after; scale and what both planes have in common "
        "cannot be told from the device and stay as stated"
    ]
    for view, changes in groupby(found.changes, key=lambda change: change.view):
        values = {change.name: change for change in changes}
        notes.append(
            f"plane {view.upper()} was turned by {_both(values['x'])}° about the picture's "
            f"horizontal, {_both(values['y'])}° about its vertical and {_both(values['roll'])}° in "
            f"its plane, moved by {_both(values['right'])} mm right, {_both(values['down'])} mm "
            f"down and {_both(values['depth'])} mm in depth, its focal length changed by "
            f"{_both(values['focal'], 100)} % (± what is left open)"
        )
    return notes


def _both(change: Change, unit: float = 1) -> str:
    return f"{change.value * unit:+.2f} ± {change.deviation_after * unit:.2f}"


def _pixel_size(seen: Observation) -> float:
    """Millimetres of a pixel at the isocenter, mean of both views."""
    center = isocenter(seen.rig)[None]
    return float(np.mean([camera.pixel_size(center) for camera in (seen.rig.a, seen.rig.b)]))
