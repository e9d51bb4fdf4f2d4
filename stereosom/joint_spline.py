"""The method `joint-spline`: one tube, fitted to what both views saw of it."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from .arrays import Floats
from .assessment import MOST_STRAY, MOST_UNSEEN
from .backbone import Backbone
from .camera import Camera
from .ends import trim_to_shared_stretch
from .entering import eyes_alike, trim_along
from .observation import Observation, View
from .options import Options, check_whole
from .polygons import inside_by
from .reconstruction import HardFrame, Reconstruction
from .refine.fit import TubeFit
from .refine.kernels import kernels
from .refine.search import TubeSearch, what_was_tried
from .refine.start import swept_curve

METHOD = "joint-spline"

_COVARIANCES = 100
# The picture of a flat end does not change in proportion to its tilt, as a covariance takes it
# to: its deviation grows by this factor, which is measured (`stereosom experiment coverage`).
_END_FACTOR = 1.5
# So many pixels, evenly drawn, tell how much lies beside the device.
_DRAWN = 600
_LITTLE_STRAY = 0.1


@dataclass(frozen=True, eq=False)
class JointSplineOptions(Options):
    """Options of the joint spline.

    Parameters
    ----------
    segments : int, optional
        Pieces of the cubic spline. How stiff it is follows from the data, so more than are
        needed do no harm. Default: 20, and up to 60 for a long thin device.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    segments: int | None = None

    def __post_init__(self) -> None:
        if self.segments is not None:
            check_whole(self.segments, "segments", 4, 200)


