"""Gauss-Newton pass by pass: look at a tube in both views, and move it to what they show."""

from __future__ import annotations

import numpy as np

from ...arrays import Booleans, Floats, Integers
from .edges import look
from .equations import crossed, step, sweep
from .noise import likeness
from .outline import CAP_POINTS, OPEN

# A flat end is seen where it has so many edges, as a share of its width.
CAP_SHARE = 0.4
# The least variance of a residual, px².
LEAST_NOISE = 1e-6
# At this gate it is settled which view shows the ends.
SETTLING = 8.0
# Views that put an end farther apart than this, px, do not show the same.
APART_PX, SHORTENED = 2.0, 0.5
# From this gate on flat ends tell how the curve runs into them.
TURNING = 5.0
# Without a gate no step is longer than this, px.
FARTHEST_PX = 4.0
# A fit that moves a point farther, mm, has lost the device; no radius is smaller, mm.
FARTHEST_MM, LEAST_MM = 1e4, 1e-3

# Of `SplineBasis`: values, slopes, first.
Basis = tuple[Floats, Floats, Integers]
# A view's projection, center and focal length, and its contour's points and directions.
Sight = tuple[Floats, Floats, float, Floats, Floats]
# What `look` gives.
Looked = tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]
Descended = tuple[
    Floats, float, float, tuple[Floats, Floats, Floats, float], Looked, Looked, Integers
]


def descend(
    basis: Basis,
    roughness: Floats,
    control: Floats,
    radius: float,
    stiffness: float,
    views: tuple[Sight, Sight],
    capped: Integers,
    shown: Integers,
    gates: Floats,
    anew: Booleans,
    pixel: float,
    settled: float,
    radius_known: bool,
    free_in_depth: bool,
) -> Descended:
    """Make passes of Gauss-Newton, until they move the curve no more.

    Parameters
    ----------
    basis, roughness
        As of `SplineBasis`.
    control : (m, 3) array
        To begin with, mm.
    radius, stiffness : float
        To begin with, mm and px²/mm².
    views : pair of tuples
    capped : (2,) array of int
        What the tube does at the base and at the tip, as of `outline`.
    shown : (2, 2) array of int
        The same as either view shows it.
    gates : (k,) array
        For each pass, of which there is one at least: edges farther off, px, are left out;
        zero for none, as of `look`.
    anew : (k,) array of bool
        Whether the stiffness is chosen anew in it.
    pixel : float
        Of the first view, where the device is, mm.
    settled : float
        A pass without gate that moves the curve by less, px, is the last.
    radius_known, free_in_depth : bool
        As of `fit_tube`.

    Returns
    -------
    control : (m, 3) array
    radius, stiffness : float
    tube : tuple
        Curve, speed, tangents and radius as they were looked at last: before the last step.
    look_a, look_b : tuples of arrays
        As from `look`.
    shown : (2, 2) array of int

    Raises
    ------
    ValueError
        Where the fit leaves the device; says how.
    """
    values, slopes, first = basis
    for gate, renewed in zip(gates.tolist(), anew.tolist(), strict=True):
        curve, speed, tangents = sweep(values, slopes, first, control)
        tube = curve, speed, tangents, radius
        looked = _looks(views, tube, shown, gate)
        if gate == SETTLING:
            before, shown = shown, ends_shown(views, curve, tangents, *looked, capped)
            if np.any(shown != before):
                looked = _looks(views, tube, shown, gate)
        told_a, told_b = looked[0][2:7], looked[1][2:7]
        moved, grown, farthest, stiffness = step(
            values, slopes, first, roughness, control, speed, tangents, told_a, told_b,
            gate <= TURNING, stiffness, noise_of(*looked) if renewed else 0.0, radius_known,
        )  # fmt: skip
        if not np.abs(moved).max() <= FARTHEST_MM:  # nor where it is not a number
            raise ValueError("the fit left the device")
        # No step goes farther than edges are looked for.
        farthest /= pixel
        longest = farthest
        if free_in_depth:
            longest = max(
                crossed(values, slopes, first, speed, told, moved, grown)
                for told in (told_a, told_b)
            )
        moved = moved * min(1.0, (gate or FARTHEST_PX) / max(longest, 1e-12))
        control, radius = control + moved, max(radius + grown, LEAST_MM)
        if gate == 0 and farthest < settled:
            break
    return control, radius, stiffness, tube, *looked, shown


def noise_of(look_a: Looked, look_b: Looked) -> float:
    """Variance that the residuals would have if each were on its own, px², from what `look` gave.

    As `uncertainty.noise_variance`.
    """
    noise = 0.0
    for looked in (look_a, look_b):
        weight, total, numbers = looked[5], looked[6], looked[9]
        samples = len(weight) // 2 - CAP_POINTS
        noise += float(numbers[0]) * likeness(weight, total, float(numbers[4]), samples) / 2
    return max(noise, LEAST_NOISE)


def ends_shown(
    views: tuple[Sight, Sight],
    curve: Floats,
    tangents: Floats,
    look_a: Looked,
    look_b: Looked,
    capped: Integers,
) -> Integers:
    """Which flat ends each view shows: where one sees the device go on, the other's is hidden.

    Parameters
    ----------
    views
        As of `descend`.
    curve, tangents : (n, 3) arrays
        The tube, mm.
    look_a, look_b
        What `look` gave of it.
    capped : (2,) array of int
        What the tube does at both ends.

    Returns
    -------
    (2, 2) array of int
        What it does in either view.
    """
    shown = np.stack([capped, capped])
    for end in range(2):
        beyond = np.full(2, np.nan)
        for view, looked in enumerate((look_a, look_b)):
            projection, _, focal, _, _ = views[view]
            sums, numbers = looked[8], looked[9]
            weight, total = sums[:2, 2 + end]
            if weight <= CAP_SHARE * 2 * numbers[2]:
                continue
            at = projection[:, :3] @ curve[-end] + projection[:, 3]
            along = projection[:, :3] @ tangents[-end]
            shortened = np.linalg.norm(along[:2] - at[:2] / at[2] * along[2]) / focal
            # Of an end that points at the camera a view tells little.
            if shortened > SHORTENED:
                beyond[view] = total / weight / shortened
        # Never so where one is not a number.
        if abs(beyond[0] - beyond[1]) > APART_PX and beyond.max() > APART_PX / 2:
            shown[int(beyond[0] > beyond[1]), end] = OPEN
    return shown


def _looks(
    views: tuple[Sight, Sight],
    tube: tuple[Floats, Floats, Floats, float],
    shown: Integers,
    gate: float,
) -> tuple[Looked, Looked]:
    """Look at a tube in both views."""
    curve, _, tangents, radius = tube
    looked = [
        look(projection, center, curve, tangents, radius, ends, points, directions, gate)
        for (projection, center, _, points, directions), ends in zip(views, shown, strict=True)
    ]
    if any(seen[9][3] < len(curve) // 4 for seen in looked):
        raise ValueError("the fit follows too little of the device's outline")
    return looked[0], looked[1]
