"""What is tried where a fit ends oddly: nearer, farther, tilted or rounded otherwise."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from ..arrays import Floats
from ..camera import StereoRig
from ..reconstruction import HardFrame
from .fit import FROM_CLOSE, TubeFit
from .look import Tube
from .reach import bent_in_depth, looked_along, moved_end, other_ends
from .reference import FLAT, ROUND

# Fits a curve (n, 3), mm, to the same edges: refit(curve, radius, gates, **details of fit_tube).
Refit = Callable[..., TubeFit]

# An odd end is tried otherwise so often, as long as that costs so much less than before.
_TRIES, _BETTER = 4, 0.9
# Which way an end bends that a view looks along is told by so little.
_TOLD = 0.99
# Which way the end of a narrower device bends, of such a half width, is not told, px.
_NARROW_PX = 2.0
# A flat end is as large in the picture as half a ball from so many radii behind it: π / 4.
_HALF_BALL = np.pi / 4
# The shape of an end is told where a device has at least such a half width, px.
_SHAPE_PX = 4.0
# An odd end costs so many times as much as one that is not.
_ODD_PRICE = 1.2


def nearer_or_farther(rig: StereoRig, fit: TubeFit, refit: Refit, settled_px: float) -> TubeFit:
    """A fit, or one whose ends bend otherwise where a view looks along them, if better.

    Such an end may look right as it is: which way it bends is told by little. A step smaller than
    `settled_px` ends a fit.
    """
    for end in (0, 1):
        narrow = min(look.half_width for look in fit.looks) < _NARROW_PX
        if not fit.tube.capped[end] or narrow or not looked_along(rig, fit.tube, end):
            continue
        before = fit
        for start in bent_in_depth(rig, before.tube, end, (1.0, -1.0)):
            with suppress(HardFrame):
                other = refit(
                    start, before.radius, FROM_CLOSE,
                    capped=before.tube.capped, settled_px=settled_px,
                )  # fmt: skip
                fit = other if other.cost < _TOLD * fit.cost else fit
    return fit


def with_better_ends(rig: StereoRig, fit: TubeFit, refit: Refit) -> TubeFit:
    """The best of fits that begin with an odd end otherwise."""
    for end in (0, 1):
        for _ in range(_TRIES):
            if not fit.odd_ends[end]:
                break
            before = fit
            fit = _other_end(rig, fit, refit, end)
            if fit.cost > _BETTER * before.cost:
                break
    # Where one end is rounded, the other mostly is.
    for end in (0, 1):
        if fit.tube.capped[end] == FLAT and fit.tube.capped[1 - end] == ROUND:
            start, capped = _other_shape(fit.tube, end)
            with suppress(HardFrame):
                other = refit(start, fit.radius, FROM_CLOSE, capped=capped)
                fit = fit if other.odd_ends[end] else min(fit, other, key=lambda one: one.cost)
    return fit


def _other_end(rig: StereoRig, fit: TubeFit, refit: Refit, end: int) -> TubeFit:
    """The best of what is tried for an end, up to the first that is not odd.

    An end as it should be is worth a slightly higher cost elsewhere.
    """

    def price(other: TubeFit) -> float:
        return other.cost * (_ODD_PRICE if other.odd_ends[end] else 1.0)

    best, capped = fit, fit.tube.capped
    begins = []
    for start in other_ends(rig, fit.tube, fit.looks, end):
        with suppress(HardFrame):
            looked = refit(start, fit.radius, FROM_CLOSE, passes=0, capped=capped)
            begins.append((price(looked), start, capped))
            best = min(best, looked, key=price)
    # What looks best already is fitted first; then, whatever it looks like, the other shape.
    begins.sort(key=lambda begin: begin[0])
    if min(look.half_width for look in fit.looks) > _SHAPE_PX:
        begins.insert(1, (0.0, *_other_shape(fit.tube, end)))
    for _, start, ends in begins:
        with suppress(HardFrame):
            other = refit(start, fit.radius, FROM_CLOSE, capped=ends)
            # Another shape must fit better, and leave nothing odd.
            if ends == capped or (other.cost < best.cost and not other.odd_ends[end]):
                best = min(best, other, key=price)
        if not best.odd_ends[end]:
            break
    return best


def _other_shape(tube: Tube, end: int) -> tuple[Floats, tuple[int, int]]:
    """A tube's curve (n, 3) and its ends where a flat one is rounded, or the other way round."""
    flat = tube.capped[end] == FLAT
    shape = ROUND if flat else FLAT
    start = moved_end(tube, end, -_HALF_BALL if flat else _HALF_BALL)
    return start, (shape, tube.capped[1]) if end == 0 else (tube.capped[0], shape)
