"""How well a curve agrees with what both views saw, and how sure it is: for every method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.spatial import cKDTree

from .arrays import Floats
from .backbone import Backbone
from .camera import Camera
from .observation import Observation
from .reconstruction import HardFrame, Reconstruction

_SAMPLES = 200
# A curve is refused that lies this far from the device in a view, as a share of its length
# there, or leaves this share of the device's pixels aside: such a curve is another one.
_FARTHEST = 0.03
MOST_STRAY = 0.25
# Nor may so much of the curve, as a share, have no pixels at all: what is seen is then not one
# device but several things.
MOST_UNSEEN = 0.4
# Below this nobody can tell a mask's edge, however well a curve happens to fit.
_LEAST_RESIDUAL_PX = 0.1


def assess(
    backbone: Backbone,
    observation: Observation,
    *,
    end_deviation: float = 0.0,
    covariance: Floats | None = None,
    method: str,
    reason: str = "",
    radius: float | None = None,
) -> Reconstruction:
    """Turn a curve into a result: residuals, covariance along it, and the radius.

    Parameters
    ----------
    backbone : Backbone
    observation : Observation
        What the curve was made of.
    end_deviation : float
        Standard deviation of both ends along the curve, mm.
    covariance : (n, 3, 3) array, optional
        Where the method knows it, mm². Default: `curve_covariance` of the residuals.
    method, reason : str
        As in `Reconstruction`.
    radius : float, optional
        Of the device, mm. Where not known it is read off filled masks.

    Raises
    ------
    HardFrame
        Where the curve does not follow the device in a view.
    """
    points = backbone.sample(_SAMPLES)
    views = {
        view: _agreement(view, points, camera, pixels)
        for view, camera, pixels in (
            ("a", observation.rig.a, observation.pixels_a),
            ("b", observation.rig.b, observation.pixels_b),
        )
    }
    if radius is None and observation.kind == "filled":
        radius = float(np.mean([agreement.half_width_mm for agreement in views.values()]))
    residuals = (views["a"].residual, views["b"].residual)
    if covariance is None:
        covariance = curve_covariance(backbone, observation, residuals, end_deviation)
    return Reconstruction(
        index=observation.index,
        time=observation.time,
        status="ok",
        reason=reason,
        method=method,
        backbone=backbone,
        covariance=covariance,
        residuals=residuals,
        radius=radius,
    )


@dataclass(frozen=True)
class _Agreement:
    residual: float  # RMS over the curve, px
    half_width_mm: float  # of a filled mask


def _agreement(view: str, points: Floats, camera: Camera, pixels: Floats) -> _Agreement:
    """Compare the projected curve, given by equal steps of arc length, with a view's pixels.

    The residual at a sample of the curve is the mean offset, across the projected curve, of
    the pixels nearest to it: zero where the curve runs in the middle of the device.
    """
    if np.any(camera.depth(points) <= 0):
        raise HardFrame(f"view {view}: the curve runs behind the camera")
    curve = camera.project(points)
    length = float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())
    if length < 1:
        raise HardFrame(f"view {view}: the curve that was found shows as a single point")
    distance, nearest = map(np.asarray, cKDTree(curve).query(pixels))
    direction = np.gradient(curve, axis=0)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
    normal = np.column_stack([-direction[:, 1], direction[:, 0]])
    offset = np.sum((pixels - curve[nearest]) * normal[nearest], axis=1)
    # Pixels beyond an end belong to no place along the curve, and dirt far from it to none at all.
    inside = (nearest > 0) & (nearest < _SAMPLES - 1)
    if not inside.any():
        raise HardFrame(f"view {view}: the curve that was found lies beside the device")
    near = max(5.0, 4 * float(np.median(distance[inside])))
    inside &= distance <= near
    count = np.bincount(nearest[inside], minlength=_SAMPLES)
    total = np.bincount(nearest[inside], offset[inside], minlength=_SAMPLES)
    seen = count > 0
    residual = float(np.sqrt(np.mean((total[seen] / count[seen]) ** 2)))
    # Samples may lie closer than pixels do: one is seen where a pixel lies within two.
    reach = int(np.ceil(2 * _SAMPLES / length))
    unseen = 1 - float(np.mean(maximum_filter1d(seen, 2 * reach + 1)))
    if unseen > MOST_UNSEEN:
        raise HardFrame(
            f"view {view}: the pixels fall into separate pieces ({unseen:.0%} of the curve that "
            "joins them is not seen)"
        )
    if residual > max(3.0, _FARTHEST * length):
        raise HardFrame(
            f"view {view}: no curve was found that follows the device "
            f"(it lies {residual:.0f} px beside it)"
        )
    stray = float(np.mean(distance > near))
    if stray > MOST_STRAY:
        raise HardFrame(
            f"view {view}: {stray:.0%} of the pixels belong to no part of the curve that was found"
        )
    half_width = len(pixels) / length / 2
    return _Agreement(residual, half_width * float(camera.pixel_size(points).mean()))


def curve_covariance(
    backbone: Backbone,
    observation: Observation,
    residuals: tuple[float, float],
    end_deviation: float,
) -> Floats:
    """Covariance along the curve, (n, 3, 3), mm².

    Each view measures where the curve lies across its picture of it, to within the residual
    σ: with the pixel Jacobian J and the normal n of the projected curve, its information is
    (Jᵀn)(Jᵀn)ᵀ/σ². The sum over both views, inverted in the plane across the curve, is the
    covariance there. Where the curve runs along an epipolar plane both views measure the same
    direction, and the other one stays open: its variance grows without bound.
    Along the curve stands `end_deviation`², which the views' offsets do not show.
    """
    s = backbone.arc_lengths(_SAMPLES)
    points, tangents = backbone(s), backbone.tangent(s)
    information = np.zeros((_SAMPLES, 3, 3))
    for camera, residual in zip((observation.rig.a, observation.rig.b), residuals, strict=True):
        jacobian = camera.jacobian(points)
        along = np.einsum("nij,nj->ni", jacobian, tangents)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        normal = np.column_stack([-along[:, 1], along[:, 0]])
        measured = np.einsum("nij,ni->nj", jacobian, normal)
        weight = 1 / max(residual, _LEAST_RESIDUAL_PX) ** 2
        information += weight * measured[:, :, None] * measured[:, None, :]
    along_tangent = tangents[:, :, None] * tangents[:, None, :]
    # No point is surer than its view and none farther off than the curve is long.
    floor = np.eye(3) / backbone.length**2
    across = np.linalg.inv(information + floor + along_tangent)
    project = np.eye(3) - along_tangent
    covariance = project @ across @ project + end_deviation**2 * along_tangent
    return np.asarray((covariance + covariance.transpose(0, 2, 1)) / 2)
