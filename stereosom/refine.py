"""One spline and one radius for both views: Gauss-Newton on the outlines of a tube.

The distance of each contour point of both masks to the silhouette of the tube, across it, is a
residual; sliding along the tube costs nothing. How stiff the spline is, is chosen by the evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from .arrays import Floats, Integers
from .backbone import Backbone
from .camera import Camera, StereoRig
from .reconstruction import HardFrame
from .tube import Contour, tube_outline

_DEGREE = 3
_SAMPLES = 400
# Contour points farther from the outline than this, px, in one pass after the other, are no part
# of it; from then on, those beyond four times the spread.
_GATES = (40.0, 20.0, 12.0, 8.0, 5.0)
# A step may slide along the curve only this weakly; a share of how strongly it is held across.
_SLIDING = 0.01
# Residuals of near contour points are alike; so many of them in a row are taken together to see
# how much less they know than if each were on its own.
_IN_A_ROW = 24


@dataclass(frozen=True, eq=False)
class TubeFit:
    """A fitted tube.

    `covariance` (3m, 3m), mm², is that of the m control points of the backbone, coordinates of
    each together; `noise` the standard deviation of the residuals, px.
    """

    backbone: Backbone
    radius: float
    covariance: Floats
    noise: float


def fit_tube(
    rig: StereoRig,
    contours: tuple[Contour, Contour],
    start: Backbone,
    radius: float,
    *,
    capped: tuple[bool, bool] = (True, True),
    radius_known: bool = False,
    segments: int = 24,
    passes: int = 20,
) -> TubeFit:
    """Fit a tube to the contours of both views.

    Parameters
    ----------
    rig : StereoRig
    contours : pair of Contour
    start : Backbone
        Within some widths of the device, and not much longer than it.
    radius : float
        To begin with, mm.
    capped : (bool, bool)
        Whether the base and the tip are ends of the device.
    radius_known : bool
        Whether the radius stays as it is.
    segments : int
        Pieces of the cubic spline; more than needed does no harm.
    passes : int
        Of Gauss-Newton, at most.

    Raises
    ------
    HardFrame
        Where the curve leaves the contours.
    """
    basis = _Basis(segments)
    control = basis.control_points(_without_overshoot(rig, contours, start, 0.5 * radius))
    stiffness = 1e-4
    settled_mm = 0.01 * float(rig.a.pixel_size(start.sample(2)).mean())
    for number in range(passes):
        system = _System(basis, control, radius, capped)
        for camera, contour in zip((rig.a, rig.b), contours, strict=True):
            gate = _GATES[number] if number < len(_GATES) else None
            system.add(camera, contour, gate)
        stiffness = system.evidence(stiffness)
        moved, grown = system.step(stiffness, radius_known)
        if not np.isfinite(moved).all() or np.abs(moved).max() > 1e4:
            raise HardFrame("the fit left the device")
        control, radius = control + moved, max(radius + grown, 1e-3)
        settled = number > len(_GATES) and system.across(moved) < settled_mm
        curve = Backbone(basis.knots, control, _DEGREE)
        if number < len(_GATES):
            curve = _without_overshoot(rig, contours, curve, 3 * radius)
        control = basis.control_points(curve)
        if settled:
            break
    return TubeFit(
        Backbone(basis.knots, control, _DEGREE),
        radius,
        system.covariance(stiffness),
        float(np.sqrt(system.variance)),
    )


def curve_covariance(fit: TubeFit, count: int) -> Floats:
    """Covariance (count, 3, 3), mm², at equal steps of arc length of a fitted backbone."""
    s = fit.backbone.arc_lengths(count)
    m = len(fit.backbone.coefficients)
    basis = BSpline(fit.backbone.knots, np.eye(m), _DEGREE)(fit.backbone._parameter(s))
    blocks = fit.covariance.reshape(m, 3, m, 3)
    return np.asarray(np.einsum("ni,iajb,nj->nab", basis, blocks, basis, optimize=True))


class _Basis:
    """The spline's knots, and its basis at equal steps of the parameter."""

    def __init__(self, segments: int) -> None:
        inner = np.linspace(0, 1, segments + 1)
        self.knots = np.concatenate([np.zeros(_DEGREE), inner, np.ones(_DEGREE)])
        self.count = segments + _DEGREE
        spline = BSpline(self.knots, np.eye(self.count), _DEGREE)
        at = np.linspace(0, 1, _SAMPLES)
        self.values, self.slopes = spline(at), spline(at, nu=1)
        # Of the basis, only four in a row are not zero: where they begin, and their values.
        self.first = np.minimum((at * segments).astype(int), segments - 1)
        columns = self.first[:, None] + np.arange(_DEGREE + 1)
        self.near_values = np.take_along_axis(self.values, columns, axis=1)
        self.near_slopes = np.take_along_axis(self.slopes, columns, axis=1)
        third = np.diff(np.eye(self.count), 3, axis=0)
        self.roughness = third.T @ third
        self.from_samples = np.linalg.pinv(self.values)

    def control_points(self, curve: Backbone) -> Floats:
        """Control points, (m, 3), that follow a curve with even speed."""
        return np.asarray(self.from_samples @ curve.sample(_SAMPLES))


