"""What a calibration says of itself in millimetres, and what in it looks wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import StereoRig

from .model import Calibration
from .settings import Settings

# A pair of endoscope eyes is the narrowest rig there is, biplane X-ray the widest; and no X-ray
# source stands nearer to what it shows than this.
LEAST_BASELINE_MM, GREATEST_BASELINE_MM = 1.0, 5000.0
LEAST_SOURCE_DISTANCE_MM = 300.0
X_RAY = ("MayaCam", "XMALab", "RTK")
NARROW_DEG = 30.0


@dataclass(frozen=True)
class Measures:
    """Of a rig: mm, degrees, and mm in space per pixel at the common center.

    `center_named` says what that center is: where the viewing axes meet or, where they do not,
    ten baselines before view a.
    """

    baseline_mm: float
    convergence_deg: float
    mm_per_pixel: tuple[float, float]
    center_named: str


def measure(rig: StereoRig) -> Measures:
    """Baseline, convergence angle, and the size of a pixel at the common center."""
    center = _meeting(rig)
    named = "where the axes meet"
    if center is None:
        center = rig.a.center + 10 * rig.baseline * rig.a.axis
        named = "10 baselines away"
    sizes = [float(abs(camera.pixel_size(center[None])[0])) for camera in (rig.a, rig.b)]
    return Measures(rig.baseline, rig.convergence_deg, (sizes[0], sizes[1]), named)


def doubts(calibration: Calibration, settings: Settings) -> tuple[str, ...]:
    """Notes on what no real rig has: mostly a wrong unit, or exchanged views."""
    rig = calibration.rigs[0]
    notes = []
    baseline, units = rig.baseline, settings.units or "mm"
    if not LEAST_BASELINE_MM <= baseline <= GREATEST_BASELINE_MM:
        notes.append(
            f"a baseline of {baseline:.3g} mm is implausible: is the file not in {units}? "
            "Give its unit with --units"
        )
    elif calibration.source.startswith(X_RAY) and _source_distance(rig) < LEAST_SOURCE_DISTANCE_MM:
        notes.append(
            f"a source {_source_distance(rig):.0f} mm from where the views meet is implausible: "
            f"is the file not in {units}? Give its unit with --units, e.g. --units cm"
        )
    if rig.frame == "camera_a" and rig.convergence_deg < NARROW_DEG:
        right = rig.a.pixel_to_ray[:, 0]
        if right @ (rig.b.center - rig.a.center) < -0.5 * np.linalg.norm(right) * baseline:
            notes.append(
                "view b stands to the left of view a: are left and right exchanged, or is T "
                "that of the inverse motion?"
            )
    return tuple(notes)


def _source_distance(rig: StereoRig) -> float:
    """Of the nearer camera from the common center, mm; infinite where there is none."""
    center = _meeting(rig)
    if center is None:
        return float("inf")
    return float(min(np.linalg.norm(camera.center - center) for camera in (rig.a, rig.b)))


def _meeting(rig: StereoRig) -> Floats | None:
    """Where the axes through both picture centers come closest; None unless before both."""
    rays = [
        camera.rays([[(side - 1) / 2 for side in camera.image_size]])[0]
        for camera in (rig.a, rig.b)
    ]
    between = rig.b.center - rig.a.center
    cosine = rays[0] @ rays[1]
    sine_squared = 1 - cosine**2
    if sine_squared < np.sin(np.radians(1.0)) ** 2:
        return None
    along = np.array([rays[0] @ between, rays[1] @ between])
    reach_a = (along[0] - cosine * along[1]) / sine_squared
    reach_b = (cosine * along[0] - along[1]) / sine_squared
    if min(reach_a, reach_b) <= 0:
        return None
    on_a, on_b = rig.a.center + reach_a * rays[0], rig.b.center + reach_b * rays[1]
    return np.asarray((on_a + on_b) / 2)
