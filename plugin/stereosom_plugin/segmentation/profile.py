"""What light a round device takes across it: the profile that fits, blurred by the system."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from stereosom.arrays import Floats

from .loops import loops
from .picture import median

# The blur of an X-ray system with pixels of its own resolution, and how sure that is, px.
BLUR, BLUR_SPREAD = 0.8, 0.3
# Of the mean profile, as a share of the light: how well the model holds.
PROFILE_NOISE = 0.02
# Knots of the chords that make a profile, of half a width.
_OFFSETS = (np.arange(24) + 0.5) / 24


def profile(place: Floats, parameters: Floats) -> Floats:
    """Share of the light, (n,), that a tube takes at places across it, px.

    `parameters` as in `loops.reference.tube_profile`.
    """
    return np.asarray(loops().tube_profile(place, _OFFSETS, parameters)[0])


def fit_profile(
    darkness: Floats, across: Floats, half: float, blur: float | None
) -> tuple[Floats, float, float] | None:
    """Radius along the device (n,), absorption on the axis, and blur, of what fits best."""
    first = int(np.searchsorted(across, -half - 3, side="right"))
    near = slice(first, len(across) - first)
    place, darkness = across[near], darkness[:, near]
    taken = 1 - np.exp(-median(darkness, axis=0))
    most = float(np.clip(taken.max(), 0.02, 0.98))
    # Radius, absorption, blur, center: the blur is known beforehand, to some degree or wholly.
    start = np.array([max(half, 0.6), -np.log(1 - most), blur or BLUR, 0.0])
    low, high = np.array([0.4, 0.01, 0.3, -2.0]), np.array([3 * half + 2, 6.0, 2.5, 2.0])
    sure = np.zeros(4)
    sure[2] = (PROFILE_NOISE / (BLUR_SPREAD if blur is None else 0.01)) ** 2 * len(place)
    found = loops().fitted_profile(place, _OFFSETS, taken, start, low, high, sure)
    if not np.isfinite(found).all():
        return None
    radius, absorption, spread, _ = (float(one) for one in found)
    # The radius changes along the device, by perspective or its own make: by a straight line.
    stretches = min(6, len(darkness) // 30)
    radii = np.full(len(darkness), radius)
    if stretches >= 3:
        number = np.arange(stretches + 1)
        bounds = number * (len(darkness) // stretches)
        bounds += np.minimum(number, len(darkness) % stretches)
        rows = list(pairwise(bounds))
        parts = 1 - np.exp(-np.stack([median(darkness[a:b], axis=0) for a, b in rows]))
        model, slopes = loops().tube_profile(place, _OFFSETS, found)
        change = np.linalg.lstsq(slopes[:, [0, 1, 3]], (parts - model).T, rcond=None)[0][0]
        places = (bounds[:-1] + bounds[1:] - 1) / 2
        steps = np.arange(len(darkness)) - places.mean()
        grown = median(change[None], axis=1) + _robust_slope(places, change) * steps
        radii = np.clip(radius + grown, 0.7 * radius, 1.4 * radius)
    return radii, absorption, spread


def _robust_slope(x: Floats, y: Floats) -> float:
    """Median of the slopes between all pairs of points (Theil and Sen)."""
    i, j = np.triu_indices(len(x), 1)
    return float(median(((y[j] - y[i]) / (x[j] - x[i]))[None], axis=1)[0])
