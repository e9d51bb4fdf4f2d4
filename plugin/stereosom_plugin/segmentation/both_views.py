"""What two views of one device must have in common."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera, StereoRig, triangulate

from .tube import Tube
from .xray import Candidate

# So many lines of each view are compared.
MOST = 8
# Epipolar mismatch of the ends that halves the trust in a pair, as a share of the device's extent:
# geometry from a header is off by degrees and millimeters.
MISMATCH = 0.12
# Quotient of the absorptions that does so; a device absorbs more where it is seen lengthwise.
QUOTIENT = 1.6


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
    and the picture. That angle follows from both views: the planes through either source and
    the line that the end follows in its picture meet in the device's direction.

    Returns
    -------
    pair of (begin, end)
        Of view a, of view b; zero for ends at the border, and where the views do not agree
        about an end.
    """
    caps = ([0.0, 0.0], [0.0, 0.0])
    for end_a in (0, 1):
        for end_b in (0, 1):
            if tube_a.enters[end_a] or tube_b.enters[end_b]:
                continue
            place = [_end(tube_a, end_a), _end(tube_b, end_b)]
            if not _same_point(rig, place[0][0], place[1][0]):
                continue
            direction = np.cross(_plane_normal(rig.a, *place[0]), _plane_normal(rig.b, *place[1]))
            length = float(np.linalg.norm(direction))
            # Nearly one plane: the device's end follows an epipolar line, its depth is open.
            if length < 0.1:
                continue
            direction /= length
            point = triangulate(rig, place[0][0][None], place[1][0][None])[0]
            for camera, cap, end, tube in (
                (rig.a, caps[0], end_a, tube_a),
                (rig.b, caps[1], end_b, tube_b),
            ):
                ray = point - camera.center
                ray /= np.linalg.norm(ray)
                cap[end] = float(tube.radius[-end]) * abs(float(ray @ direction))
    return (caps[0][0], caps[0][1]), (caps[1][0], caps[1][1])


def _end(tube: Tube, end: int) -> tuple[Floats, Floats]:
    """Place (2,), px, and direction (2,) of the first or the last end."""
    line = tube.line if end == 1 else tube.line[::-1]
    back = min(len(line), max(6, round(2.5 * float(np.median(tube.radius)))))
    part = line[-back:]
    # Of the parabola through the last steps, the slope at the end.
    step = np.arange(1 - back, 1)
    fit = np.polyfit(step, part, 2 if back > 8 else 1)
    direction = fit[-2]
    return part[-1], direction / np.linalg.norm(direction)


def _same_point(rig: StereoRig, one: Floats, two: Floats) -> bool:
    """Whether two points may show one point in space, header errors allowed for."""
    angle_a = float(rig.epipolar_angle(rig.a, one[None])[0])
    # How far the angle turns over ten pixels in view b.
    shifted = two + 10 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    angles = np.asarray(rig.epipolar_angle(rig.b, shifted))
    per_pixel = float(np.hypot(*(angles[1:] - angles[0]))) / 10
    return abs(angle_a - float(angles[0])) < 0.03 * max(rig.b.image_size) * per_pixel


def _plane_normal(camera: Camera, place: Floats, direction: Floats) -> Floats:
    """Unit normal (3,) of the plane through the source and a line of the picture."""
    line = np.cross(np.append(place, 1.0), np.append(place + direction, 1.0))
    normal = camera.projection[:, :3].T @ line
    return np.asarray(normal / np.linalg.norm(normal))
