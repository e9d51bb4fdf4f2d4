"""What two views of one device must have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stereosom.backbone import Backbone
from stereosom.camera import StereoRig
from stereosom.matching import space_curve

from .tube import Tube
from .xray import Candidate

# So many lines of each view are compared.
MOST = 8
# Epipolar mismatch of the ends that halves the trust in a pair, as a share of the device's extent:
# geometry from a header is off by degrees and millimeters.
MISMATCH = 0.12
# Quotient of the absorptions that does so; a device absorbs more where it is seen lengthwise.
QUOTIENT = 1.6
# Every which step of the middle lines is matched, and pieces of the spline through them: few, so
# that it is stiff at its ends.
THINNING, SEGMENTS = 3, 6


def agreeing(
    rig: StereoRig, seen_a: Sequence[Candidate], seen_b: Sequence[Candidate]
) -> tuple[Candidate, Candidate] | None:
    """The pair of lines, one of each view, that is most likely the same device.

    Parameters
    ----------
    rig : StereoRig
    seen_a, seen_b : sequence of Candidate
        The likeliest first.

    Returns
    -------
    pair of Candidate, or None
        None where a view has no line.
    """
    best, pair = 0.0, None
    for one in seen_a[:MOST]:
        for two in seen_b[:MOST]:
            trust = np.sqrt(one.likely * two.likely) * agreement(rig, one, two)
            if trust > best:
                best, pair = trust, (one, two)
    return pair


def agreement(rig: StereoRig, one: Candidate, two: Candidate) -> float:
    """How well two lines can be one device, 0 to 1.

    Each point of one has its partner on an epipolar line in the other view: a free end that
    both views see lies on one epipolar plane, and so does the extent between the ends.
    """
    angle_a = np.asarray(rig.epipolar_angle(rig.a, one.points[::4]))
    angle_b = np.asarray(rig.epipolar_angle(rig.b, two.points[::4]))
    extent = max(float(np.ptp(angle_a)), float(np.ptp(angle_b)), 1e-9)
    if one.enters.count(True) == two.enters.count(True) == 1:
        tips = [
            float(rig.epipolar_angle(camera, line.points[[-1 if line.enters[0] else 0]])[0])
            for camera, line in ((rig.a, one), (rig.b, two))
        ]
        apart = abs(tips[0] - tips[1])
    else:
        low = abs(float(angle_a.min() - angle_b.min()))
        high = abs(float(angle_a.max() - angle_b.max()))
        apart = min(low, high) if any(one.enters + two.enters) else max(low, high)
    common = min(angle_a.max(), angle_b.max()) - max(angle_a.min(), angle_b.min())
    if common <= 0.2 * min(np.ptp(angle_a), np.ptp(angle_b)):
        return 0.0
    quotient = np.log(one.absorption / two.absorption) / np.log(QUOTIENT)
    return float(np.exp2(-((apart / extent / MISMATCH) ** 2) - quotient**2))


def end_caps(
    rig: StereoRig, tube_a: Tube, tube_b: Tube
) -> tuple[tuple[float, float], tuple[float, float]]:
    """How far the round of the flat end faces reaches beyond each end, px, in either view.

    Half of the absorption marks where the axis of a tube ends. Its silhouette reaches farther
    where the end is seen obliquely: by the radius times the sine of the angle between the end
    and the picture. The two middle lines, matched along their epipolar lines, tell that angle.

    Returns
    -------
    pair of (begin, end)
        Of view a, of view b; zero for ends at the border, and where the views do not agree
        about an end.
    """
    reach = ([0.0, 0.0], [0.0, 0.0])
    places = tube_a.line[::THINNING], tube_b.line[::THINNING]
    try:
        points, _ = space_curve(rig, *places)
        curve = Backbone.fit_spline(points, SEGMENTS)
    except ValueError:  # the lines do not match, or make no curve
        return (0.0, 0.0), (0.0, 0.0)
    ends = np.stack([curve.base, curve.tip])
    # A spline leaves its ends along its outermost coefficients.
    tangents = np.stack([curve.coefficients[side] for side in (1, -1)])
    tangents -= np.stack([curve.coefficients[side] for side in (0, -2)])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    for camera, tube, found in ((rig.a, tube_a, reach[0]), (rig.b, tube_b, reach[1])):
        seen, outermost = camera.project(ends), tube.line[[0, -1]]
        # The curve may run either way along the line.
        straight = np.linalg.norm(seen - outermost, axis=1)
        crossed = np.linalg.norm(seen - outermost[::-1], axis=1)
        order = (0, 1) if straight.sum() <= crossed.sum() else (1, 0)
        for side, end in enumerate(order):
            away = float(np.linalg.norm(seen[end] - outermost[side]))
            radius = float(tube.radius[-side])
            if tube.enters[side] or away > 3 * radius + 4:
                continue
            ray = ends[end] - camera.center
            ray /= np.linalg.norm(ray)
            found[side] = radius * abs(float(ray @ tangents[end]))
    return (reach[0][0], reach[0][1]), (reach[1][0], reach[1][1])