class _System:
    """Normal equations of one pass: unknown are the control points' shifts and the radius'."""

    def __init__(
        self, basis: _Basis, control: Floats, radius: float, capped: tuple[bool, bool]
    ) -> None:
        self.basis, self.control, self.radius, self.capped = basis, control, radius, capped
        self.curve = basis.values @ control
        velocity = basis.slopes @ control
        self.speed = np.maximum(np.linalg.norm(velocity, axis=1), 1e-9)
        self.tangents = velocity / self.speed[:, None]
        size = 3 * basis.count + 1
        self.matrix, self.side = np.zeros((size, size)), np.zeros(size)
        self.residuals: list[Floats] = []
        self.alike: list[float] = []

    def add(self, camera: Camera, contour: Contour, gate: float | None) -> None:
        """Add the residuals of one view; `gate`, px, as in `_GATES`."""
        outline = tube_outline(camera, self.curve, self.tangents, self.radius, self.capped)
        if np.any(camera.depth(outline.points) <= 0):
            raise HardFrame("the fit runs behind a camera")
        jacobian = camera.jacobian(outline.points)
        picture = camera.project(outline.points)
        along = np.roll(picture, -1, axis=0) - np.roll(picture, 1, axis=0)
        normals = np.column_stack([along[:, 1], -along[:, 0]])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        # Left or right around: the rims, most of it, tell which side is outside.
        outward = np.einsum("nij,nj->ni", jacobian, outline.normals)
        normals *= np.sign(np.sum(normals * outward))
        _, nearest = map(np.asarray, cKDTree(picture).query(contour.points))
        normal = normals[nearest]
        residual = np.sum((contour.points - picture[nearest]) * normal, axis=1)
        agrees = np.sum(normal * contour.directions, axis=1)
        if gate is None:
            spread = max(0.5, 1.4826 * float(np.median(np.abs(residual))))
            kept = (agrees > 0.5) & (np.abs(residual) < max(2.0, 4 * spread))
            weight = 1 / (1 + (residual[kept] / (2 * spread)) ** 2)
        else:
            kept = (agrees > 0.3) & (np.abs(residual) < gate)
            weight = np.ones(int(kept.sum()))
        if kept.sum() < 3 * self.basis.count:
            raise HardFrame("the fit follows too little of the device's outline")
        nearest, residual, normal = nearest[kept], residual[kept], normal[kept]
        owner, across = outline.owner[nearest], outline.normals[nearest]
        # How a residual falls as the surface point moves in space, px/mm.
        pull = np.einsum("nij,ni->nj", jacobian[nearest], normal)
        # A flat end turns with the curve: n tilts by −(n·δt) t where the tangent tilts by δt.
        tilt = -self.radius * np.sum(pull * self.tangents[owner], axis=1)[:, None] * across
        # Seen nearly edge-on, a disc tilted to either side looks the same: until the curve is
        # near, its rims alone say how it runs.
        turning = 1.0 if gate is None else 0.0
        slopes = turning * self.basis.near_slopes[owner] / self.speed[owner, None]
        rows = np.empty((len(owner), 3 * (_DEGREE + 1) + 1))
        rows[:, :-1] = (
            self.basis.near_values[owner][:, :, None] * pull[:, None, :]
            + slopes[:, :, None] * tilt[:, None, :]
        ).reshape(len(owner), -1)
        rows[:, -1] = np.sum(pull * across, axis=1)
        self._accumulate(rows, owner, residual, weight)
        self.residuals.append(residual)
        self.alike.append(_likeness(residual[np.argsort(nearest, kind="stable")]))

    def _accumulate(self, rows: Floats, owner: Integers, residual: Floats, weight: Floats) -> None:
        """Add to the normal equations, span by span: a row touches four control points."""
        span = self.basis.first[owner]
        order = np.argsort(span, kind="stable")
        rows, span = rows[order], span[order]
        weighted = rows * weight[order, None]
        residual = residual[order]
        edges = np.searchsorted(span, np.arange(span[-1] + 2))
        wide = rows.shape[1] - 1
        for first in np.flatnonzero(np.diff(edges)):
            here = slice(edges[first], edges[first + 1])
            block = weighted[here].T @ rows[here]
            side = weighted[here].T @ residual[here]
            at = slice(3 * first, 3 * first + wide)
            self.matrix[at, at] += block[:-1, :-1]
            self.matrix[at, -1] += block[:-1, -1]
            self.matrix[-1, at] += block[-1, :-1]
            self.matrix[-1, -1] += block[-1, -1]
            self.side[at] += side[:-1]
            self.side[-1] += side[-1]

    @property
    def variance(self) -> float:
        """Mean square of the residuals, px²."""
        return float(np.mean(np.concatenate(self.residuals) ** 2))

    @property
    def _noise(self) -> float:
        """Variance that the residuals would have if each were on its own, px²."""
        return self.variance * float(np.mean(self.alike))

    def evidence(self, stiffness: float) -> float:
        """Next estimate of the stiffness: how rough the curve is against how noisy its picture.

        D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4(3), 1992: the roughness
        is shared among as many directions as it, and not the data, determines.
        """
        roughness = np.einsum("ia,ij,ja->", self.control, self.basis.roughness, self.control)
        covariance = np.linalg.inv(self._held(stiffness))[:-1, :-1]
        blocks = np.einsum("iaja->ij", covariance.reshape(self.basis.count, 3, -1, 3))
        undetermined = stiffness * float(np.sum(blocks * self.basis.roughness))
        directions = max(3.0 * (self.basis.count - 3) - undetermined, 1.0)
        return float(np.clip(self._noise * directions / max(roughness, 1e-12), 1e-9, 1e6))

    def step(self, stiffness: float, radius_known: bool) -> tuple[Floats, float]:
        """Shift of the control points (m, 3) and of the radius, mm."""
        held, side = self._held(stiffness), self.side.copy()
        side[:-1] -= stiffness * (self.basis.roughness @ self.control).ravel()
        slide = (self.basis.values[:, :, None] * self.tangents[:, None, :]).reshape(_SAMPLES, -1)
        sliding = slide.T @ slide
        share = _SLIDING * np.trace(self.matrix[:-1, :-1]) / np.trace(sliding)
        held[:-1, :-1] += share * sliding
        if radius_known:
            held[-1, -1] += 1e12
        moved = np.linalg.solve(held, side)
        return np.asarray(moved[:-1].reshape(-1, 3)), float(moved[-1])

    def across(self, moved: Floats) -> float:
        """Largest shift of the curve across itself, mm."""
        shift = self.basis.values @ moved
        shift -= np.sum(shift * self.tangents, axis=1, keepdims=True) * self.tangents
        return float(np.linalg.norm(shift, axis=1).max())

    def covariance(self, stiffness: float) -> Floats:
        """Covariance of the control points, (3m, 3m), mm²."""
        covariance = np.linalg.inv(self._held(stiffness))[:-1, :-1]
        return np.asarray(self._noise * (covariance + covariance.T) / 2)

    def _held(self, stiffness: float) -> Floats:
        """The normal matrix with the spline's stiffness."""
        held = self.matrix + 1e-9 * np.eye(len(self.matrix))
        for axis in range(3):
            held[axis:-1:3, axis:-1:3] += stiffness * self.basis.roughness
        return held


