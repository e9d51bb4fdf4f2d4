"""Places that both views name: where the device ends, and where it touches an epipolar plane."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from ..arrays import Booleans, Floats, Integers
from ..camera import StereoRig
from ..middle_line import middle_line
from ..observation import Observation, View
from ..reconstruction import HardFrame

# How far a curve must turn back from an epipolar plane, px, to touch it noticeably.
_PROMINENCE = 2.0


@dataclass(frozen=True, eq=False)
class Line:
    """Middle line of one view, (n, 2) px, to its ends; which ends are true ones; width, px."""

    points: Floats
    free: Booleans
    width: float


@dataclass(frozen=True, eq=False)
class Places:
    """Pixels (m, 2) of both views that show one point, and the frames (m,) they are of."""

    in_a: Floats
    in_b: Floats
    frame: Integers


Frame = tuple[StereoRig, Line, Line]


def seen_frames(observations: Iterable[Observation]) -> list[Frame]:
    """Both middle lines of every frame that has them."""
    frames = []
    for seen in observations:
        try:
            frames.append((seen.rig, _line(seen, "a"), _line(seen, "b")))
        except HardFrame:
            continue
    return frames


def _line(seen: Observation, view: View) -> Line:
    pixels = seen.pixels_a if view == "a" else seen.pixels_b
    if len(pixels) == 0:
        raise HardFrame(f"view {view} saw nothing")
    line = middle_line(pixels)
    free = seen.distance_to_border(view, line.points[[0, -1]]) > max(3.0, line.width)
    return Line(line.points, free, line.width)


def all_places(rigs: list[StereoRig], frames: list[Frame]) -> Places:
    """All places of all frames; which belong together is told by the rigs, one per frame."""
    found: list[tuple[Floats, Floats, int]] = []
    offset = 0.0
    for kind in (_free_ends, _touching):
        apart = []
        for i, (rig, (_, a, b)) in enumerate(zip(rigs, frames, strict=True)):
            focal = (rig.a.focal_length + rig.b.focal_length) / 2
            height_a = rig.epipolar_angle(rig.a, a.points) * focal
            height_b = rig.epipolar_angle(rig.b, b.points) * focal - offset
            for j, k in kind(a, b, height_a, height_b):
                found.append((a.points[j], b.points[k], i))
                apart.append(height_b[k] - height_a[j])
        # A wrong isocenter shifts all heights alike: the ends tell by how much.
        offset = float(np.median(apart)) if apart else 0.0
    pixels_a, pixels_b, frame = zip(*found, strict=True) if found else ((), (), ())
    return Places(
        np.reshape(pixels_a, (-1, 2)), np.reshape(pixels_b, (-1, 2)), np.array(frame, dtype=np.intp)
    )


def _free_ends(a: Line, b: Line, height_a: Floats, height_b: Floats) -> list[tuple[int, int]]:
    """Pairs of ends that lie inside both views."""
    ends_a, ends_b = (np.array([0, len(line.points) - 1])[line.free] for line in (a, b))
    if len(ends_a) == 0 or len(ends_b) == 0:
        return []
    apart = np.abs(height_a[ends_a, None] - height_b[ends_b])
    if len(ends_a) == len(ends_b) == 2:
        order = 1 if np.trace(apart) <= np.trace(apart[:, ::-1]) else -1
        pairs = list(zip(ends_a, ends_b[::order], strict=True))
    else:  # one view sees more of it: the one end of the other is the nearer of the two
        j, k = np.unravel_index(np.argmin(apart), apart.shape)
        pairs = [(ends_a[j], ends_b[k])]
    return [_unfolded(int(j), int(k), height_a, height_b) for j, k in pairs]


def _unfolded(j: int, k: int, height_a: Floats, height_b: Floats) -> tuple[int, int]:
    """Replace an end that is none: where the device bends back behind itself, only one view
    sees it turn, and what looks like the end in the other is the turning point.

    The heights along the device are the same in both views, so both must come to the end rising,
    or both falling.
    """
    turn_a, rise_a = _last_turn(height_a, j)
    turn_b, rise_b = _last_turn(height_b, k)
    if rise_a == rise_b:
        return j, k
    # The middle line ends in the middle of the bend, the mask half a width farther.
    inner_j, inner_k = (1 if j == 0 else j - 1), (1 if k == 0 else k - 1)
    folded = []
    if turn_b is not None:
        folded.append((abs(height_a[inner_j] - height_b[turn_b]), inner_j, turn_b))
    if turn_a is not None:
        folded.append((abs(height_a[turn_a] - height_b[inner_k]), turn_a, inner_k))
    return min(folded)[1:] if folded else (j, k)


def _last_turn(height: Floats, end: int) -> tuple[int | None, bool]:
    """The turning point nearest to an end, and whether the line rises from there to the end."""
    turns = np.concatenate(
        [find_peaks(sign * height, prominence=_PROMINENCE)[0] for sign in (1, -1)]
    )
    if len(turns) == 0:
        other = len(height) - 1 - end
        return None, bool(height[end] > height[other])
    last = int(turns[np.argmin(np.abs(turns - end))])
    return last, bool(height[end] > height[last])


def _touching(a: Line, b: Line, height_a: Floats, height_b: Floats) -> list[tuple[int, int]]:
    """Pairs of places where the curve turns back from an epipolar plane: nearest, both ways."""
    pairs = []
    for sign in (1, -1):
        in_a, in_b = (
            find_peaks(sign * height, prominence=_PROMINENCE)[0] for height in (height_a, height_b)
        )
        if len(in_a) and len(in_b):
            apart = np.abs(height_a[in_a, None] - height_b[in_b])
            for j, k in enumerate(apart.argmin(axis=1)):
                if apart[:, k].argmin() == j:
                    pairs.append((int(in_a[j]), int(in_b[k])))
    return pairs


def _epipolar_terms(rigs: list[StereoRig], places: Places) -> tuple[Floats, Floats, Floats]:
    """x_bᵀ F x_a, and the lengths of the line normals in view a and view b, (m,) each."""
    f = np.array([rig.fundamental for rig in rigs]).reshape(-1, 3, 3)[places.frame]
    one = np.ones((len(places.frame), 1))
    x_a, x_b = np.hstack([places.in_a, one]), np.hstack([places.in_b, one])
    line_b = np.einsum("nij,nj->ni", f, x_a)
    line_a = np.einsum("nji,nj->ni", f, x_b)
    product = np.sum(x_b * line_b, axis=1)
    return product, np.linalg.norm(line_a[:, :2], axis=1), np.linalg.norm(line_b[:, :2], axis=1)


def sampson(rigs: list[StereoRig], places: Places) -> Floats:
    """Signed Sampson distance, (m,), px (Hartley and Zisserman, 11.4.3)."""
    product, in_a, in_b = _epipolar_terms(rigs, places)
    return np.asarray(product / np.hypot(in_a, in_b))


def epipolar_distance(rigs: list[StereoRig], places: Places) -> float:
    """Median over places of the mean distance to both epipolar lines, px."""
    if len(places.frame) == 0:
        return float("nan")
    product, in_a, in_b = _epipolar_terms(rigs, places)
    return float(np.median(np.abs(product) * (1 / in_a + 1 / in_b) / 2))
