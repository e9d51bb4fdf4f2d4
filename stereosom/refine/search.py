"""Where a fit begins, and what is tried where it ends oddly."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats
from ..backbone import Backbone
from ..entering import eyes_alike
from ..observation import Observation, View
from ..reconstruction import HardFrame, Tried
from .contour import Contour, mask_contour
from .fit import FROM_AFAR, FROM_CLOSE, FROM_NEAR, ON_TRACK, TubeFit, fit_tube
from .kernels import kernels
from .look import Tube
from .reach import bent_in_depth, looked_along, moved_end, other_ends
from .reference import FLAT, OPEN, ROUND
from .start import first_curve, matched_curve

# Points of a curve that a fit begins with.
_SAMPLES = 121
# Pixels of a mask this near to the border of the view are cut off there, and show no edge, px.
_CUT_OFF = 2.5
# Where steps get smaller than this, px, a fit from afar ends, and one that is followed.
_SETTLED_PX, _FOLLOWED_PX = 0.05, 0.15
# An odd end is tried otherwise so often, as long as that costs so much less than before.
_TRIES, _BETTER = 4, 0.9
# Which way an end bends that a view looks along is told by so little.
_TOLD = 0.99
# Which way the end of a narrower device bends, of such a half width, is not told, px.
_NARROW_PX = 2.0
# A flat end is as large in the picture as half a ball from so many radii behind it: π / 4.
_HALF_BALL = np.pi / 4
_NEITHER = (False, False)
# The shape of an end is told where a device has at least such a half width, px.
_SHAPE_PX = 4.0
# An odd end costs so many times as much as one that is not.
_ODD_PRICE = 1.2
# What was tried in vain is tried again where a fit costs so many times what it did then.
_WORSE = 1.25
# A fit that misses so much of its outline, in half widths, or so many of the edges, as a share,
# may follow something else than the device.
_MISSED, _STRAY = 6.0, 0.05
# A piece of spline is so many widths of the device long, within these numbers of pieces.
_PIECE_WIDTHS, _FEWEST, _MOST = 8.0, 20, 60


@dataclass(frozen=True, eq=False)
class TubeSearch:
    """The search for the tube that an observation shows.

    Attributes
    ----------
    seen : Observation
        Trimmed to the stretch that both views share.
    edges : pair of Contour
        Without where the border of a view cuts the device off.
    at_border : pair of (n, 2) arrays
        Points of the contours where it does, px.
    radius : float, optional
        Of the device, mm, where it is known.
    segments : int, optional
        Pieces of the spline. Default: by how long and thin the device is.
    """

    seen: Observation
    edges: tuple[Contour, Contour]
    at_border: tuple[Floats, Floats]
    radius: float | None
    segments: int | None

    @classmethod
    def of(cls, seen: Observation, radius: float | None, segments: int | None) -> TubeSearch:
        """Find the edges of both masks."""
        edges, at_border = [], []
        views: tuple[tuple[View, Floats], ...] = (("a", seen.pixels_a), ("b", seen.pixels_b))
        for view, pixels in views:
            contour = mask_contour(pixels)
            cut = seen.at_border(view, contour.points, _CUT_OFF)
            at_border.append(contour.points[cut])
            edges.append(contour.where(~cut) if len(at_border[-1]) else contour)
        return cls(seen, (edges[0], edges[1]), (at_border[0], at_border[1]), radius, segments)

    def anywhere(self, first: Floats | None = None) -> TubeFit:
        """Fit from the matched middle lines of both masks, or from a first curve, (n, 3) mm.

        Of the two, where both are given, the better one. Where the views stand far apart, each
        matched pair of places is a good point already; where they are close, the points' depths
        are not, and a curve is begun with that is smooth.
        """
        fits, refused = [], None
        if first is not None:
            with suppress(HardFrame):
                fits.append(self._fit(first, _radius_by_area(self.seen, first)[0], FROM_AFAR))
        close = eyes_alike(self.seen.rig)
        begins = [(first_curve, FROM_NEAR), (first_curve, FROM_AFAR)]
        if not close:
            begins = [(matched_curve, FROM_AFAR), (first_curve, FROM_NEAR)]
        for begin, gates in begins:
            try:
                curve, radius = begin(self.seen)
                fits.append(self._fit(curve, radius, gates))
            except HardFrame as error:
                refused = error
                continue
            if not (_doubtful(fits[-1]) if close else _misses(fits[-1])):
                break
        if not fits:
            raise refused or HardFrame("the two views do not show the same device")
        return self._with_better_ends(min(fits, key=_cost))

    def near(self, start: Backbone, tried: Tried | None) -> tuple[TubeFit, Tried | None]:
        """Fit from where the device is expected; anywhere, where it does not seem to be there.

        A round tip is odd in every frame to a model with flat ends: what was `tried` in vain is
        tried again only where a fit costs more than it did then. Returned beside the fit is what
        the next frame need not try.
        """
        curve = start.polyline(_SAMPLES)
        radius, half_width = _radius_by_area(self.seen, curve)
        # A device that is wide in the picture moves farther.
        gates = (half_width, *ON_TRACK) if half_width > ON_TRACK[0] else ON_TRACK
        capped = self._capped(curve, radius, tried.round_ends if tried else _NEITHER)
        fit = self._fit(curve, radius, gates, capped=capped, settled_px=_FOLLOWED_PX)
        if not eyes_alike(self.seen.rig):
            fit = self._nearer_or_farther(fit)
        if _as_good(fit, tried):
            return fit, tried
        odd = fit.odd_ends
        if not fit.ends_seen:
            with suppress(HardFrame):
                fit = min(fit, self._fit(curve, radius, FROM_NEAR, capped=capped), key=_cost)
            if _as_good(fit, tried):
                return fit, tried
        fit = self._with_better_ends(fit)
        if _doubtful(fit):
            with suppress(HardFrame):
                other = self.anywhere(curve if eyes_alike(self.seen.rig) else None)
                # As good a fit elsewhere is no reason to leave what was followed.
                fit = other if other.cost < _BETTER * fit.cost else fit
        odd = (odd[0] or fit.odd_ends[0], odd[1] or fit.odd_ends[1])
        rounded = (fit.tube.capped[0] == ROUND, fit.tube.capped[1] == ROUND)
        if any(odd) or any(rounded) or _doubtful(fit):
            return fit, Tried(odd, _cost_per_edge(fit), rounded)
        return fit, None

    def _fit(self, curve: Floats, radius: float, gates: Sequence[float], **details: Any) -> TubeFit:
        radius = self.radius or radius
        if "capped" not in details:
            details["capped"] = self._capped(curve, radius)
        return fit_tube(
            self.seen.rig,
            self.edges,
            curve,
            radius,
            radius_known=self.radius is not None,
            segments=self.segments or _pieces(curve, radius),
            gates=gates,
            **details,
        )

    def _capped(
        self, curve: Floats, radius: float, rounded: tuple[bool, bool] = _NEITHER
    ) -> tuple[int, int]:
        """What the device does at the base and at the tip: it may go on beyond a view's border."""
        opened = np.zeros(2, dtype=bool)
        rig, ends = self.seen.rig, curve[[0, -1]]
        for camera, pixels in zip((rig.a, rig.b), self.at_border, strict=True):
            if len(pixels):
                # A middle line ends half a width before the device does.
                width = 2 * radius / camera.pixel_size(ends)
                for end, place in enumerate(camera.project(ends)):
                    near = float(np.linalg.norm(pixels - place, axis=1).min())
                    opened[end] |= near < 1.5 * width[end] + 3
        base, tip = np.where(opened, OPEN, np.where(rounded, ROUND, FLAT)).tolist()
        return base, tip

    def _nearer_or_farther(self, fit: TubeFit) -> TubeFit:
        """A fit, or one whose ends bend otherwise where a view looks along them, if much better.

        Such an end may look right as it is: which way it bends is told by little.
        """
        for end in (0, 1):
            narrow = min(look.half_width for look in fit.looks) < _NARROW_PX
            if not fit.tube.capped[end] or narrow or not looked_along(self.seen.rig, fit.tube, end):
                continue
            before = fit
            for start in bent_in_depth(self.seen.rig, before.tube, end, (1.0, -1.0)):
                with suppress(HardFrame):
                    other = self._fit(
                        start, before.radius, FROM_CLOSE,
                        capped=before.tube.capped, settled_px=_FOLLOWED_PX,
                    )  # fmt: skip
                    fit = other if other.cost < _TOLD * fit.cost else fit
        return fit

    def _with_better_ends(self, fit: TubeFit) -> TubeFit:
        """The best of fits that begin with an odd end otherwise."""
        for end in (0, 1):
            for _ in range(_TRIES):
                if not fit.odd_ends[end]:
                    break
                before = fit
                fit = self._other_end(fit, end)
                if fit.cost > _BETTER * before.cost:
                    break
        # Where one end is rounded, the other mostly is.
        for end in (0, 1):
            if fit.tube.capped[end] == FLAT and fit.tube.capped[1 - end] == ROUND:
                start, capped = _other_shape(fit.tube, end)
                with suppress(HardFrame):
                    other = self._fit(start, fit.radius, FROM_CLOSE, capped=capped)
                    fit = fit if other.odd_ends[end] else min(fit, other, key=_cost)
        return fit

    def _other_end(self, fit: TubeFit, end: int) -> TubeFit:
        """The best of what is tried for an end, up to the first that is not odd.

        An end as it should be is worth a slightly higher cost elsewhere.
        """

        def price(other: TubeFit) -> float:
            return other.cost * (_ODD_PRICE if other.odd_ends[end] else 1.0)

        best, capped = fit, fit.tube.capped
        begins = []
        for start in other_ends(self.seen.rig, fit.tube, fit.looks, end):
            with suppress(HardFrame):
                looked = self._fit(start, fit.radius, FROM_CLOSE, passes=0, capped=capped)
                begins.append((price(looked), start, capped))
                best = min(best, looked, key=price)
        # What looks best already is fitted first; then, whatever it looks like, the other shape.
        begins.sort(key=lambda begin: begin[0])
        if min(look.half_width for look in fit.looks) > _SHAPE_PX:
            begins.insert(1, (0.0, *_other_shape(fit.tube, end)))
        for _, start, ends in begins:
            with suppress(HardFrame):
                other = self._fit(start, fit.radius, FROM_CLOSE, capped=ends)
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


