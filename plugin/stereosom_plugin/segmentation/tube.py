"""From a chain of pixels to a tube: its middle line, width and ends to a fraction of a pixel.

The picture is straightened along the chain. What the device absorbs is then a profile, the same
(but for noise) at each step: the chord through a round body, blurred by the imaging system. Its
center gives the middle line, its shape the width, its end along the line the tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats

from .loops import loops
from .picture import Gray, Mask, blurred, gaussian, log_across, median

# Steps along and across the straightened picture, px.
ALONG, ACROSS = 1.0, 0.5
# The blur of an X-ray system with pixels of its own resolution, and how sure that is, px.
BLUR, BLUR_SPREAD = 0.8, 0.3
# Of the mean profile, as a share of the light: how well the model holds.
PROFILE_NOISE = 0.02
# A tube ends where it absorbs this share of the light that it does before. A half marks the end
# of a blurred tube seen from the side; more, that of one seen obliquely, which fades out.
END_SHARE = 0.55
# How far beyond the last point of a chain its end is looked for, px.
REACH = 16
PASSES = 7
# A chain may fall short of the device's end by so many steps; beyond, this share is asked for.
MOST_GROWTH, AS_DARK = 14.0, 0.85
# Knots of the chords that make a profile, of half a width.
_OFFSETS = (np.arange(24) + 0.5) / 24


@dataclass(frozen=True, eq=False)
class Tube:
    """A device in one picture.

    `line` (n, 2) is its middle line, px, with steps of about one pixel; `radius` (n,) half its
    width, px; `absorption` the typical one of its axis, natural logarithm; `blur` the standard
    deviation of the imaging system, px; `enters` whether each end lies at the border of the
    field, and is none.
    """

    line: Floats
    radius: Floats
    absorption: float
    blur: float
    enters: tuple[bool, bool]

    @property
    def length(self) -> float:
        """Along the middle line, px."""
        return float(np.linalg.norm(np.diff(self.line, axis=0), axis=1).sum())


def fit_tube(
    picture: Gray,
    points: Floats,
    *,
    enters: tuple[bool, bool],
    greatest_width: float,
    blur: float | None = None,
) -> Tube | None:
    """Fit a tube to the picture along a chain of points.

    Parameters
    ----------
    picture : (rows, columns) array
        In proportion to the light.
    points : (n, 2) array
        Along the device, to a few pixels.
    enters : (bool, bool)
        Which ends lie at the border of the field.
    greatest_width : float
        Of the device, px.
    blur : float, optional
        Of the imaging system, px, where it is known from another frame.

    Returns
    -------
    Tube or None
        None where the picture shows no tube along these points.
    """
    line = _even(points)
    if len(line) < 8:
        return None
    half = greatest_width / 2
    last_size = 0.0
    grown = [0.0, 0.0]
    for attempt in range(PASSES):
        longer = extended(line, REACH, smooth=4.0 if attempt == 0 else 1.5)
        darkness, across = _straightened(picture, longer, half)
        half = _half_width(darkness[REACH:-REACH], across)
        before, behind = (
            _end(way, across, half, enters[side], grown[side])
            for side, way in enumerate((darkness[::-1], darkness))
        )
        size = before + behind - len(longer)
        # A line that was followed has its direction already.
        settled = attempt >= (2 if blur is None else 1) and abs(size - last_size) < 0.1
        last_size = size
        first, last = len(longer) - 1 - before, behind
        if last - first < 8:
            return None
        if settled or attempt == PASSES - 1:
            break
        for side, reached in enumerate((before, behind)):
            grown[side] += reached - (len(longer) - 1 - REACH)
        center = _center(darkness, across, half, first, last)
        line = longer + center[:, None] * normals(longer)
        line = _even(line[max(0, int(first)) : int(np.ceil(last)) + 1])
    begin, end = first, last
    if end - begin < 8:
        return None
    place = np.linspace(begin, end, int(end - begin) + 2)
    steps = np.arange(len(longer))
    middle = np.column_stack([np.interp(place, steps, longer[:, i]) for i in (0, 1)])
    body = slice(int(begin) + 3, max(int(end) - 2, int(begin) + 6))
    fitted = _profile(darkness[body], across, half, blur)
    if fitted is None:
        return None
    radius, absorption, found_blur = fitted
    return Tube(middle, np.interp(place, steps[body], radius), absorption, found_blur, enters)


def draw_line(line: Floats, radius: Floats | float, shape: tuple[int, ...]) -> Mask:
    """Pixels whose centers lie beside a line (n, 2), px, by at most half its width (n,) or one.

    Examples
    --------
    >>> draw_line(np.array([[1.0, 1], [3, 1]]), 0.5, (3, 5)).astype(int)
    array([[0, 0, 0, 0, 0],
           [0, 1, 1, 1, 0],
           [0, 0, 0, 0, 0]])
    """
    mask = np.zeros(shape, dtype=bool)
    loops().draw_line(mask, line, np.broadcast_to(np.asarray(radius, dtype=float), len(line)))
    return mask


def draw(tube: Tube, shape: tuple[int, int]) -> Mask:
    """Pixels whose centers a tube covers.

    Parameters
    ----------
    tube : Tube
    shape : (rows, columns)
    """
    line = tube.line
    if any(tube.enters):  # beyond the border, so that no gap is left there
        line = extended(line, 12)[0 if tube.enters[0] else 12 : None if tube.enters[1] else -12]
    radius = np.interp(
        np.linspace(0, 1, len(line)), np.linspace(0, 1, len(tube.radius)), tube.radius
    )
    return draw_line(line, radius, shape)


def end_face(tube: Tube, end: int, reach: float, shape: tuple[int, ...]) -> Mask:
    """Pixels of the flat face at an end (0 or -1), an ellipse that reaches `reach` px farther."""
    from skimage.draw import polygon

    mask = np.zeros(shape, dtype=bool)
    around = np.linspace(0, 2 * np.pi, 40)
    normal = normals(tube.line)[end]
    along = np.array([normal[1], -normal[0]])
    outline = tube.line[end] + np.outer(np.cos(around), reach * along)
    outline += np.outer(np.sin(around), tube.radius[end] * normal)
    mask[polygon(outline[:, 1], outline[:, 0], shape)] = True
    return mask


def _even(points: Floats) -> Floats:
    """The same line with steps of `ALONG`."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(steps))
    count = max(2, round(along[-1] / ALONG) + 1)
    place = np.linspace(0, along[-1], count)
    return np.column_stack([np.interp(place, along, points[:, i]) for i in (0, 1)])


