"""One spline and one radius for both views: Gauss-Newton on the outlines of a tube.

The distance of each edge point of both masks to the silhouette of the tube, across it, is a
residual; sliding along the tube costs nothing. How stiff the spline is, is chosen by the evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from ..arrays import Booleans, Floats, Integers
from ..backbone import Backbone
from ..camera import StereoRig
from ..reconstruction import HardFrame
from .contour import Contour
from .kernels import kernels
from .look import Look, Tube
from .reach import seen_stretch
from .reference import FLAT
from .spline import SplineBasis, spline_basis
from .uncertainty import covariance_along

# Edges farther from the outline than this, px, in one pass after the other, are no part of it;
# then the spread of the residuals decides.
FROM_AFAR = (40.0, 20.0, 12.0, 8.0, 4.0)
FROM_NEAR = (14.0, 12.0, 8.0, 4.0)
ON_TRACK = (7.0,)
# A curve whose ends may be tilted right already: they tell how it runs at once.
AS_BEGUN: tuple[float, ...] = ()
# No gate is wider than so many widths of the device.
_WIDEST_GATE = 2.0
# At this gate the ends are placed anew.
_PLACING = 12.0
# From afar, some of the edges tell as much as all.
_SOME = slice(None, None, 4)
# A flat end whose squared residuals are so many times those of all is odd.
_ODD, _ODD_PX2 = 2.0, 1.0
# So is one beside which so many edges belong nowhere, as a share of its half width, and number.
_BESIDE, _BESIDE_PX = 1.0, 4.0
# A view that looks along an end so much, as a cosine, may see it before the device, as no edge.
_END_ON = 0.9
# The flat end of a device of a smaller half width is too small to judge, px.
_NARROW_PX = 2.0
# A fit that misses so much of its outline, in half widths, or so many of the edges, as a share,
# may follow something else than the device.
_MISSED, _STRAY = 6.0, 0.05
# What the evidence most often finds for a spline's roughness, times its stiffness, px².
_ROUGHNESS_PX2 = 2.0


@dataclass(frozen=True, eq=False)
class TubeFit:
    """A fitted tube.

    Attributes
    ----------
    backbone : Backbone
    radius : float
        mm.
    tube : Tube
    looks : pair of Look
        What the views show of it.
    radius_known : bool
        Whether the radius was given.
    """

    backbone: Backbone
    radius: float
    tube: Tube
    looks: tuple[Look, Look]
    radius_known: bool

    @cached_property
    def covariance(self) -> Floats:
        """At the samples of the tube's curve, (n, 3, 3), mm²."""
        return covariance_along(self.tube, self.looks, self.radius_known)

    @property
    def ends_seen(self) -> bool:
        """Whether both views show every end where it is, as far as they can."""
        return all(all(self._seen(end)) for end, capped in enumerate(self.tube.capped) if capped)

    def _seen(self, end: int) -> tuple[bool, bool]:
        """Whether a view shows an end, or looks along it while the other one shows it."""
        a, b = self.looks
        seen_a, seen_b = a.cap_seen[end], b.cap_seen[end]
        if seen_a and seen_b:
            return True, True
        along_a, along_b = a.slant[end] > _END_ON, b.slant[end] > _END_ON
        return seen_a or (seen_b and along_a), seen_b or (seen_a and along_b)

    @cached_property
    def cost(self) -> float:
        """Sum of squared residuals, px²; edges that belong nowhere are two pixels off.

        So is an outline without edges, for each pixel of it.
        """
        return sum(
            sum(look.sums[2]) + 4 * (look.stray * look.edges + unseen)
            for look, (unseen, _) in zip(self.looks, self._unseen, strict=True)
        )

    @cached_property
    def misses(self) -> bool:
        """Whether much of the outline shows no edges, or many edges belong nowhere.

        Then it may follow something else than the device.
        """
        missed = sum(bare for _, bare in self._unseen)
        return missed > _MISSED * self.looks[0].half_width or any(
            look.stray > _STRAY for look in self.looks
        )

    @cached_property
    def _unseen(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Of both looks."""
        look_a, look_b = self.looks
        return look_a.unseen_px(self.tube.capped), look_b.unseen_px(self.tube.capped)

    @cached_property
    def odd_ends(self) -> tuple[bool, bool]:
        """Whether the flat end at the base, and at the tip, is seen worse than all the rest."""
        return self.end_is_odd(0), self.end_is_odd(1)

    def end_is_odd(self, end: int, times: float = _ODD) -> bool:
        """Whether a flat end has so many times the squared residuals that all edges have."""
        if not self.tube.capped[end]:
            return False
        for look, seen in zip(self.looks, self._seen(end), strict=True):
            unseen = not seen and look.half_width > _NARROW_PX
            weight, squares = look.sums[0][2 + end], look.sums[2][2 + end]
            beside = look.stray_at_ends[end] > _BESIDE * look.half_width + _BESIDE_PX
            if unseen or beside or squares > times * look.spread * weight + _ODD_PX2:
                return True
        return False


def fit_tube(
    rig: StereoRig,
    contours: tuple[Contour, Contour],
    start: Floats,
    radius: float,
    *,
    capped: tuple[int, int] = (FLAT, FLAT),
    radius_known: bool = False,
    segments: int = 24,
    gates: Sequence[float] = FROM_AFAR,
    passes: int = 15,
    settled_px: float = 0.05,
    free_in_depth: bool = False,
) -> TubeFit:
    """Fit a tube to the contours of both views.

    Parameters
    ----------
    rig : StereoRig
    contours : pair of Contour
    start : (n, 3) array
        Points along a curve within some widths of the device, mm.
    radius : float
        To begin with, mm.
    capped : (int, int)
        What the device does at the base and at the tip, as of `Tube`.
    radius_known : bool
        Whether the radius stays as it is.
    segments : int
        Pieces of the cubic spline; more than needed does no harm.
    gates : sequence of float
        Edges farther off, px, are left out, in one pass after the other.
    passes : int
        Of Gauss-Newton, at most; with none, the start is looked at as it is.
    settled_px : float
        A step that moves the curve by less is the last.
    free_in_depth : bool
        Whether a step is limited in the pictures alone, and not in space too. To follow outlines
        that are near, close eyes go far in depth.

    Raises
    ------
    HardFrame
        Where the curve leaves the contours.
    """
    basis = spline_basis(segments)
    control = _followed_by(basis, rig, start)
    if passes == 0:
        tube = Tube.of(basis, control, radius, capped)
        looks = _looks(rig, contours, tube, None)
        return TubeFit(basis.backbone(control), radius, tube, looks, radius_known)
    roughness = basis.roughness_like(control)
    stiffness = _ROUGHNESS_PX2 / max(float(np.vdot(control, roughness @ control)), 1e-12)
    pixel_mm = float(rig.a.pixel_size(start[:1])[0])
    widest = max(_WIDEST_GATE * 2 * radius / pixel_mm, _PLACING)
    legs = _legs(tuple(min(gate, widest) for gate in gates), passes)
    ends = np.array(capped, dtype=np.int64)
    shown = np.array((capped, capped), dtype=np.int64)
    for gate, *leg in legs:
        if gate == _PLACING:
            tube = Tube.of(basis, control, radius, capped)
            looks = _looks(rig, contours, tube, gate, shown)
            stretch = seen_stretch(rig, contours, tube, looks, gate)
            control = _followed_by(basis, rig, stretch)
        drawn = contours if gate <= _PLACING else tuple(c.where(_SOME) for c in contours)
        views = tuple(
            (camera.projection, camera.center, camera.focal_length, edges.points, edges.directions)
            for camera, edges in zip((rig.a, rig.b), drawn, strict=True)
        )
        try:
            control, radius, stiffness, looked_at, *looked, shown = kernels().descend(
                (basis.values, basis.slopes, basis.first), roughness, control, radius, stiffness,
                views, ends, shown, *leg, pixel_mm, settled_px, radius_known, free_in_depth,
            )  # fmt: skip
        except ValueError as error:
            raise HardFrame(str(error)) from None
    curve, speed, tangents, looked_at_radius = looked_at
    tube = Tube(curve, tangents, speed, looked_at_radius, capped)
    look_a, look_b = (Look.of(*one) for one in zip(looked, drawn, strict=True))
    return TubeFit(basis.backbone(control), radius, tube, (look_a, look_b), radius_known)


def _followed_by(basis: SplineBasis, rig: StereoRig, curve: Floats) -> Floats:
    """Control points (m, 3) that follow a curve (n, 3) with even speed in the pictures."""
    a, b = rig.a, rig.b
    reach = kernels().reach_in_pictures(
        a.projection, a.focal_length, b.projection, b.focal_length, curve
    )
    return basis.control_points(curve, reach)


@lru_cache(maxsize=64)
def _legs(gates: tuple[float, ...], passes: int) -> list[tuple[float, Floats, Booleans]]:
    """Passes in a row between which the curve is not placed anew, and which see the same edges.

    For each leg its first gate, the gates of all of its passes, and whether the stiffness is
    chosen anew in them: while the curve still comes nearer.
    """
    every = np.zeros(passes)
    every[: len(gates)] = gates[:passes]
    anew = np.arange(passes) <= max(len(gates), 1)
    anew[0] = len(gates) > 1
    begins = (every == _PLACING) | ((every <= _PLACING) & (np.append(0, every[:-1]) > _PLACING))
    begins[0] = True
    bounds = [*np.flatnonzero(begins).tolist(), passes]
    return [(float(every[a]), every[a:b], anew[a:b]) for a, b in pairwise(bounds)]


def _looks(
    rig: StereoRig,
    contours: tuple[Contour, Contour],
    tube: Tube,
    gate: float | None,
    shown: Integers | None = None,
) -> tuple[Look, Look]:
    ends = shown if shown is not None else (None, None)
    look_a = Look.at(tube, rig.a, contours[0], gate, ends[0])
    look_b = Look.at(tube, rig.b, contours[1], gate, ends[1])
    for look in (look_a, look_b):
        if look.told < look.samples // 4:
            raise HardFrame("the fit follows too little of the device's outline")
    return look_a, look_b
