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
from .profile import fit_profile, profile

# Steps along and across the straightened picture, px.
ALONG, ACROSS = 1.0, 0.5
# A tube ends where it absorbs this share of the light that it does before. A half marks the end
# of a blurred tube seen from the side; more, that of one seen obliquely, which fades out.
END_SHARE = 0.55
# How far beyond the last point of a chain its end is looked for, px.
REACH = 16
PASSES = 7
# A chain may fall short of the device's end by so many steps; beyond, this share is asked for.
MOST_GROWTH, AS_DARK = 14.0, 0.85


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
    line = loops().evenly(points, ALONG)
    if len(line) < 8:
        return None
    half = greatest_width / 2
    last_size = 0.0
    grown = [0.0, 0.0]
    for attempt in range(PASSES):
        longer = extended(line, REACH, smooth=4.0 if attempt == 0 else 1.5)
        darkness, across = _straightened(picture, longer, half)
        half = _half_width(darkness[REACH:-REACH], across)
        taken, usual = _light_taken(darkness, across, half)
        before, behind = (
            _end(way, usual, enters[side], grown[side])
            for side, way in enumerate((taken[::-1], taken))
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
        line = longer + center[:, None] * loops().normals(longer)
        line = loops().evenly(line[max(0, int(first)) : int(np.ceil(last)) + 1], ALONG)
    begin, end = first, last
    if end - begin < 8:
        return None
    place = np.linspace(begin, end, int(end - begin) + 2)
    steps = np.arange(len(longer))
    middle = np.column_stack([np.interp(place, steps, longer[:, i]) for i in (0, 1)])
    body = slice(int(begin) + 3, max(int(end) - 2, int(begin) + 6))
    fitted = fit_profile(darkness[body], across, half, blur)
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
    normal = loops().normals(tube.line)[end]
    along = np.array([normal[1], -normal[0]])
    outline = tube.line[end] + np.outer(np.cos(around), reach * along)
    outline += np.outer(np.sin(around), tube.radius[end] * normal)
    mask[polygon(outline[:, 1], outline[:, 0], shape)] = True
    return mask


def extended(line: Floats, by: int, smooth: float = 0.0) -> Floats:
    """A line with `by` more steps at each end, straight on from the last ten."""
    back = min(10, len(line) - 1)
    step = np.arange(1, by + 1)[:, None]
    before = line[0] + step[::-1] * (line[0] - line[back]) / back
    behind = line[-1] + step * (line[-1] - line[-1 - back]) / back
    longer = np.concatenate([before, line, behind])
    return blurred(longer, smooth) if smooth else longer


def _straightened(picture: Gray, line: Floats, half: float) -> tuple[Floats, Floats]:
    """What is absorbed, (n, m), along a line and across it, and the m places across, px.

    What lies behind is drawn straight from one side of the device to the other.
    """
    near = half + 2.0
    count = int(np.ceil((half + 6.0) / ACROSS))
    far = ACROSS * count
    across = ACROSS * np.arange(-count, count + 1, dtype=float)
    straight = log_across(picture, line, loops().normals(line), across)
    beyond = int(np.floor((far - near) / ACROSS)) + 1
    return np.asarray(loops().absorbed(straight, across, beyond, gaussian(1.5))), across


def _within(across: Floats, distance: float) -> slice:
    """The places across that are no farther from the middle, px."""
    first = int(np.searchsorted(across, -distance))
    return slice(first, len(across) - first)


def _half_width(darkness: Floats, across: Floats) -> float:
    """Half of the width within which more than half of the greatest absorption lies, px."""
    profile = blurred(median(darkness, axis=0), 1.0)
    wide = profile > 0.4 * profile.max()
    return max(0.5 * ACROSS * float(np.count_nonzero(wide)), 1.0)


def _center(darkness: Floats, across: Floats, half: float, first: float, last: float) -> Floats:
    """How far the device's center lies beside the line, (n,), px, smooth along it.

    Beyond the first and the last step of the device it goes straight on.
    """
    near = _within(across, half + 2)
    weight = np.maximum(blurred(darkness[:, near], 2.0), 0)
    weight *= weight  # the device, not what lies beside it
    strength = weight @ np.ones(weight.shape[1])
    center = weight @ across[near] / np.maximum(strength, 1e-6)
    begin, end = int(np.ceil(first)) + 1, max(int(last) - 1, int(first) + 6)
    steps = np.arange(len(center))
    # Where something bright hides the device, its center lies between those beside the gap.
    shown = strength >= 0.15 * median(strength[None, begin:end], axis=1)
    if not shown.all() and shown[begin:end].any():
        seen = steps[begin:end][shown[begin:end]]
        center = np.interp(steps, seen, center[seen])
    around = center[np.clip(np.arange(begin - 3, end + 3), begin, end - 1)]
    inner = median(np.lib.stride_tricks.sliding_window_view(around, 7), axis=1)
    # Mirrored through its ends, a line keeps its direction there when it is smoothed.
    count = min(12, len(inner) - 1)
    mirrored = np.concatenate(
        [2 * inner[0] - inner[count:0:-1], inner, 2 * inner[-1] - inner[-2 : -count - 2 : -1]]
    )
    inner = blurred(mirrored, 2.5)[count : len(mirrored) - count]
    back = min(6, len(inner) - 1)
    before = inner[0] + (steps[:begin] - begin) * (inner[back] - inner[0]) / back
    behind = inner[-1] + (steps[end:] - end + 1) * (inner[-1] - inner[-1 - back]) / back
    return np.concatenate([before, inner, behind])


def _light_taken(darkness: Floats, across: Floats, half: float) -> tuple[Floats, float]:
    """Share of the light, (n,), that is taken along the axis, and the usual one."""
    core = _within(across, max(0.6 * half, ACROSS))
    taken = blurred(1 - np.exp(-median(darkness[:, core], axis=1)), 0.8)
    return taken, float(median(taken[None, REACH:-REACH], axis=1)[0])


def _end(taken: Floats, usual: float, enters: bool, grown: float) -> float:
    """Where the tube ends, in steps; the last step where it goes on beyond what is searched.

    What has `grown` beyond the chain by many steps must be as dark as the device: it may be a
    wire that the device's end lies upon.
    """
    last = len(taken) - 1
    if enters:
        return float(last - REACH)
    present = taken >= (END_SHARE if grown < MOST_GROWTH else AS_DARK) * usual
    # The outermost step that most of the steps before it agree with: a short fade (something
    # bright behind) is no end, and what is fainter beyond the end does not belong to it.
    agree = ndimage.uniform_filter1d(present.astype(float), 21, origin=10, mode="nearest")
    good = np.flatnonzero(present & (agree >= 0.75))
    if len(good) == 0 or good[-1] == last:
        return float(last)
    outermost = int(good[-1])
    # The end to a fraction of a step: where the share of what is taken there is crossed.
    before = taken[None, max(0, outermost - 12) : outermost - 3]
    level = END_SHARE * float(median(before, axis=1)[0]) if before.size else np.nan
    start = max(outermost - 3, 1)
    below = np.flatnonzero(taken[start:] < level)
    if len(below) == 0:
        return float(outermost)
    first = start + int(below[0])
    high, low = taken[first - 1], taken[first]
    return first - 1 + float(min(max((high - level) / max(high - low, 1e-9), 0), 1))


def edge_share(tube: Tube, further_blur: float = 0.0) -> float:
    """Light that a tube takes at its edge, as a share of what it takes at its axis."""
    blur = float(np.hypot(tube.blur, further_blur))
    radius = float(np.median(tube.radius))
    shape = np.array([radius, tube.absorption, blur, 0.0])
    axis, edge = profile(np.array([0.0, radius]), shape)
    return float(edge / axis)