def extended(line: Floats, by: int, smooth: float = 0.0) -> Floats:
    """A line with `by` more steps at each end, straight on from the last ten."""
    back = min(10, len(line) - 1)
    step = np.arange(1, by + 1)[:, None]
    before = line[0] + step[::-1] * (line[0] - line[back]) / back
    behind = line[-1] + step * (line[-1] - line[-1 - back]) / back
    longer = np.concatenate([before, line, behind])
    return blurred(longer, smooth) if smooth else longer


def normals(line: Floats) -> Floats:
    """Directions of length one (n, 2) across a line, to the right of its way in the picture."""
    across = np.empty_like(line, dtype=float)
    for part, step in (
        (slice(1, -1), line[2:] - line[:-2]),
        (slice(1), line[1:2] - line[:1]),
        (slice(-1, None), line[-1:] - line[-2:-1]),
    ):
        across[part] = step[:, ::-1]
    across[:, 0] *= -1
    return across / np.maximum(np.hypot(across[:, 0], across[:, 1]), 1e-9)[:, None]


def _straightened(picture: Gray, line: Floats, half: float) -> tuple[Floats, Floats]:
    """What is absorbed, (n, m), along a line and across it, and the m places across, px.

    What lies behind is drawn straight from one side of the device to the other.
    """
    near = half + 2.0
    count = int(np.ceil((half + 6.0) / ACROSS))
    far = ACROSS * count
    across = ACROSS * np.arange(-count, count + 1, dtype=float)
    straight = log_across(picture, line, normals(line), across)
    beyond = int(np.floor((far - near) / ACROSS)) + 1
    return np.asarray(loops().absorbed(straight, across, beyond, gaussian(1.5))), across


def _half_width(darkness: Floats, across: Floats) -> float:
    """Half of the width within which more than half of the greatest absorption lies, px."""
    profile = blurred(median(darkness, axis=0), 1.0)
    wide = profile > 0.4 * profile.max()
    return max(0.5 * ACROSS * float(wide.sum()), 1.0)


def _center(darkness: Floats, across: Floats, half: float, first: float, last: float) -> Floats:
    """How far the device's center lies beside the line, (n,), px, smooth along it.

    Beyond the first and the last step of the device it goes straight on.
    """
    near = np.abs(across) <= half + 2
    weight = np.clip(blurred(darkness[:, near], 2.0), 0, None)
    weight = weight**2  # the device, not what lies beside it
    center = weight @ across[near] / np.maximum(weight.sum(axis=1), 1e-6)
    begin, end = int(np.ceil(first)) + 1, max(int(last) - 1, int(first) + 6)
    # Where something bright hides the device, its center lies between those beside the gap.
    strength = weight.sum(axis=1)
    shown = strength >= 0.15 * np.median(strength[begin:end])
    if shown[begin:end].any():
        steps = np.arange(len(center))
        seen = steps[begin:end][shown[begin:end]]
        center = np.interp(steps, seen, center[seen])
    inner = ndimage.median_filter(center[begin:end], 7, mode="nearest")
    # Mirrored through its ends, a line keeps its direction there when it is smoothed.
    count = min(12, len(inner) - 1)
    mirrored = np.concatenate(
        [2 * inner[0] - inner[count:0:-1], inner, 2 * inner[-1] - inner[-2 : -count - 2 : -1]]
    )
    inner = blurred(mirrored, 2.5)[count : len(mirrored) - count]
    steps = np.arange(len(center))
    back = min(6, len(inner) - 1)
    before = inner[0] + (steps[:begin] - begin) * (inner[back] - inner[0]) / back
    behind = inner[-1] + (steps[end:] - end + 1) * (inner[-1] - inner[-1 - back]) / back
    return np.concatenate([before, inner, behind])


