"""The method `joint-spline`: one tube, fitted to what both views saw of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .assessment import assess
from .backbone import Backbone
from .ends import trim_to_shared_stretch
from .matching import space_curve
from .middle_line import middle_line
from .observation import Observation, View
from .options import Options, check_whole
from .reconstruction import HardFrame, Reconstruction
from .refine.contour import Contour, mask_contour
from .refine.fit import TubeFit, fit_tube

METHOD = "joint-spline"

_SAMPLES = 200
# Pixels of a mask this near to the border of the view are cut off there, and show no edge, px.
_CUT_OFF = 2.5


@dataclass(frozen=True, eq=False)
class JointSplineOptions(Options):
    """Options of the joint spline.

    Parameters
    ----------
    segments : int
        Pieces of the cubic spline. How stiff it is follows from the data, so more than are
        needed do no harm.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    segments: int = 24

    def __post_init__(self) -> None:
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
        options = JointSplineOptions(prior=options.prior, start=options.start)
    if observation.kind != "filled":
        raise HardFrame("joint-spline needs filled masks: fill the outlines, or use stereo-som")
    for view, pixels in (("a", observation.pixels_a), ("b", observation.pixels_b)):
        if len(pixels) == 0:
            raise HardFrame(f"view {view}: no device in the picture")
        if len(pixels) < 20:
            raise HardFrame(f"view {view}: {len(pixels)} device pixels are too few to see a shape")
    seen = trim_to_shared_stretch(observation)
    try:
        start, radius = _first_curve(seen)
    except HardFrame:
        if options.start is None:
            raise
        start, radius = options.start, _width_radius(seen, options.start)
    radius = options.prior.radius or radius
    opened = _open_ends(seen, start, radius)
    fit = fit_tube(
        seen.rig,
        (_contour(seen, "a"), _contour(seen, "b")),
        start.sample(_SAMPLES),
        radius,
        capped=(not opened[0], not opened[1]),
        radius_known=options.prior.radius is not None,
        segments=options.segments,
    )
    backbone, covariance = _cut_at_borders(seen, fit, opened)
    turned, because = _base_last(backbone, opened, seen, options)
    if turned:
        backbone, covariance = backbone.reversed(), covariance[::-1]
    return assess(
        backbone,
        seen,
        covariance=covariance,
        method=METHOD,
        reason=because,
        radius=fit.radius,
    )


def _first_curve(seen: Observation) -> tuple[Backbone, float]:
    """A curve along the matched middle lines, and the device's radius, mm."""
    line_a, line_b = middle_line(seen.pixels_a), middle_line(seen.pixels_b)
    points, _ = space_curve(seen.rig, line_a.points, line_b.points)
    radii = [
        line.width / 2 * float(camera.pixel_size(points).mean())
        for line, camera in ((line_a, seen.rig.a), (line_b, seen.rig.b))
    ]
    try:
        return Backbone.fit_spline(points, 20), float(np.mean(radii))
    except (ValueError, np.linalg.LinAlgError) as error:
        raise HardFrame(f"the two views' lines make no curve in space ({error})") from None


def _width_radius(seen: Observation, curve: Backbone) -> float:
    """Radius of a filled device that follows a curve, by the area of its masks, mm."""
    points = curve.sample(_SAMPLES)
    radii = []
    for camera, pixels in ((seen.rig.a, seen.pixels_a), (seen.rig.b, seen.pixels_b)):
        steps = np.linalg.norm(np.diff(camera.project(points), axis=0), axis=1)
        half_width = len(pixels) / max(float(steps.sum()), 1.0) / 2
        radii.append(half_width * float(camera.pixel_size(points).mean()))
    return float(np.mean(radii))


def _contour(seen: Observation, view: View) -> Contour:
    """Contour of a mask, without where the border of the view cuts it off."""
    contour = mask_contour(seen.pixels_a if view == "a" else seen.pixels_b)
    edge = seen.distance_to_border(view, contour.points) > _CUT_OFF
    return contour.where(edge)


