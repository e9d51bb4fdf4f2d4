"""What is tried where a fit ends oddly: nearer, farther, tilted or rounded otherwise."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from ..arrays import Floats
from ..camera import StereoRig
from ..reconstruction import HardFrame
from .contour import Contour
from .end_piece import EndPiece
from .fit import AS_BEGUN, TubeFit
from .look import Tube
from .reach import bent_in_depth, looked_along, moved_end, other_ends
from .reference import FLAT, ROUND

# Fits a curve (n, 3), mm, to all edges: refit(curve, radius, gates, **details of fit_tube).
Refit = Callable[..., TubeFit]
Edges = tuple[Contour, Contour]

# An odd end is tried otherwise so often, as long as that costs so much less than before.
_TRIES, _BETTER = 4, 0.9
# No more is tried for an end whose squared residuals are less than so many times those of all.
_CLEAR = 1.5
# An end is told from another by so little.
_TOLD = 0.99
# An end is first fitted with so many passes, and then with so many more, up to such steps, px.
_SOON, _LATE, _SETTLED_PX = 4, 12, 0.1
# Which way the end of a narrower device bends, of such a half width, is not told, px.
_NARROW_PX = 2.0
# A flat end is as large in the picture as half a ball from so many radii behind it: π / 4.
_HALF_BALL = np.pi / 4
# The shape of an end is told where a device has at least such a half width, px.
_SHAPE_PX = 4.0
# An odd end costs so many times as much as one that is not.
_ODD_PRICE = 1.2


def nearer_or_farther(
    rig: StereoRig, fit: TubeFit, edges: Edges, refit: Refit, settled_px: float
) -> TubeFit:
    """A fit, or one whose ends bend otherwise where a view looks along them, if better.

    Such an end may look right as it is: which way it bends is told by little. A step smaller than
    `settled_px` ends a fit.
    """
    for end in (0, 1):
        shape = fit.tube.capped[end]
        narrow = min(look.half_width for look in fit.looks) < _NARROW_PX
        if not shape or narrow or not looked_along(rig, fit.tube, end):
            continue
        told = (1 - _TOLD) * fit.cost
        piece = EndPiece.of(rig, fit, edges, end)
        with suppress(HardFrame):
            best = before = piece.fit(piece.curve, shape, settled_px=settled_px)
            for start in bent_in_depth(rig, before.tube, end, (1.0, -1.0)):
                with suppress(HardFrame):
                    best = min(best, piece.fit(start, shape, settled_px=settled_px), key=_cost)
            if best.cost < before.cost - told:
                other = _with_end(fit, piece, best, refit, settled_px=settled_px)
                fit = other if other.cost < fit.cost - told else fit
    return fit


def with_better_ends(rig: StereoRig, fit: TubeFit, edges: Edges, refit: Refit) -> TubeFit:
    """The best of fits that begin with an odd end otherwise.

    What an end might be is tried on the end alone.
    """
    for end in (0, 1):
        for _ in range(_TRIES):
            if not fit.odd_ends[end]:
                break
            before = fit
            with suppress(HardFrame):
                piece = EndPiece.of(rig, fit, edges, end)
                other = _with_end(fit, piece, _other_end(piece), refit)
                fit = other if _price(other) < _TOLD * _price(fit) else fit
            if fit.cost > _BETTER * before.cost:
                break
    # Where one end is rounded, the other mostly is.
    for end in (0, 1):
        if fit.tube.capped[end] == FLAT and fit.tube.capped[1 - end] == ROUND:
            start, capped = _other_shape(fit.tube, end)
            with suppress(HardFrame):
                other = refit(start, fit.radius, AS_BEGUN, capped=capped)
                fit = fit if other.odd_ends[end] else min(fit, other, key=_cost)
    return fit


def _with_end(
    fit: TubeFit, piece: EndPiece, found: TubeFit, refit: Refit, **details: Any
) -> TubeFit:
    """The whole, fitted from where one of its ends was found to be."""
    capped = list(fit.tube.capped)
    capped[piece.end] = found.tube.capped[piece.end]
    start = piece.joined(found.tube.curve)
    return refit(start, fit.radius, AS_BEGUN, capped=(capped[0], capped[1]), **details)


def _other_end(piece: EndPiece) -> TubeFit:
    """The best of what is tried for an end, up to the first that is clear."""
    end, shape = piece.end, piece.whole.tube.capped[piece.end]
    best = before = piece.fit(piece.curve, shape, passes=0)
    looked = []
    for start in other_ends(piece.rig, before.tube, before.looks, end):
        with suppress(HardFrame):
            other = piece.fit(start, shape, passes=0)
            looked.append((_price(other), start))
            best = min(best, other, key=_price)
    # What looks best already is fitted first; then, whatever it looks like, the other shape.
    begins = [(start, shape) for _, start in sorted(looked, key=lambda one: one[0])]
    if min(look.half_width for look in before.looks) > _SHAPE_PX:
        start, capped = _other_shape(before.tube, end)
        begins.insert(1, (start, capped[end]))
    # Most of what goes right is seen to do so soon; the rest is fitted on only where nothing does.
    for passes in (_SOON, _LATE):
        reached = []
        for start, begun in begins:
            with suppress(HardFrame):
                other = piece.fit(start, begun, passes=passes, settled_px=_SETTLED_PX)
                reached.append((other.tube.curve, begun))
                # Another shape must fit better, and leave nothing odd.
                if begun == shape or (other.cost < best.cost and not other.odd_ends[end]):
                    best = min(best, other, key=_price)
            if not best.end_is_odd(end, _CLEAR):
                return best
        begins = reached
    return best


def _cost(fit: TubeFit) -> float:
    return fit.cost


def _price(fit: TubeFit) -> float:
    """An end as it should be is worth a slightly higher cost elsewhere."""
    return fit.cost * _ODD_PRICE ** sum(fit.odd_ends)


def _other_shape(tube: Tube, end: int) -> tuple[Floats, tuple[int, int]]:
    """A tube's curve (n, 3) and its ends where a flat one is rounded, or the other way round."""
    flat = tube.capped[end] == FLAT
    shape = ROUND if flat else FLAT
    start = moved_end(tube, end, -_HALF_BALL if flat else _HALF_BALL)
    return start, (shape, tube.capped[1]) if end == 0 else (tube.capped[0], shape)