def _end(darkness: Floats, across: Floats, half: float, enters: bool, grown: float = 0.0) -> float:
    """Where the tube ends, in steps; the last step where it goes on beyond what is searched.

    What has `grown` beyond the chain by many steps must be as dark as the device: it may be a
    wire that the device's end lies upon.
    """
    last = len(darkness) - 1
    if enters:
        return float(last - REACH)
    core = np.abs(across) <= max(0.6 * half, ACROSS)
    taken = 1 - np.exp(-median(darkness[:, core], axis=1))
    smooth = blurred(taken, 0.8)
    usual = float(median(smooth[None, REACH:-REACH], axis=1)[0])
    present = smooth >= (END_SHARE if grown < MOST_GROWTH else AS_DARK) * usual
    # The outermost step that most of the steps before it agree with: a short fade (something
    # bright behind) is no end, and what is fainter beyond the end does not belong to it.
    agree = ndimage.uniform_filter1d(present.astype(float), 21, origin=10, mode="nearest")
    good = np.flatnonzero(present & (agree >= 0.75))
    if len(good) == 0 or good[-1] == last:
        return float(last)
    outermost = int(good[-1])
    # The end to a fraction of a step: where the share of what is taken there is crossed.
    level = END_SHARE * float(np.median(smooth[max(0, outermost - 12) : outermost - 3]))
    start = max(outermost - 3, 1)
    below = np.flatnonzero(smooth[start:] < level)
    if len(below) == 0:
        return float(outermost)
    first = start + int(below[0])
    high, low = smooth[first - 1], smooth[first]
    return first - 1 + float(np.clip((high - level) / max(high - low, 1e-9), 0, 1))


def _profile(
    darkness: Floats, across: Floats, half: float, blur: float | None
) -> tuple[Floats, float, float] | None:
    """Radius along the device (n,), absorption on the axis, and blur, of what fits best."""
    near = np.abs(across) < half + 3
    place, darkness = across[near], darkness[:, near]
    taken = 1 - np.exp(-median(darkness, axis=0))
    most = float(np.clip(taken.max(), 0.02, 0.98))
    # Radius, absorption, blur, center: the blur is known beforehand, to some degree or wholly.
    found = np.array([max(half, 0.6), -np.log(1 - most), blur or BLUR, 0.0])
    low, high = np.array([0.4, 0.01, 0.3, -2.0]), np.array([3 * half + 2, 6.0, 2.5, 2.0])
    prior = np.zeros(4)
    prior[2] = (PROFILE_NOISE / (BLUR_SPREAD if blur is None else 0.01)) ** 2 * len(place)
    for _ in range(12):
        model, slopes = loops().tube_profile(place, _OFFSETS, found)
        pull = slopes.T @ (taken - model) + prior * ((blur or BLUR) - found)
        step = np.linalg.solve(slopes.T @ slopes + np.diag(prior + 1e-6), pull)
        step = np.clip(step, -0.4 * np.abs(found) - 0.2, 0.4 * np.abs(found) + 0.2)
        found = np.clip(found + step, low, high)
        if np.abs(step).max() < 2e-3:
            break
    if not np.isfinite(found).all():
        return None
    radius, absorption, spread, _ = (float(one) for one in found)
    # The radius changes along the device, by perspective or its own make: by a straight line.
    stretches = min(6, len(darkness) // 30)
    radii = np.full(len(darkness), radius)
    if stretches >= 3:
        rows = np.array_split(np.arange(len(darkness)), stretches)
        parts = 1 - np.exp(-np.stack([median(darkness[row], axis=0) for row in rows]))
        model, slopes = loops().tube_profile(place, _OFFSETS, found)
        change = np.linalg.lstsq(slopes[:, [0, 1, 3]], (parts - model).T, rcond=None)[0][0]
        places = np.array([row.mean() for row in rows])
        steps = np.arange(len(darkness)) - places.mean()
        grown = np.median(change) + _robust_slope(places, change) * steps
        radii = np.clip(radius + grown, 0.7 * radius, 1.4 * radius)
    return radii, absorption, spread


def _robust_slope(x: Floats, y: Floats) -> float:
    """Median of the slopes between all pairs of points (Theil and Sen)."""
    i, j = np.triu_indices(len(x), 1)
    return float(np.median((y[j] - y[i]) / (x[j] - x[i])))


def edge_share(tube: Tube, further_blur: float = 0.0) -> float:
    """Light that a tube takes at its edge, as a share of what it takes at its axis."""
    blur = float(np.hypot(tube.blur, further_blur))
    radius = float(np.median(tube.radius))
    shape = np.array([radius, tube.absorption, blur, 0.0])
    axis, edge = loops().tube_profile(np.array([0.0, radius]), _OFFSETS, shape)[0]
    return float(edge / axis)
