"""How far the device reaches: the longest stretch of a tube that the views bear out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.polynomial import polynomial

from ..arrays import Booleans, Floats
from ..camera import StereoRig
from ..reconstruction import HardFrame
from .contour import Contour
from .kernels import kernels
from .look import Look, Tube

# The curve is continued by so many radii, or pixels, at either end, to see whether it goes on.
_BEYOND, _BEYOND_PX = 6.0, 24.0
# Of a hole that hides the device in one or both views, in radii.
_LONGEST_HOLE = 4.5
# A view that sees a stretch shortened to less than this share of the other's says nothing of it.
_SHORTENED = 0.4
# Rims, of two in each view, that must be seen.
_RIMS = 2
# Wrongly bent ends reach in so many radii; so far from the end the curve tells how it runs on.
_BENT, _BEFORE = 3.0, 9.0
# An end that is tilted the wrong way bends there over so many radii.
_MIRRORED = 4.0
# A view looks along an end that it sees shortened to less than this share.
_ALONG = 0.7
# The oval of a flat end seen obliquely looks like more of the rims, for less than so many radii.
_SLACK = 2.5


def seen_stretch(
    rig: StereoRig,
    contours: tuple[Contour, Contour],
    tube: Tube,
    gate: float,
) -> Floats:
    """Cut or lengthen a curve to where its rims are seen.

    A flat end shows in the picture as two rims that stop. Where a hole hides it in one view,
    the rims of the other go on, and the device with them.

    Parameters
    ----------
    rig : StereoRig
    contours : pair of Contour
    tube : Tube
        Where it is not capped the device goes on beyond the border, and the curve is
        lengthened some way beyond what is seen.
    gate : float
        Edges farther off, px, are no part of the device.

    Returns
    -------
    (n, 3) array
        Points along the curve, mm.

    Raises
    ------
    HardFrame
        Where hardly anything of it is seen.
    """
    curve, tangents = tube.curve, tube.tangents
    step = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).mean())
    if step <= 0:
        raise HardFrame("the fit shrank to a point")
    pixel = float(max(camera.pixel_size(curve[:1])[0] for camera in (rig.a, rig.b)))
    beyond = max(_BEYOND * tube.radius, _BEYOND_PX * pixel)
    beyond = min(int(np.ceil(beyond / step)), len(curve))
    ahead = step * np.arange(1, beyond + 1)[:, None]
    before, after = curve[0] - ahead[::-1] * tangents[0], curve[-1] + ahead * tangents[-1]
    extended = np.vstack([before, curve, after])
    directions = np.vstack(
        [np.tile(tangents[0], (beyond, 1)), tangents, np.tile(tangents[-1], (beyond, 1))]
    )
    even = np.ones(len(extended))
    longer = Tube(extended, directions, even, tube.radius, (False, False))
    views = (rig.a, rig.b), contours
    further = [Look.at(longer, *view, gate) for view in zip(*views, strict=True)]
    rims = np.stack([look.rims_seen for look in further]) & _telling(rig, extended)[:, None]
    seen = np.flatnonzero(rims.sum(axis=(0, 1)) >= _RIMS)
    if len(seen) < len(extended) // 10:
        raise HardFrame("the fit follows too little of the device's outline")
    hole = int(np.ceil(_LONGEST_HOLE * tube.radius / step))
    # The pieces between holes that are too long; the longest is the device.
    breaks = np.flatnonzero(np.diff(seen) > hole)
    starts, stops = seen[np.append(0, breaks + 1)], seen[np.append(breaks, len(seen) - 1)]
    longest = int(np.argmax(stops - starts))
    found = [int(starts[longest]), int(stops[longest])]
    slack, onward = (int(np.ceil(radii * tube.radius / step)) for radii in (_SLACK, 2.0))
    for end, at, outward in ((0, beyond, -1), (1, beyond + len(curve) - 1, 1)):
        farther = outward * (found[end] - at)
        if not tube.capped[end]:
            found[end] += outward * onward
        elif farther < -slack:
            continue
        elif farther > slack and any(
            # That a view shows no flat end where the fit has put it.
            goes_on and not Look.at(tube, camera, contour, gate).cap_seen[end]
            for goes_on, camera, contour in zip(_beyond(rims, at, outward), *views, strict=True)
        ):
            found[end] -= outward * onward // 2
        else:
            found[end] = at
    start, stop = max(found[0], 0), min(found[1], len(extended) - 1)
    if stop - start < len(extended) // 10:
        raise HardFrame("the fit follows too little of the device's outline")
    return np.asarray(extended[start : stop + 1])


def other_ends(rig: StereoRig, tube: Tube, looks: tuple[Look, Look], end: int) -> list[Floats]:
    """The curve (n, 3) with its base (0) or tip (1) running on otherwise.

    A flat end seen obliquely looks the same tilted to either side; a fit that has taken the
    wrong one bends into it, and does not find out. Here it bends nearer to the cameras, or farther
    from them, runs on as the stretch before does, is tilted the other way, or bends to the other
    side: what is right most often comes first. Where no view shows its last stretch, that is cut
    off.
    """
    curve, straight = tube.curve, run_on(tube, end)
    others = bent_in_depth(rig, tube, end, (-1.0, 1.0))
    others += [straight, mirrored_in_depth(rig, tube, end), 2 * straight - curve]
    rims = np.stack([look.rims_seen.any(axis=0) for look in looks])
    seen = np.flatnonzero((rims & _telling(rig, curve)).any(axis=0))
    if len(seen) > len(curve) // 2:
        cut = curve[seen[0] :] if end == 0 else curve[: seen[-1] + 1]
        if len(cut) < len(curve) - 1:
            others.insert(0, cut)
    return others


def run_on(tube: Tube, end: int) -> Floats:
    """The curve (n, 3) whose base (0) or tip (1) runs on as the stretch before it does."""
    curve, from_end = tube.curve, _from_end(tube, end)
    last = from_end < _BENT / _BEFORE
    before = ~last & (from_end < 1)
    if np.count_nonzero(before) < 4:
        return curve
    straight = curve.copy()
    way = polynomial.polyfit(from_end[before], curve[before], 2)
    straight[last] = polynomial.polyval(from_end[last], way).T
    return straight


def lengthened(curve: Floats, end: int, length: float) -> Floats:
    """A curve (n, 3), so much longer, or shorter, at its base (0) or tip (1)."""
    if length > 0:
        outward = curve[-1] - curve[-2] if end else curve[0] - curve[1]
        added = curve[[-end]] + length / max(float(np.linalg.norm(outward)), 1e-9) * outward
        return np.vstack([curve, added] if end else [added, curve])
    reach = kernels().reach_along(curve)
    left = reach[-1] - reach if end else reach
    kept = curve[left >= -length]
    return kept if len(kept) > len(curve) // 2 else curve


def bent_in_depth(rig: StereoRig, tube: Tube, end: int, shares: Sequence[float]) -> list[Floats]:
    """The curve (n, 3) bent at its base (0) or tip (1), farther from the cameras by shares.

    Where the share is one, the end moves by a radius.
    """
    tangent, depth = tube.tangents[-end], _sight(rig, tube, end)
    depth -= (depth @ tangent) * tangent
    depth *= tube.radius / max(float(np.linalg.norm(depth)), 1e-9)
    bent = np.maximum(1 - _from_end(tube, end), 0)[:, None] ** 2 * depth
    return [tube.curve + share * bent for share in shares]


def mirrored_in_depth(rig: StereoRig, tube: Tube, end: int) -> Floats:
    """The curve (n, 3) whose base (0) or tip (1) is tilted in depth as much the other way.

    The pictures of two such discs hardly differ. A bend over a length h whose offset is
    -c h (1 - s/h)² at a distance s from the end takes 2 c off the slope there: c is the slope.
    """
    sight = _sight(rig, tube, end)
    slope = float(tube.tangents[-end] @ sight) * (1 if end else -1)
    length = _MIRRORED * tube.radius
    left = np.maximum(1 - _from_end(tube, end) * _BEFORE / _MIRRORED, 0)
    return np.asarray(tube.curve - slope * length * left[:, None] ** 2 * sight)


def _sight(rig: StereoRig, tube: Tube, end: int) -> Floats:
    """Unit vector along which both views see an end, on the mean."""
    place = tube.curve[[-end]]
    sight = (rig.a.rays(rig.a.project(place)) + rig.b.rays(rig.b.project(place)))[0]
    return np.asarray(sight / max(float(np.linalg.norm(sight)), 1e-9))


def looked_along(
    rig: StereoRig, tube: Tube, end: int, views: Callable[[Iterable[bool]], bool] = any
) -> bool:
    """Whether any view, or all, look along the base (0) or the tip (1) rather than across it."""
    rays = [tube.curve[-end] - camera.center for camera in (rig.a, rig.b)]
    # Shortened to the sine of the angle between the end and the ray that sees it.
    return views(
        bool((ray @ tube.tangents[-end]) ** 2 > (1 - _ALONG**2) * (ray @ ray)) for ray in rays
    )


def _from_end(tube: Tube, end: int) -> Floats:
    """Distance of each sample from an end, 1 where the curve tells how it runs on."""
    reach = kernels().reach_along(tube.curve)
    return np.asarray((reach if end == 0 else reach[-1] - reach) / (_BEFORE * tube.radius))


def _telling(rig: StereoRig, curve: Floats) -> Booleans:
    """Whether a view tells of the samples of a curve: it does not see them shortened, (2, n)."""
    steps = [kernels().steps_in_picture(camera.projection, curve)[0] for camera in (rig.a, rig.b)]
    speed = np.pad(np.stack(steps), ((0, 0), (0, 1)), mode="edge")
    return np.asarray(speed > _SHORTENED * speed.max(axis=0))


def _beyond(rims: Booleans, at: int, outward: int) -> Booleans:
    """Whether each view shows both rims somewhere beyond a sample."""
    both: Booleans = np.all(rims[:, :, at + outward :: outward], axis=1)
    return np.asarray(np.any(both, axis=1))