def _open_ends(seen: Observation, curve: Backbone, radius: float) -> tuple[bool, bool]:
    """Whether the device goes on at the base and at the tip, beyond the border of a view."""
    ends = np.stack([curve.base, curve.tip])
    opened = np.zeros(2, dtype=bool)
    views: tuple[View, View] = ("a", "b")
    for view in views:
        camera = getattr(seen.rig, view)
        pixels = seen.pixels_a if view == "a" else seen.pixels_b
        at_border = pixels[seen.distance_to_border(view, pixels) <= 1.5]
        # A middle line ends half a width before the device does.
        width = 2 * radius / camera.pixel_size(ends)
        for end, place in enumerate(camera.project(ends)):
            if len(at_border):
                near = float(np.linalg.norm(at_border - place, axis=1).min())
                opened[end] |= near < 1.5 * width[end] + 3
    return bool(opened[0]), bool(opened[1])


def _cut_at_borders(
    seen: Observation, fit: TubeFit, opened: tuple[bool, bool]
) -> tuple[Backbone, Floats]:
    """The curve, up to the border of the views at open ends, and its covariance there."""
    whole = fit.backbone
    covariance = fit.covariance_at(_SAMPLES)
    s = whole.arc_lengths(2000)
    points = whole(s)
    inside = np.ones(len(s), dtype=bool)
    assert seen.field_of_view is not None
    for camera, corners in zip((seen.rig.a, seen.rig.b), seen.field_of_view, strict=True):
        inside &= _inside(corners, camera.project(points))
    start, stop = 0.0, whole.length
    shown = s[inside]
    if len(shown) > 1:
        start = float(shown[0]) if opened[0] else start
        stop = float(shown[-1]) if opened[1] else stop
    backbone = whole.between(start, stop) if (start, stop) != (0.0, whole.length) else whole
    at = np.linspace(start, stop, _SAMPLES) / whole.length * (_SAMPLES - 1)
    low = np.clip(at.astype(int), 0, _SAMPLES - 2)
    share = (at - low)[:, None, None]
    covariance = (1 - share) * covariance[low] + share * covariance[low + 1]
    return backbone, _held_along(backbone, covariance, seen, opened)


def _held_along(
    backbone: Backbone, covariance: Floats, seen: Observation, opened: tuple[bool, bool]
) -> Floats:
    """Covariance across the curve as fitted; along it that of the ends, and between them so.

    Sliding along the curve changes nothing but the names of its points. An open end lies at the
    border of the view, to a pixel.
    """
    tangents = backbone.tangent(backbone.arc_lengths(_SAMPLES))
    along = np.einsum("ni,nij,nj->n", tangents, covariance, tangents)[[0, -1]]
    pixel = float(seen.rig.a.pixel_size(backbone.sample(2)).mean())
    along = np.where(opened, pixel**2, along)
    weight = np.linspace(0, 1, _SAMPLES)
    along_tangent = tangents[:, :, None] * tangents[:, None, :]
    project = np.eye(3) - along_tangent
    held = project @ covariance @ project
    held += ((1 - weight) * along[0] + weight * along[1])[:, None, None] * along_tangent
    held[0] = held[0] if opened[0] else covariance[0]
    held[-1] = held[-1] if opened[1] else covariance[-1]
    return np.asarray((held + held.transpose(0, 2, 1)) / 2)


def _inside(corners: Floats, pixels: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Whether pixels (n, 2) lie in a convex polygon (m, 2)."""
    sides = np.roll(corners, -1, axis=0) - corners
    offset = pixels[:, None] - corners
    turn = sides[:, 0] * offset[:, :, 1] - sides[:, 1] * offset[:, :, 0]
    return np.asarray(np.all(turn >= 0, axis=1) | np.all(turn <= 0, axis=1))


def _base_last(
    backbone: Backbone, opened: tuple[bool, bool], seen: Observation, options: Options
) -> tuple[bool, str]:
    """Whether the curve runs from tip to base, and why that is thought."""
    ends = np.stack([backbone.base, backbone.tip])
    known = options.prior.base if options.start is None else options.start.base
    if known is not None:
        away = np.linalg.norm(ends - known, axis=1)
        because = "" if options.start else "the base is the end nearest to the given one"
        return bool(away[1] < away[0]), because
    if opened[0] != opened[1]:
        return opened[1], "the base is the end at the picture's border"
    low = seen.rig.a.project(ends)[:, 1] + seen.rig.b.project(ends)[:, 1]
    return bool(low[1] > low[0]), (
        "nothing tells the base from the tip: the end lower in the pictures was taken"
    )
