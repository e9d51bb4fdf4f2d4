"""What is tried where a fit ends oddly: nearer, farther, tilted or rounded otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, partial
from typing import Any

import numpy as np

from ..arrays import Floats
from ..camera import StereoRig
from ..reconstruction import HardFrame
from .contour import Contour
from .end_piece import EndPiece
from .fit import AS_BEGUN, TubeFit
from .look import Tube
from .reach import bent_in_depth, lengthened, looked_along, other_ends, run_on
from .reference import FLAT, ROUND
from .uncertainty import noise_variance

# Fits a curve (n, 3), mm, to all edges: refit(curve, radius, gates, **details of fit_tube).
Refit = Callable[..., TubeFit]
Edges = tuple[Contour, Contour]
# An end, and what was found for it.
_Found = tuple[EndPiece, TubeFit]

# An odd end is tried otherwise so often, as long as that costs so much less than before.
_TRIES, _BETTER = 4, 0.9
# No more is tried for an end whose squared residuals are less than so many times those of all.
_CLEAR = 1.5
# An end is told from another by so little.
_TOLD = 0.99
# An end is first fitted with so many passes, and then with so many more, up to such steps, px.
_SOON, _LATE, _SETTLED_PX = 4, 12, 0.1
# Ends that look alike along a sight lie about a radius apart: an end finds the other one from so
# many radii nearer, or farther.
_NEARER_OR_FARTHER = (2.0, -2.0)
# What costs so many times as much as the best after the first of them is given up.
_HOPELESS = 3.0
# Which way the end of a narrower device bends, of such a half width, is not told, px.
_NARROW_PX = 2.0
# A flat end is as large in the picture as half a ball from so many radii behind it: π / 4.
_HALF_BALL = np.pi / 4
# The shape of an end is told where a device has at least such a half width, px.
_SHAPE_PX = 4.0
# Logarithms of how likely it is that an end is flat rather than half a ball, before it is seen, and
# of how unlikely bends are, by their integral of squared curvature times the radius.
_FLAT, _BENT = 1.8, 30.0
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
            for start in bent_in_depth(rig, before.tube, end, _NEARER_OR_FARTHER):
                with suppress(HardFrame):
                    best = min(best, piece.fit(start, shape, settled_px=settled_px), key=_cost)
            if best.cost < before.cost - told:
                other = _with_ends(fit, [(piece, best)], refit, settled_px=settled_px)
                fit = other if other.cost < fit.cost - told else fit
    return fit


def with_better_ends(rig: StereoRig, fit: TubeFit, edges: Edges, refit: Refit) -> TubeFit:
    """The best of fits that begin with an odd end otherwise, or rounded.

    What an end might be is tried on the end alone; the whole is fitted from the best of it.
    """
    for _ in range(_TRIES):
        before = fit
        for found in _other_ends(rig, fit, edges):
            with suppress(HardFrame):
                other = _with_ends(fit, found, refit)
                # Another shape is told by its end; the whole need not tell it once more.
                told = _TOLD if other.tube.capped == fit.tube.capped else 1 / _TOLD
                if _price(other) < told * _price(fit):
                    fit = other
                    break
        if fit is before:
            break
        if not any(fit.odd_ends) or fit.cost > _BETTER * before.cost:
            break
    return fit


def _other_ends(rig: StereoRig, fit: TubeFit, edges: Edges) -> Iterator[list[_Found]]:
    """What odd ends are rather, base before tip: with half a ball where that is likely, without."""
    balls = [shape == ROUND for shape in fit.tube.capped]
    if not any(fit.odd_ends) and not any(
        _may_be_a_ball(rig, fit, end, expected=balls[1 - end]) for end in (0, 1)
    ):
        return
    piece = cache(partial(EndPiece.of, rig, fit, edges))
    odd: dict[int, TubeFit] = {}
    with suppress(HardFrame):
        odd = {end: _other_end(piece(end)) for end in (0, 1) if fit.odd_ends[end]}
    found = dict(odd)
    for end in (0, 1):
        rounded = found.get(1 - end, fit).tube.capped[1 - end] == ROUND
        if _may_be_a_ball(rig, found.get(end, fit), end, expected=rounded):
            ball = _ball(piece(end), found.get(end))
            if ball:
                found[end] = ball
    for ends in (found, odd):
        if ends and (ends is found or ends != found):
            yield [(piece(end), ends[end]) for end in sorted(ends)]


def _may_be_a_ball(rig: StereoRig, fit: TubeFit, end: int, expected: bool) -> bool:
    """Whether it is worth a fit to see if a flat end is half a ball.

    A disc that both views look at can look like one, and fit quite well; and where one end is
    rounded, the other mostly is: then it is `expected`.
    """
    if fit.tube.capped[end] != FLAT or min(look.half_width for look in fit.looks) < _SHAPE_PX:
        return False
    return expected or looked_along(rig, fit.tube, end, all)


def _ball(piece: EndPiece, flat: TubeFit | None) -> TubeFit | None:
    """An end with half a ball, where that is likelier than a flat one, as found or as it is.

    A flat end turns and bends until it looks like half a ball: where both look alike, the ball is
    likelier the more the flat one bends for it.
    """
    end = piece.end
    with suppress(HardFrame):
        flat = flat or piece.fit(piece.curve, FLAT, passes=_SOON, settled_px=_SETTLED_PX)
        start, _ = _other_shape(flat.tube, end)
        ball = piece.fit(start, ROUND, passes=_LATE, settled_px=_SETTLED_PX)
        told = (flat.cost - ball.cost) / (2 * noise_variance(piece.whole.looks))
        straighter = _bending(flat.tube) - _bending(ball.tube)
        likelier = told + _BENT * straighter > _FLAT
        if likelier and (flat.odd_ends[end] or not ball.odd_ends[end]):
            return ball
    return None


def _with_ends(fit: TubeFit, found: list[_Found], refit: Refit, **details: Any) -> TubeFit:
    """The whole, fitted from where its ends were found to be, the base before the tip."""
    curve, capped = fit.tube.curve, list(fit.tube.capped)
    for piece, best in reversed(found):  # the tip first: samples are counted from the base
        if piece.is_whole and len(found) > 1 and piece.end == 1:
            continue  # the next time
        curve = piece.joined_to(curve, best.tube.curve)
        capped[piece.end] = best.tube.capped[piece.end]
    return refit(curve, fit.radius, AS_BEGUN, capped=(capped[0], capped[1]), **details)


def _other_end(piece: EndPiece) -> TubeFit:
    """The best of what is tried for an end, up to the first that is clear."""
    end, shape = piece.end, piece.whole.tube.capped[piece.end]
    best = before = piece.fit(piece.curve, shape, passes=0)
    others = other_ends(piece.rig, before.tube, before.looks, end)
    begins = [(start, shape) for start in others]
    if min(look.half_width for look in before.looks) > _SHAPE_PX:
        begins.insert(1, _other_shape(before.tube, end))
    # Most of what goes right is seen to do so soon; only where nothing does is the rest fitted on.
    for passes in (_SOON, _LATE):
        reached = []
        for start, begun in begins:
            with suppress(HardFrame):
                other = piece.fit(start, begun, passes=passes, settled_px=_SETTLED_PX)
                reached.append(other)
                # Another shape must fit better, and leave nothing odd.
                if begun == shape or (other.cost < best.cost and not other.odd_ends[end]):
                    best = min(best, other, key=_price)
            if not best.end_is_odd(end, _CLEAR):
                return best
        reached.sort(key=_price)
        begins = [
            (other.tube.curve, other.tube.capped[end])
            for other in reached
            if _price(other) < _HOPELESS * _price(reached[0])
        ]
    return best


def _cost(fit: TubeFit) -> float:
    return fit.cost


def _price(fit: TubeFit) -> float:
    """An end as it should be is worth a slightly higher cost elsewhere."""
    return fit.cost * _ODD_PRICE ** sum(fit.odd_ends)


def _bending(tube: Tube) -> float:
    """Integral of the squared curvature along a tube, times its radius."""
    steps = np.diff(tube.curve, axis=0)
    turned = np.linalg.norm(np.diff(tube.tangents, axis=0), axis=1)
    return float(tube.radius * np.sum(turned**2 / np.linalg.norm(steps, axis=1)))


def _other_shape(tube: Tube, end: int) -> tuple[Floats, int]:
    """A tube's curve (n, 3) and its end where a flat one is rounded, or the other way round.

    A flat end bends until it looks like a ball: where there is one, it need not have.
    """
    by = _HALF_BALL * tube.radius
    if tube.capped[end] == FLAT:
        return lengthened(run_on(tube, end), end, -by), ROUND
    return lengthened(tube.curve, end, by), FLAT
