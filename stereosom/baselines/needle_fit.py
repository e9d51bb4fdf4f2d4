"""A curve fitted to the needle in each picture, and both triangulated.

After R. J. Webster III et al., who so measured a bent steerable needle in transparent phantom
tissue; references 24 and 25 of J. M. Croom et al., "Visual sensing of continuum robot shape
using self-organizing maps", IEEE ICRA 2010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from ..arrays import Floats
from ..assessment import assess
from ..backbone import Backbone
from ..camera import StereoRig
from ..observation import Observation
from ..options import Options, check_whole
from ..reconstruction import HardFrame, Reconstruction
from .ordering import begin, triangulated

METHOD = "needle-fit"

_SAMPLES = 200
# What lies farther from its polynomial than this share of its length, RMS, is no needle.
_MOST_BESIDE = 0.01
# A needle that extends over less across its epipolar lines than this, px, shows no depth.
_LEAST_ACROSS_PX = 10.0


@dataclass(frozen=True, eq=False)
class NeedleFitOptions(Options):
    """Options of the needle fit.

    Parameters
    ----------
    degree : int
        Of the polynomial in each picture, and of the curve in space.

    Raises
    ------
    ValueError
        Where the degree is out of range.
    """

    degree: int = 4

    def __post_init__(self) -> None:
        check_whole(self.degree, "degree", 1, 10)


def needle_fit(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct a gently bent device from one polynomial in each picture.

    In each view the device is a function over its own principal direction, so a needle may
    bend but not turn back. Points of the curve in view a and the epipolar partners on the
    curve in view b are triangulated.

    Parameters
    ----------
    observation : Observation
    options : NeedleFitOptions, optional

    Raises
    ------
    HardFrame
        Where the device is no such function, lies along the epipolar lines, or shows too
        little.

    Examples
    --------
    An eighth of a circle of radius 80 mm is 63 mm long:

    >>> from stereosom.synthetic import arc, converging_rig, observe
    >>> result = needle_fit(observe(arc(80, 45), radius=0.5, rig=converging_rig(60)))
    >>> 61 < result.backbone.length < 65
    True
    """
    if not isinstance(options, NeedleFitOptions):
        shared = options or Options()
        options = NeedleFitOptions(prior=shared.prior, start=shared.start)
    seen, ends = begin(observation, options)
    curve_a = fit_in_picture("a", seen.pixels_a, options.degree)
    curve_b = fit_in_picture("b", seen.pixels_b, options.degree)
    points, _ = triangulated(seen.rig, *epipolar_partners(seen.rig, curve_a, curve_b))
    if len(points) < _SAMPLES // 2:
        raise HardFrame("less than half of the needle has a partner in the other view")
    first, last = np.linalg.norm(points[[0, -1]] - ends.base, axis=1)
    curve = Backbone.fit_polynomial(points if first <= last else points[::-1], options.degree)
    return assess(
        curve,
        seen,
        end_deviation=curve.length / _SAMPLES,
        method=METHOD,
        reason=ends.because,
        radius=options.prior.radius,
    )


def fit_in_picture(view: str, pixels: Floats, degree: int) -> Floats:
    """Points of the polynomial over the pixels' principal direction, (200, 2), px.

    Raises
    ------
    HardFrame
        Where the pixels are too few, or no such function over that direction.

    Examples
    --------
    Pixels in a row give the row back:

    >>> row = np.column_stack([np.arange(40.0), np.full(40, 7.0)])
    >>> curve = fit_in_picture("a", row, degree=2)
    >>> sorted(curve[[0, -1], 0].round(6).tolist()), float(np.ptp(curve[:, 1]).round(6))
    ([0.0, 39.0], 0.0)
    """
    middle = pixels.mean(axis=0)
    _, axes = np.linalg.eigh(np.cov(pixels - middle, rowvar=False))
    x, y = axes[:, 1], axes[:, 0]  # the eigenvalues rise: the last axis is the principal one
    along, across = (pixels - middle) @ x, (pixels - middle) @ y
    if len(np.unique(along)) <= degree + 1:
        raise HardFrame(f"view {view}: {len(pixels)} pixels are too few for degree {degree}")
    bend = Polynomial.fit(along, across, degree)
    at = np.linspace(along.min(), along.max(), _SAMPLES)
    place = np.searchsorted(at, along)
    count = np.maximum(np.bincount(place), 1)
    beside = np.bincount(place, across - bend(along)) / count
    rms, length = float(np.sqrt(np.mean(beside**2))), float(np.ptp(along))
    if rms > max(3.0, _MOST_BESIDE * length):
        raise HardFrame(
            f"view {view}: the device bends too far for one polynomial of degree {degree} "
            f"(it lies {rms:.0f} px beside it)"
        )
    return np.asarray(middle + np.outer(at, x) + np.outer(bend(at), y))


def epipolar_partners(rig: StereoRig, curve_a: Floats, curve_b: Floats) -> tuple[Floats, Floats]:
    """Points of curve a that have a partner on curve b, and the partners, (n, 2) each, px.

    A partner lies where curve b crosses the epipolar plane of the point of curve a. Of
    several the one at the nearest share of its curve is taken.

    Parameters
    ----------
    rig : StereoRig
    curve_a, curve_b : (200, 2) array
        Each from one end to the other, px.

    Raises
    ------
    HardFrame
        Where the needle lies along the epipolar lines.
    """
    angle_a, angle_b = rig.epipolar_angle(rig.a, curve_a), rig.epipolar_angle(rig.b, curve_b)
    for view, camera, curve, angle in (
        ("a", rig.a, curve_a, angle_a),
        ("b", rig.b, curve_b, angle_b),
    ):
        line = rig.epipolar_line(camera, float(np.mean(angle)))
        offset = (curve @ line[:2] + line[2]) / np.linalg.norm(line[:2])
        if np.ptp(offset) < _LEAST_ACROSS_PX:
            raise HardFrame(f"view {view}: the needle lies along the epipolar lines")
    straight = abs(angle_a[0] - angle_b[0]) + abs(angle_a[-1] - angle_b[-1])
    crossed = abs(angle_a[0] - angle_b[-1]) + abs(angle_a[-1] - angle_b[0])
    if crossed < straight:
        curve_b, angle_b = curve_b[::-1], angle_b[::-1]
    above = angle_b[None, :] >= angle_a[:, None]
    point, step = np.nonzero(above[:, 1:] != above[:, :-1])
    within = (angle_a[point] - angle_b[step]) / (angle_b[step + 1] - angle_b[step])
    # Per point of curve a the crossing whose place along curve b is most like its own.
    order = np.lexsort([np.abs(step + within - point), point])
    _, first = np.unique(point[order], return_index=True)
    kept = order[first]
    point, step, within = point[kept], step[kept], within[kept, None]
    return curve_a[point], (1 - within) * curve_b[step] + within * curve_b[step + 1]
