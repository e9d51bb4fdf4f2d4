"""Self-calibration: the relative geometry of two views, refined from the device itself.

Two views of one curve agree in the epipolar plane of every point. Along most of the curve a wrong
rig goes unnoticed, because some other point lies in that plane; but where the curve ends, and
where it touches an epipolar plane, both views name the same point. These places, over the frames
of a run, are the measurement; what is known of the rig beforehand is the rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..camera import StereoRig
from ..observation import Observation, View
from ..reconstruction import HardFrame
from .correction import IN_DEGREES, PARAMETERS, RigUncertainty, corrected, deviations, isocenter
from .places import all_places, epipolar_distance, sampson, seen_frames

__all__ = [
    "Agreement",
    "Change",
    "RigRefinement",
    "RigUncertainty",
    "agreement",
    "isocenter",
    "refine_rig",
]

# Among fewer places a wrong one could not be told from the others.
LEAST_PLACES = 6
# The standard deviation of a place that both views name: some px, and half the device's width.
# Its outline may end that far from its middle line, and does so alike in all frames, which are no
# independent measurements; with less, what the frames have in common is taken for the rig's.
_NOISE_PX, _NOISE_WIDTHS = 0.5, 0.5
_STEPS, _LONGEST_STEP, _SMALL_STEP = 30, 3.0, 2e-3


@dataclass(frozen=True)
class Change:
    """How one number of one view was changed: by how much, and the deviations before and after.

    `name` is `x` or `y` (turned about that axis of the picture, deg), `roll` (deg), `right`,
    `down`, `depth` (moved that way in the picture, mm) or `focal` (longer, as a share).
    """

    view: View
    name: str
    value: float
    deviation_before: float
    deviation_after: float


@dataclass(frozen=True, eq=False)
class RigRefinement:
    """What the device said about the rig.

    Parameters
    ----------
    rig : StereoRig
        Of the first observation, refined.
    changes : tuple of Change
        Of view a, then of view b; what they have in common is not observable, and zero in the
        measure of the standard deviations.
    epipolar_error_before, epipolar_error_after : float
        Median distance of the places from the epipolar lines of their partners, px.
    places : int
        How many were used.
    pivot : (3,) array
        The isocenter: where the viewing axes come closest, mm.
    """

    rig: StereoRig
    changes: tuple[Change, ...]
    epipolar_error_before: float
    epipolar_error_after: float
    places: int
    pivot: Floats

    def apply(self, rig: StereoRig) -> StereoRig:
        """Refine another rig of the same run in the same way (positioners may move)."""
        values = np.array([change.value for change in self.changes])
        return corrected(rig, np.where(IN_DEGREES, np.radians(values), values), self.pivot)


def refine_rig(
    observations: Iterable[Observation], *, uncertainty: RigUncertainty | None = None
) -> RigRefinement:
    """Refine the relative geometry of two views from the device that both see.

    The most probable correction of both views, given the places that both name and what was
    known: iteratively reweighted least squares with Cauchy weights against wrong places.
    Correspondences leave seven of the fourteen numbers open (a rigid motion of everything, and
    the scale); there the standard deviations decide, so that nothing is changed without need
    and neither view is trusted more than the other.

    Parameters
    ----------
    observations : iterable of Observation
        Frames of one run in which the device moves; some thirty are enough.
    uncertainty : RigUncertainty, optional

    Returns
    -------
    RigRefinement

    Raises
    ------
    HardFrame
        Where the views share too few places.

    Notes
    -----
    Touching epipolar planes: J. Porrill, S. Pollard, "Curve matching and stereo calibration",
    Image and Vision Computing 9(1), 1991. A place where the curve touches the plane moves along
    the plane when the rig changes, so to first order its epipolar error changes as that of a
    fixed point.
    """
    frames = seen_frames(observations)
    rigs = [rig for rig, _, _ in frames]
    uncertainty = uncertainty or RigUncertainty()
    pivot = isocenter(rigs[0]) if rigs else np.zeros(3)
    deviation = deviations(uncertainty, rigs[0], pivot) if rigs else np.ones(14)
    state = np.zeros(14)  # in standard deviations
    information = np.eye(14)
    widths = [line.width for _, a, b in frames for line in (a, b)] or [0.0]
    noise = _NOISE_PX + _NOISE_WIDTHS * float(np.median(widths))
    for step in range(_STEPS):
        now = _all_corrected(rigs, state * deviation, pivot)
        places = all_places(now, frames)
        if len(places.frame) < LEAST_PLACES:
            raise HardFrame(
                f"the views share only {len(places.frame)} places (ends, turning points) that "
                f"tell their geometry; {LEAST_PLACES} are needed"
            )
        error = sampson(now, places)
        if step == 0:
            before = epipolar_distance(now, places)
        slope = np.empty((len(error), 14))
        for i in range(14):
            nudged = state + 1e-3 * np.eye(14)[i]
            there = _all_corrected(rigs, nudged * deviation, pivot)
            slope[:, i] = (sampson(there, places) - error) / 1e-3
        scale = max(noise, 1.4826 * float(np.median(np.abs(error))))
        weight = 1 / (1 + (error / (2.385 * scale)) ** 2) / scale**2
        information = slope.T @ (weight[:, None] * slope) + np.eye(14)
        move = np.linalg.solve(information, -slope.T @ (weight * error) - state)
        move *= min(1.0, _LONGEST_STEP / max(float(np.linalg.norm(move)), 1e-12))
        state = state + move
        if np.abs(move).max() < _SMALL_STEP:
            break
    now = _all_corrected(rigs, state * deviation, pivot)
    after = epipolar_distance(now, all_places(now, frames))
    left = np.sqrt(np.diag(np.linalg.inv(information)))
    unit = np.where(IN_DEGREES, np.degrees(deviation), deviation)
    changes = tuple(
        Change("a" if i < 7 else "b", PARAMETERS[i % 7], *map(float, row))
        for i, row in enumerate(np.column_stack([state, np.ones(14), left]) * unit[:, None])
    )
    return RigRefinement(now[0], changes, before, after, len(places.frame), pivot)


@dataclass(frozen=True)
class Agreement:
    """How well two views agree about a device.

    Parameters
    ----------
    epipolar_error : float
        Median distance of the places from the epipolar lines of their partners, px; not a
        number where there is none.
    places : int
        How many there are.
    width : float
        Median width of the device, px; not a number where it was not seen.
    """

    epipolar_error: float
    places: int
    width: float


def agreement(observations: Iterable[Observation]) -> Agreement:
    """Measure how well two views agree about the device that both see.

    Parameters
    ----------
    observations : iterable of Observation

    Returns
    -------
    Agreement
    """
    frames = seen_frames(observations)
    rigs = [rig for rig, _, _ in frames]
    places = all_places(rigs, frames)
    widths = [line.width for _, a, b in frames for line in (a, b)]
    width = float(np.median(widths)) if widths else float("nan")
    return Agreement(epipolar_distance(rigs, places), len(places.frame), width)


def _all_corrected(rigs: list[StereoRig], parameters: Floats, pivot: Floats) -> list[StereoRig]:
    """Correct each rig once, however many frames share it."""
    once = {id(rig): rig for rig in rigs}
    done = {key: corrected(rig, parameters, pivot) for key, rig in once.items()}
    return [done[id(rig)] for rig in rigs]
