"""Where a fit begins, and what of it the next frame need not try."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ..arrays import Floats
from ..backbone import Backbone
from ..entering import eyes_alike
from ..observation import Observation, View
from ..reconstruction import HardFrame, Tried
from .contour import Contour, mask_contour
from .fit import AS_BEGUN, FROM_AFAR, FROM_NEAR, ON_TRACK, TubeFit, fit_tube
from .kernels import kernels
from .odd_ends import nearer_or_farther, with_better_ends
from .reference import FLAT, OPEN, ROUND
from .start import first_curve, matched_curve
from .walked import walked

# Points of a curve that a fit begins with.
_SAMPLES = 121
# Pixels of a mask this near to the border of the view are cut off there, and show no edge, px.
_CUT_OFF = 2.5
# A fit that takes more passes than this does so for an end that is not as it seems.
_SOON = 11
# Edges of a mask without dirt are off by less, as a mean of squares, px².
_CLEAN_PX2 = 0.1
# Where steps get smaller than this, px, the fit of a device that is followed ends.
_FOLLOWED_PX = 0.15
# A device with more edges in a view than twice so many is first followed by some, to such steps.
_ENOUGH, _NEAR_PX = 1000, 1.0
_NEITHER = (False, False)
# A fit elsewhere is worth leaving what was followed where it costs so much less.
_BETTER = 0.9
# What was tried in vain is tried again where a fit costs so many times what it did then.
_WORSE = 1.25
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
            at_border.append(np.compress(cut, contour.points, axis=0))
            edges.append(contour.where(~cut) if len(at_border[-1]) else contour)
        return cls(seen, (edges[0], edges[1]), (at_border[0], at_border[1]), radius, segments)

    def anywhere(
        self, expected: Floats | None = None, rounded: tuple[bool, bool] = _NEITHER
    ) -> TubeFit:
        """Fit from the matched middle lines of both masks, the best of what that gives.

        Where the views stand far apart, each matched pair of places is a good point already;
        where they are close, the points' depths are not, and a curve is begun with that is
        smooth, or with the `expected` one, (n, 3) mm. Of that one `rounded` ends stay so.
        """
        fits, refused = [], None
        close = eyes_alike(self.seen.rig)
        if expected is not None and close:
            with suppress(HardFrame):
                radius, _ = _radius_by_area(self.seen, expected)
                capped = self._capped(expected, radius, rounded)
                fits.append(self._fit(expected, radius, FROM_AFAR, capped=capped))
        begun = partial(self._begun, expected, rounded)
        begins = [partial(begun, first_curve, gates=gates) for gates in (FROM_NEAR, FROM_AFAR)]
        if not close:
            begins = [partial(begun, matched_curve, gates=FROM_AFAR, passes=_SOON), begins[0]]
        for begin in begins:
            try:
                fits.append(begin())
            except HardFrame as error:
                refused = error
                continue
            if not (_doubtful(fits[-1]) if close else fits[-1].misses):
                break
        if not fits:
            raise refused or HardFrame("the two views do not show the same device")
        fit = min(fits, key=_cost)
        if close:
            return with_better_ends(self.seen.rig, fit, self.edges, self._fit)
        fit = self._with_better_ends(fit)
        unlike = any(fit.odd_ends) and _cost_per_edge(fit) > _CLEAN_PX2
        if unlike and len(fits) == 1 and expected is None:
            with suppress(HardFrame):  # what is matched may go astray in depth at an end
                fit = min(fit, self._with_better_ends(begins[-1]()), key=_cost)
        return fit

    def near(self, start: Backbone, tried: Tried | None) -> tuple[TubeFit, Tried | None]:
        """Fit from where the device is expected; anywhere, where it does not seem to be there.

        A round tip is odd in every frame to a model with flat ends: what was `tried` in vain is
        tried again only where a fit costs more than it did then. Returned beside the fit is what
        the next frame need not try.
        """
        curve = start.polyline(_SAMPLES)
        rounded = tried.round_ends if tried else _NEITHER
        fit = self._followed(curve, rounded)
        if not eyes_alike(self.seen.rig) and not fit.misses:
            fit = nearer_or_farther(self.seen.rig, fit, self.edges, self._fit, _FOLLOWED_PX)
        if _as_good(fit, tried):
            return fit, tried
        odd = fit.odd_ends
        if not fit.ends_seen and not fit.misses:  # near, but for an end
            with suppress(HardFrame):
                again = self._fit(fit.tube.curve, fit.radius, FROM_NEAR, capped=fit.tube.capped)
                fit = min(fit, again, key=_cost)
            if _as_good(fit, tried):
                return fit, tried
        other = None
        # An end that is seen, and odd all the same, is so anywhere.
        if fit.misses or not fit.ends_seen:
            with suppress(HardFrame):
                other = self.anywhere(curve, rounded)
        if other is None or other.cost >= _BETTER * fit.cost:
            fit = with_better_ends(self.seen.rig, fit, self.edges, self._fit)
        if other is not None and other.cost < _BETTER * fit.cost:
            fit = other
        return fit, what_was_tried(fit, odd)

    def _begun(
        self,
        expected: Floats | None,
        rounded: tuple[bool, bool],
        begin: Callable[[Observation], tuple[Floats, float]],
        **details: Any,
    ) -> TubeFit:
        """Fit from a curve and radius that are read off the masks, as of `anywhere`."""
        curve, radius = begin(self.seen)
        if expected is not None and _runs_backwards(curve, expected):
            curve = curve[::-1]
        return self._fit(curve, radius, capped=self._capped(curve, radius, rounded), **details)

    def _with_better_ends(self, fit: TubeFit) -> TubeFit:
        """The best of what its ends may be; what stopped soon goes on, where that is as it is."""
        better = with_better_ends(self.seen.rig, fit, self.edges, self._fit)
        if better is fit and not fit.settled:
            with suppress(HardFrame):
                return self._fit(fit.tube.curve, fit.radius, AS_BEGUN, capped=fit.tube.capped)
        return better

    def _followed(self, curve: Floats, rounded: tuple[bool, bool]) -> TubeFit:
        """Fit from a curve (n, 3) near by, from some of the edges first where there are many."""
        radius, half_width = _radius_by_area(self.seen, curve)
        if not eyes_alike(self.seen.rig):
            moved = walked(self.seen, curve, self.radius or radius, rounded)
            if moved is not curve:
                curve = moved
                radius, half_width = _radius_by_area(self.seen, curve)
        # A device that is wide in the picture moves farther.
        gates = (half_width, *ON_TRACK) if half_width > ON_TRACK[0] else ON_TRACK
        follow = partial(
            self._fit,
            radius=radius,
            capped=self._capped(curve, radius, rounded),
            free_in_depth=eyes_alike(self.seen.rig),
        )
        many = max(len(edges) for edges in self.edges)
        if many > 2 * _ENOUGH:
            some = slice(None, None, many // _ENOUGH)
            fewer = (self.edges[0].where(some), self.edges[1].where(some))
            rough = follow(curve, gates=gates, settled_px=_NEAR_PX, edges=fewer)
            curve, gates = rough.backbone.polyline(_SAMPLES), ON_TRACK
        return follow(curve, gates=gates, settled_px=_FOLLOWED_PX)

    def _fit(
        self,
        curve: Floats,
        radius: float,
        gates: Sequence[float],
        edges: tuple[Contour, Contour] | None = None,
        **details: Any,
    ) -> TubeFit:
        radius = self.radius or radius
        if "capped" not in details:
            details["capped"] = self._capped(curve, radius)
        return fit_tube(
            self.seen.rig,
            edges or self.edges,
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


def what_was_tried(fit: TubeFit, odd: tuple[bool, bool] = _NEITHER) -> Tried | None:
    """What the frame after a fit need not try; `odd` are the ends that were so, and are not now."""
    odd = (odd[0] or fit.odd_ends[0], odd[1] or fit.odd_ends[1])
    rounded = (fit.tube.capped[0] == ROUND, fit.tube.capped[1] == ROUND)
    if any(odd) or any(rounded) or _doubtful(fit):
        return Tried(odd, _cost_per_edge(fit), rounded)
    return None


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


def _runs_backwards(curve: Floats, expected: Floats) -> bool:
    """Whether a curve (n, 3) begins where another, (m, 3), ends."""
    ends, places = curve[[0, -1]], expected[[0, -1]]
    return bool(np.sum((ends - places) ** 2) > np.sum((ends[::-1] - places) ** 2))


def _pieces(curve: Floats, radius: float) -> int:
    """Pieces of spline for a device along a curve (n, 3): a long thin one may have more bends."""
    widths = float(kernels().reach_along(curve)[-1]) / (2 * radius)
    return int(min(max(widths / _PIECE_WIDTHS, _FEWEST), _MOST))


def _doubtful(fit: TubeFit) -> bool:
    """Whether a fit misses much of what is seen, or ends where no end is seen."""
    return fit.misses or any(fit.odd_ends)


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
