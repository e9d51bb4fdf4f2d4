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
from ..reconstruction import HardFrame
from .contour import Contour, mask_contour
from .fit import FROM_AFAR, FROM_CLOSE, FROM_NEAR, ON_TRACK, TubeFit, fit_tube
from .kernels import kernels
from .reach import other_ends
from .start import first_curve, matched_curve

# Points of a curve that a fit begins with.
_SAMPLES = 121
# Pixels of a mask this near to the border of the view are cut off there, and show no edge, px.
_CUT_OFF = 2.5
# Where steps get smaller than this, px, a fit from afar ends, and one that is followed.
_SETTLED_PX, _FOLLOWED_PX = 0.05, 0.15
# An odd end is tried otherwise so often, as long as that costs so much less than before.
_TRIES, _BETTER = 4, 0.9
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
                fits.append(self._fit(first, _width_radius(self.seen, first), FROM_AFAR))
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

    def near(self, start: Backbone) -> TubeFit:
        """Fit from where the device is expected; anywhere, where it does not seem to be there."""
        curve = start.polyline(_SAMPLES)
        radius = _width_radius(self.seen, curve)
        fit = self._fit(curve, radius, ON_TRACK, settled_px=_FOLLOWED_PX)
        if not fit.ends_seen:
            with suppress(HardFrame):
                fit = min(fit, self._fit(curve, radius, FROM_NEAR), key=_cost)
        fit = self._with_better_ends(fit)
        if _doubtful(fit):
            with suppress(HardFrame):
                other = self.anywhere(curve if eyes_alike(self.seen.rig) else None)
                # As good a fit elsewhere is no reason to leave what was followed.
                fit = other if other.cost < _BETTER * fit.cost else fit
        return fit

    def _fit(self, curve: Floats, radius: float, gates: Sequence[float], **details: Any) -> TubeFit:
        radius = self.radius or radius
        opened = self._opened(curve, radius)
        return fit_tube(
            self.seen.rig,
            self.edges,
            curve,
            radius,
            capped=(not opened[0], not opened[1]),
            radius_known=self.radius is not None,
            segments=self.segments or _pieces(curve, radius),
            gates=gates,
            **details,
        )

    def _opened(self, curve: Floats, radius: float) -> tuple[bool, bool]:
        """Whether the device goes on at the base and at the tip, beyond the border of a view."""
        opened = np.zeros(2, dtype=bool)
        rig, ends = self.seen.rig, curve[[0, -1]]
        for camera, pixels in zip((rig.a, rig.b), self.at_border, strict=True):
            if len(pixels):
                # A middle line ends half a width before the device does.
                width = 2 * radius / camera.pixel_size(ends)
                for end, place in enumerate(camera.project(ends)):
                    near = float(np.linalg.norm(pixels - place, axis=1).min())
                    opened[end] |= near < 1.5 * width[end] + 3
        return bool(opened[0]), bool(opened[1])

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
        return fit

    def _other_end(self, fit: TubeFit, end: int) -> TubeFit:
        """The best of what is tried for an end, up to the first that is not odd."""
        best = fit
        for start in other_ends(self.seen.rig, fit.tube, fit.looks, end):
            for passes in (15, 0):
                with suppress(HardFrame):
                    other = self._fit(start, fit.radius, FROM_CLOSE, passes=passes)
                    best = min(best, other, key=_cost)
            if not best.odd_ends[end]:
                break
        return best


def _cost(fit: TubeFit) -> float:
    return fit.cost


def _pieces(curve: Floats, radius: float) -> int:
    """Pieces of spline for a device along a curve (n, 3): a long thin one may have more bends."""
    widths = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()) / (2 * radius)
    return int(np.clip(widths / _PIECE_WIDTHS, _FEWEST, _MOST))


def _doubtful(fit: TubeFit) -> bool:
    """Whether a fit misses much of what is seen, or ends where no end is seen."""
    return _misses(fit) or any(fit.odd_ends)


def _misses(fit: TubeFit) -> bool:
    """Whether much of the outline shows no edges, or many edges belong nowhere."""
    missed = sum(look.unseen_px(fit.tube.capped) for look in fit.looks)
    return missed > _MISSED * fit.looks[0].half_width or any(
        look.stray > _STRAY for look in fit.looks
    )


def _width_radius(seen: Observation, curve: Floats) -> float:
    """Radius of a filled device that follows a curve (n, 3), by the area of its masks, mm."""
    radii = []
    curve = curve[::4]
    for camera, pixels in ((seen.rig.a, seen.pixels_a), (seen.rig.b, seen.pixels_b)):
        steps, depth = kernels().steps_in_picture(camera.projection, curve)
        half_width = len(pixels) / max(float(steps.sum()), 1.0) / 2
        radii.append(half_width * depth / camera.focal_length)
    # Dirt adds to an area, and holes take from it; a device that went is no wide one.
    return float(min(radii))