def _without_overshoot(
    rig: StereoRig, contours: tuple[Contour, Contour], curve: Backbone, most_mm: float
) -> Backbone:
    """Cut a curve off where it leaves a view's mask by more than `most_mm`, and stays out.

    Where there is no contour, nothing would pull it back.
    """
    s = curve.arc_lengths(_SAMPLES)
    points = curve(s)
    inside = np.ones(len(s), dtype=bool)
    for camera, contour in zip((rig.a, rig.b), contours, strict=True):
        pixels = camera.project(points)
        distance, nearest = map(np.asarray, cKDTree(contour.points).query(pixels))
        offset = pixels - contour.points[nearest]
        outside = np.sum(offset * contour.directions[nearest], axis=1) > 0
        inside &= ~outside | (distance * camera.pixel_size(points) < most_mm)
    shown = s[inside]
    if len(shown) < _SAMPLES // 10:
        raise HardFrame("the fit left the device")
    if shown[0] == s[0] and shown[-1] == s[-1]:
        return curve
    return curve.between(float(shown[0]), float(shown[-1]))


def _likeness(residual: Floats) -> float:
    """How much more the mean of near residuals varies than if they were independent."""
    rows = len(residual) // _IN_A_ROW
    if rows < 4:
        return 1.0
    means = residual[: rows * _IN_A_ROW].reshape(rows, -1).mean(axis=1)
    spread = float(np.mean(residual**2))
    return max(1.0, float(np.mean(means**2)) * _IN_A_ROW / max(spread, 1e-12))
