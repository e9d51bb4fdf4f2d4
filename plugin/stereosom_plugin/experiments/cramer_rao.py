"""How well two silhouettes can possibly determine a tube: the Cramér–Rao bound.

Written against the definition, not with the code it judges: the picture of a tube is computed
here once more, and differentiated by finite differences.

The noise model: along the outline of a mask, one boundary point a pixel, each known across the
outline to a given standard deviation, each on its own. An edge that falls evenly anywhere within
a pixel is known to 1/√12 px (the variance of a uniform distribution): `PIXEL_DEVIATION`. Where
edges are rough besides, `rough_masks.deviation` adds to it.

With one row of the Jacobian J for each boundary point, weighted by the length of outline that it
stands for, the information is JᵀJ/σ², and no unbiased estimate of the parameters has a covariance
below its inverse (S. M. Kay, "Fundamentals of Statistical Signal Processing: Estimation Theory",
1993, section 3.7). The parameters are the control points of a cubic spline, and the radius.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from stereosom.arrays import Booleans, Floats
from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig

PIXEL_DEVIATION = 1 / np.sqrt(12)
"""Standard deviation of an edge that a mask rounds to whole pixels, px."""

_DEGREE = 3
# Samples of the outline: along the curve, and around each flat end.
_ALONG, _AROUND = 600, 48
_STEP_MM = 1e-3
# Nothing lies farther away than a kilometer: what no view sees stays finite.
_PRIOR_MM = 1e6


@dataclass(frozen=True, eq=False)
class Bound:
    """The least covariance that any unbiased estimate can have, along a curve.

    `arc_lengths` (n,), mm from the base; `tangents` (n, 3); `covariance` (n, 3, 3), mm², of the
    point at each; `ends` (n,), which of them are ends of the device. `radius_deviation`, mm, of
    the radius.
    """

    arc_lengths: Floats
    tangents: Floats
    covariance: Floats
    ends: Booleans
    radius_deviation: float

    def scaled(self, factor: float) -> Bound:
        """The bound where every boundary point is `factor` times as uncertain."""
        return replace(
            self,
            covariance=factor**2 * self.covariance,
            radius_deviation=factor * self.radius_deviation,
        )

    @property
    def standard_deviation(self) -> Floats:
        """Square root of the largest eigenvalue across the curve, at its ends along it too, mm."""
        across = np.eye(3) - self.tangents[:, :, None] * self.tangents[:, None, :]
        across[self.ends] = np.eye(3)
        largest = np.linalg.eigvalsh(across @ self.covariance @ across)[:, -1]
        return np.asarray(np.sqrt(largest))

    @property
    def rms_across(self) -> Floats:
        """Root mean square distance across the curve, in both directions together, (n,), mm."""
        along = np.einsum("ni,nij,nj->n", self.tangents, self.covariance, self.tangents)
        return np.asarray(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2) - along))

    @property
    def rms(self) -> Floats:
        """Root mean square distance in all directions, along the curve too, (n,), mm."""
        return np.asarray(np.sqrt(np.trace(self.covariance, axis1=1, axis2=2)))


def cramer_rao_bound(
    curve: Backbone,
    radius: float,
    rig: StereoRig,
    *,
    deviation_px: float = PIXEL_DEVIATION,
    control_points: int = 16,
    radius_known: bool = False,
    width_seen: bool = True,
    stretch: tuple[float, float] | None = None,
    count: int = 100,
) -> Bound:
    """Bound on the covariance of a tube's backbone, seen as a silhouette in two views.

    Parameters
    ----------
    curve : Backbone
        The true one. What is estimated is how a spline displaces it.
    radius : float
        Of the tube, mm.
    rig : StereoRig
    deviation_px : float
        Standard deviation of each boundary point across the outline, px, one point a pixel.
    control_points : int
        Of the cubic spline that displaces the curve, with equal knot spans and no prior.
    radius_known : bool
        Whether the radius is given, or estimated along with the curve.
    width_seen : bool
        Whether it counts that a tube looks thinner from farther away. Along an epipolar plane
        that alone tells the depth; a method that only follows the middle between the rims
        meets the bound without it.
    stretch : (float, float), optional
        Arc lengths from and to which points are wanted, mm. Default: the whole curve. What lies
        outside of the pictures tells nothing in any case.
    count : int
        Points at equal steps of arc length.

    Examples
    --------
    Twice the noise, twice the deviation:

    >>> from stereosom.synthetic import arc, converging_rig
    >>> sharp, blurred = (
    ...     cramer_rao_bound(arc(60, 90), 2.0, converging_rig(60), deviation_px=sigma)
    ...     for sigma in (0.25, 0.5)
    ... )
    >>> (blurred.standard_deviation / sharp.standard_deviation)[::33].round(3)
    array([2., 2., 2., 2.])
    """
    family = _Family.around(curve, radius, control_points)
    known = np.full(family.size, 1 / _PRIOR_MM)
    if radius_known:
        known[-1] = 1e6
    rows = [np.diag(known)]
    for camera in (rig.a, rig.b):
        boundary, length = _boundary(family, camera, width_seen)
        rows.append(boundary * (np.sqrt(length) / deviation_px)[:, None])
    # By the triangle of JᵀJ = RᵀR: sliding along the curve, which hardly shows, would cost the
    # inverse of JᵀJ itself all its digits.
    triangle = np.linalg.inv(np.linalg.qr(np.concatenate(rows), mode="r"))
    s = np.linspace(*(stretch or (0.0, curve.length)), count)
    values = family.basis(s / curve.length)
    shifts = np.einsum("ni,iap->nap", values, triangle[:-1].reshape(control_points, 3, -1))
    covariance = shifts @ shifts.transpose(0, 2, 1)
    ends = np.isclose(s, 0) | np.isclose(s, curve.length)
    radius_deviation = float(np.linalg.norm(triangle[-1]))
    return Bound(s, curve.tangent(s), covariance, ends, radius_deviation)


# ---- the tube, and its picture -------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Tube:
    """A flat-ended tube: points and unit tangents (n, 3) of its backbone, and its radius, mm."""

    points: Floats
    tangents: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class _Family:
    """The tubes around a curve that a spline displaces, and their radii.

    `points` and `velocities` (n, 3) of the curve by its share of arc length; `values` and
    `slopes` (n, m) of the spline's basis functions `basis` there.
    """

    points: Floats
    velocities: Floats
    values: Floats
    slopes: Floats
    radius: float
    basis: BSpline[np.float64]

    @classmethod
    def around(cls, curve: Backbone, radius: float, control_points: int) -> _Family:
        inner = np.linspace(0, 1, control_points - _DEGREE + 1)
        knots = np.concatenate([np.zeros(_DEGREE), inner, np.ones(_DEGREE)])
        basis = BSpline(knots, np.eye(control_points), _DEGREE)
        share, s = np.linspace(0, 1, _ALONG), curve.arc_lengths(_ALONG)
        velocities = curve.tangent(s) * curve.length
        return cls(curve(s), velocities, basis(share), basis(share, nu=1), radius, basis)

    @property
    def size(self) -> int:
        """Number of parameters: three for each control point, then the radius."""
        return 3 * int(self.values.shape[1]) + 1

    def member(self, index: int = 0, shift: float = 0.0) -> _Tube:
        """The tube with one parameter shifted, mm."""
        if index == self.size - 1:
            return _Tube(self.points, _unit(self.velocities), self.radius + shift)
        number, axis = divmod(index, 3)
        way = shift * np.eye(3)[axis]
        points = self.points + self.values[:, number, None] * way
        velocities = self.velocities + self.slopes[:, number, None] * way
        return _Tube(points, _unit(velocities), self.radius)


def _boundary(family: _Family, camera: Camera, width_seen: bool) -> tuple[Floats, Floats]:
    """Shift of each boundary point across the outline by parameter, px/mm, and px it stands for."""
    tube = family.member()
    pieces = _outline(tube, camera)
    shown = _shown(tube, camera, pieces)
    moved = [
        [_outline(family.member(index, step), camera) for step in (_STEP_MM, -_STEP_MM)]
        for index in range(family.size)
    ]
    rows, weights, seen = [], [], []
    for piece, points in enumerate(pieces):
        along = np.gradient(points, axis=0)
        length = np.linalg.norm(along, axis=1)
        length[[0, -1]] /= 2
        normal = _unit(np.column_stack([along[:, 1], -along[:, 0]]))
        # A label that slides along the outline shows no change of it: only what is across counts.
        shift = np.stack([(up[piece] - down[piece]) / (2 * _STEP_MM) for up, down in moved], axis=2)
        rows.append(np.einsum("ni,nip->np", normal, shift))
        weights.append(length)
        seen.append(shown[piece] & np.isfinite(rows[-1]).all(axis=1) & np.isfinite(length))
    if not width_seen:  # both rims run the same way, so their normals point to the same side
        rows[0] = rows[1] = (rows[0] + rows[1]) / 2
        seen[0] = seen[1] = seen[0] & seen[1]
    kept = np.concatenate(seen)
    return np.concatenate(rows)[kept], np.concatenate(weights)[kept]


def _outline(tube: _Tube, camera: Camera) -> list[Floats]:
    """Both rims, and the outer half of each flat end: pixels (n, 2) along each.

    A surface point c + R n, n across the curve, is on the rim where its ray touches the tube:
    n·(c + R n − o) = 0 for the camera centre o. With v the part of c − o across the curve and
    n at the angle φ from v, that is cos φ = −R/|v|. Where there is no such angle, because the
    tube is seen end on, pixels are NaN.
    """
    away = tube.points - camera.center
    away -= np.sum(away * tube.tangents, axis=1, keepdims=True) * tube.tangents
    lean = tube.radius / np.linalg.norm(away, axis=1)
    first = _unit(away)
    second = np.cross(tube.tangents, first)
    opening = np.arccos(np.where(lean < 1, -lean, np.nan))

    def seen(at: Any, angle: Floats) -> Floats:
        normal = np.cos(angle)[:, None] * first[at] + np.sin(angle)[:, None] * second[at]
        return camera.project(tube.points[at] + tube.radius * normal)

    pieces = [seen(slice(None), opening), seen(slice(None), -opening)]
    for end, outward in ((0, -tube.tangents[0]), (-1, tube.tangents[-1])):
        half = opening[end] if np.isfinite(opening[end]) else np.pi
        # From rim to rim: over the far side where the disc shows its face, else over the near one.
        if outward @ (tube.points[end] - camera.center) < 0:
            pieces.append(seen(end, np.linspace(-half, half, _AROUND)))
        else:
            pieces.append(seen(end, np.linspace(half, 2 * np.pi - half, _AROUND)))
    return pieces


def _shown(tube: _Tube, camera: Camera, pieces: list[Floats]) -> list[Booleans]:
    """Which outline points lie in the picture, and behind or before no other part of the tube.

    A rim is hidden inside the picture of a ball of the tube's radius around another place of it.
    """
    center = camera.project(tube.points)
    half_width = np.minimum(*(np.linalg.norm(rim - center, axis=1) for rim in pieces[:2]))
    half_width = np.nan_to_num(half_width)  # seen end on: no width is known
    way = np.linalg.norm(np.diff(tube.points, axis=0), axis=1).cumsum()
    # A ball at a flat end bulges beyond it: the end's own disc is not hidden by it.
    beyond = np.append(way, way[-1]) > 1.5 * tube.radius
    everywhere = np.ones_like(beyond)
    others = [everywhere, everywhere, beyond, beyond[::-1]]
    width, height = camera.image_size
    shown = []
    for points, other in zip(pieces, others, strict=True):
        distance = np.linalg.norm(points[:, None] - center[other], axis=2)
        hidden = np.any(distance < half_width[other] - 0.5, axis=1)
        inside = np.all((points > -0.5) & (points < [width - 0.5, height - 0.5]), axis=1)
        shown.append(inside & ~hidden)
    return shown


def _unit(vectors: Floats) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-12))
