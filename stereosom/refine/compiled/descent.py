"""As `reference.descent`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled
from ..reference.descent import (
    APART_PX,
    CAP_SHARE,
    FARTHEST_MM,
    FARTHEST_PX,
    LEAST_MM,
    LEAST_NOISE,
    SETTLING,
    SHORTENED,
    TURNING,
)
from ..reference.outline import CAP_POINTS, OPEN
from .edges import look
from .equations import crossed, step, sweep
from .noise import likeness


@compiled
def descend(  # type: ignore[no-untyped-def]
    basis, roughness, control, radius, stiffness, views, capped, shown, gates, anew,
    pixel, settled, radius_known, free_in_depth,
):  # fmt: skip
    """As `reference.descend`."""
    values, slopes, first = basis
    view_a, view_b = views
    for number in range(len(gates)):
        gate = gates[number]
        curve, speed, tangents = sweep(values, slopes, first, control)
        look_a = _look(view_a, curve, tangents, radius, shown[0], gate)
        look_b = _look(view_b, curve, tangents, radius, shown[1], gate)
        if gate == SETTLING:
            before, shown = shown, ends_shown(views, curve, tangents, look_a, look_b, capped)
            if np.any(shown != before):
                look_a = _look(view_a, curve, tangents, radius, shown[0], gate)
                look_b = _look(view_b, curve, tangents, radius, shown[1], gate)
        told_a, told_b = look_a[2:7], look_b[2:7]
        moved, grown, farthest, stiffness = step(
            values, slopes, first, roughness, control, speed, tangents, told_a, told_b,
            gate <= TURNING, stiffness, noise_of(look_a, look_b) if anew[number] else 0.0,
            radius_known,
        )  # fmt: skip
        if not np.abs(moved).max() <= FARTHEST_MM:
            raise ValueError("the fit left the device")
        farthest /= pixel
        longest = farthest
        if free_in_depth:
            longest = max(
                crossed(values, slopes, first, speed, told_a, moved, grown),
                crossed(values, slopes, first, speed, told_b, moved, grown),
            )
        moved *= min(1.0, (gate or FARTHEST_PX) / max(longest, 1e-12))
        tube = curve, speed, tangents, radius
        control, radius = control + moved, max(radius + grown, LEAST_MM)
        if (gate == 0 and farthest < settled) or number == len(gates) - 1:
            return control, radius, stiffness, tube, look_a, look_b, shown, farthest
    raise ValueError("no passes")


@compiled
def noise_of(look_a, look_b):  # type: ignore[no-untyped-def]
    """As `reference.noise_of`."""
    noise = 0.0
    for looked in (look_a, look_b):
        weight, total, numbers = looked[5], looked[6], looked[9]
        samples = len(weight) // 2 - CAP_POINTS
        noise += numbers[0] * likeness(weight, total, numbers[4], samples) / 2
    return max(noise, LEAST_NOISE)


@compiled
def ends_shown(views, curve, tangents, look_a, look_b, capped):  # type: ignore[no-untyped-def]
    """As `reference.ends_shown`."""
    shown = np.empty((2, 2), dtype=np.int64)
    shown[0], shown[1] = capped, capped
    beyond, at, along = np.empty(2), np.empty(3), np.empty(3)
    for end in range(2):
        place = end * (len(curve) - 1)
        for view, looked in enumerate((look_a, look_b)):
            projection, _, focal, _, _ = views[view]
            sums, numbers = looked[8], looked[9]
            beyond[view] = np.nan
            if sums[0, 2 + end] <= CAP_SHARE * 2 * numbers[2]:
                continue
            for row in range(3):
                at[row], along[row] = projection[row, 3], 0.0
                for axis in range(3):
                    at[row] += projection[row, axis] * curve[place, axis]
                    along[row] += projection[row, axis] * tangents[place, axis]
            x = along[0] - at[0] / at[2] * along[2]
            y = along[1] - at[1] / at[2] * along[2]
            shortened = np.sqrt(x**2 + y**2) / focal
            if shortened > SHORTENED:
                beyond[view] = sums[1, 2 + end] / sums[0, 2 + end] / shortened
        if abs(beyond[0] - beyond[1]) > APART_PX and beyond.max() > APART_PX / 2:
            shown[int(beyond[0] > beyond[1]), end] = OPEN
    return shown


@compiled
def _look(view, curve, tangents, radius, ends, gate):  # type: ignore[no-untyped-def]
    """What a view shows of a tube."""
    projection, center, _, points, directions = view
    looked = look(projection, center, curve, tangents, radius, ends, points, directions, gate)
    if looked[9][3] < len(curve) // 4:
        raise ValueError("the fit follows too little of the device's outline")
    return looked