def joint_spline(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct the backbone of a round, flat-ended device from filled masks.

    The middle lines of both masks, matched along their epipolar lines, give a first curve; one
    spline and one radius are then fitted to the outlines in both views at once
    (`stereosom.refine`), which also says how sure each point is.

    Parameters
    ----------
    observation : Observation
        Of kind `filled`.
    options : JointSplineOptions, optional

    Raises
    ------
    HardFrame
        Where the pixels of this observation do not allow it.

    Examples
    --------
    A quarter circle of radius 60 mm is 94.25 mm long; its rounded ends are not in the model:

    >>> from stereosom.synthetic import arc, converging_rig, observe
    >>> result = joint_spline(observe(arc(60, 90), radius=1.0, rig=converging_rig(60)))
    >>> 94 < result.backbone.length < 97
    True
    """
    if not isinstance(options, JointSplineOptions):
        options = options or Options()
        options = JointSplineOptions(options.prior, options.start, options.tried)
    if observation.kind != "filled":
        raise HardFrame("joint-spline needs filled masks: fill the outlines, or use stereo-som")
    for view, pixels in (("a", observation.pixels_a), ("b", observation.pixels_b)):
        if len(pixels) == 0:
            raise HardFrame(f"view {view}: no device in the picture")
        if len(pixels) < 20:
            raise HardFrame(f"view {view}: {len(pixels)} device pixels are too few to see a shape")
    first, seen = None, observation
    if eyes_alike(observation.rig):
        with suppress(HardFrame):
            first = options.start.polyline(200) if options.start else swept_curve(observation)
            seen = trim_along(observation, first)
    else:
        seen = trim_to_shared_stretch(observation)
    search = TubeSearch.of(seen, options.prior.radius, options.segments)
    if options.start:
        fit, tried = search.near(options.start, options.tried)
    else:
        fit = search.anywhere(first)
        tried = what_was_tried(fit)
    residuals = _check(seen, fit)
    opened = (not fit.tube.capped[0], not fit.tube.capped[1])
    backbone, shares = _shown_stretch(seen, fit, opened)
    pixel = float(seen.rig.a.pixel_size(backbone.coefficients[:1])[0]) if any(opened) else 0.0
    covariance = _covariance(fit, opened, shares, pixel)
    turned, because = _base_last(backbone, opened, seen, options)
    if turned:
        backbone, covariance = backbone.reversed(), covariance[::-1]
        tried = tried and tried.reversed()
    return Reconstruction(
        index=observation.index,
        time=observation.time,
        status="ok",
        reason=because,
        method=METHOD,
        backbone=backbone,
        covariance=covariance,
        residuals=residuals,
        radius=fit.radius,
        tried=tried,
    )


def _check(seen: Observation, fit: TubeFit) -> tuple[float, float]:
    """RMS offset of the middle of the device from the curve in either view, px.

    Raises
    ------
    HardFrame
        Where the tube is not what the masks show: mostly unseen, or with much beside it.
    """
    residuals = []
    views: tuple[tuple[View, Camera, Floats], ...] = (
        ("a", seen.rig.a, seen.pixels_a),
        ("b", seen.rig.b, seen.pixels_b),
    )
    for (view, camera, pixels), look in zip(views, fit.looks, strict=True):
        left, right = look.rims_seen
        unseen = 1 - np.count_nonzero(left | right) / look.samples
        if unseen > MOST_UNSEEN:
            raise HardFrame(
                f"view {view}: the pixels fall into separate pieces ({unseen:.0%} of the curve "
                "that joins them is not seen)"
            )
        stray = look.stray
        if stray > _LITTLE_STRAY:  # of the edges; specks have more of them than pixels
            drawn = pixels[:: len(pixels) // _DRAWN + 1]
            distance, _ = cKDTree(camera.project(fit.tube.curve)).query(drawn)
            stray = float(np.mean(distance > 1.5 * look.half_width + 5))
        if stray > MOST_STRAY:
            raise HardFrame(
                f"view {view}: {stray:.0%} of the pixels belong to no part of the curve that was "
                "found"
            )
        residuals.append(look.middle_offset)
    return residuals[0], residuals[1]


def _shown_stretch(
    seen: Observation, fit: TubeFit, opened: tuple[bool, bool]
) -> tuple[Backbone, tuple[float, float]]:
    """The curve up to the border of the views at open ends, and where that is, as shares of it."""
    backbone = fit.backbone
    if not (opened[0] or opened[1]):
        return backbone, (0.0, 1.0)
    assert seen.field_of_view is not None
    curve, cameras = fit.tube.curve, (seen.rig.a, seen.rig.b)
    inside = np.minimum(
        *(
            inside_by(corners, camera.project(curve))
            for camera, corners in zip(cameras, seen.field_of_view, strict=True)
        )
    )
    shown = np.flatnonzero(inside >= 0)
    if len(shown) < 2:
        return backbone, (0.0, 1.0)
    reach = kernels().reach_along(curve)
    reach *= backbone.length / reach[-1]
    ends = [0.0, backbone.length]
    for end, outward in ((0, -1), (-1, 1)):
        here, beyond = shown[end], shown[end] + outward
        if opened[end] and 0 <= beyond < len(curve):
            share = inside[here] / (inside[here] - inside[beyond])
            ends[end] = float(reach[here] + share * (reach[beyond] - reach[here]))
    start, stop = ends
    shares = start / backbone.length, stop / backbone.length
    return backbone.between(start, stop), shares


def _covariance(
    fit: TubeFit, opened: tuple[bool, bool], shares: tuple[float, float], pixel: float
) -> Floats:
    """Covariance at equal steps of the stretch of a curve that is shown, mm².

    Sliding along the curve changes nothing but the names of its points: along it, the
    covariance is that of the ends, and between them so. An open end lies at the border of the
    view, to a pixel.
    """
    factors = np.where(opened, 1.0, _END_FACTOR**2)
    along = np.where(opened, pixel**2, np.nan)
    found: Floats = kernels().by_length(
        fit.tube.curve, fit.tube.tangents, fit.covariance, factors, along, *shares, _COVARIANCES
    )
    return found


def _base_last(
    backbone: Backbone, opened: tuple[bool, bool], seen: Observation, options: Options
) -> tuple[bool, str]:
    """Whether the curve runs from tip to base, and why that is thought."""
    base, tip = backbone.base, backbone.tip
    known = options.prior.base if options.start is None else options.start.base
    if known is not None:
        because = "" if options.start else "the base is the end nearest to the given one"
        return math.dist(tip, known) < math.dist(base, known), because
    if opened[0] != opened[1]:
        return opened[1], "the base is the end at the picture's border"
    ends = np.stack([base, tip])
    low = seen.rig.a.project(ends)[:, 1] + seen.rig.b.project(ends)[:, 1]
    return bool(low[1] > low[0]), (
        "nothing tells the base from the tip: the end lower in the pictures was taken"
    )