def _cost(fit: TubeFit) -> float:
    return fit.cost


def _cost_per_edge(fit: TubeFit) -> float:
    return fit.cost / sum(look.edges for look in fit.looks)


def _as_good(fit: TubeFit, tried: Tried | None) -> bool:
    """Whether a fit is no more doubtful than the one that nothing made better."""
    if tried is None:
        return False
    new = any(odd and not known for odd, known in zip(fit.odd_ends, tried.odd_ends, strict=True))
    return not new and _cost_per_edge(fit) < _WORSE * tried.cost


def _pieces(curve: Floats, radius: float) -> int:
    """Pieces of spline for a device along a curve (n, 3): a long thin one may have more bends."""
    widths = float(kernels().reach_along(curve)[-1]) / (2 * radius)
    return int(min(max(widths / _PIECE_WIDTHS, _FEWEST), _MOST))


def _doubtful(fit: TubeFit) -> bool:
    """Whether a fit misses much of what is seen, or ends where no end is seen."""
    return _misses(fit) or any(fit.odd_ends)


def _misses(fit: TubeFit) -> bool:
    """Whether much of the outline shows no edges, or many edges belong nowhere."""
    missed = sum(look.unseen_px(fit.tube.capped) for look in fit.looks)
    return missed > _MISSED * fit.looks[0].half_width or any(
        look.stray > _STRAY for look in fit.looks
    )


def _radius_by_area(seen: Observation, curve: Floats) -> tuple[float, float]:
    """Radius of a filled device along a curve (n, 3), mm, and where it is larger, px."""
    radii, sizes = [], []
    curve = curve[::4]
    for camera, pixels in ((seen.rig.a, seen.pixels_a), (seen.rig.b, seen.pixels_b)):
        steps, depth = kernels().steps_in_picture(camera.projection, curve)
        sizes.append(depth / camera.focal_length)
        radii.append(len(pixels) / max(float(steps.sum()), 1.0) / 2 * sizes[-1])
    # Dirt adds to an area, and holes take from it; a device that went is no wide one.
    radius = min(radii)
    return radius, radius / min(sizes)
