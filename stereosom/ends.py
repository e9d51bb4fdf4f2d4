"""Where the device begins and ends in the views, and the stretch that both views see."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from .arrays import Booleans, Floats
from .camera import StereoRig, triangulate
from .observation import Kind, Observation, View
from .options import Options
from .polygons import clipped
from .reconstruction import HardFrame

# A pixel is at the border of its view where no other pixel fits between.
_AT_BORDER_PX = 1.5


def trim_to_shared_stretch(observation: Observation) -> Observation:
    """Leave out what one view sees of an entering device beyond the border of the other.

    Two views of a device that enters from outside see stretches of different length. Where
    the device reaches the border of one view, the epipolar plane through that point cuts the
    other view: pixels beyond have no partner. They are left out, and the field of view ends
    at the cut, so that the device has no end there either.

    Parameters
    ----------
    observation : Observation

    Returns
    -------
    Observation
        The same object where there is nothing to trim.
    """
    rig = observation.rig
    pixels = {"a": observation.pixels_a, "b": observation.pixels_b}
    if min(len(seen) for seen in pixels.values()) == 0:
        return observation
    cameras = {"a": rig.a, "b": rig.b}
    at_border = {
        "a": observation.at_border("a", pixels["a"], _AT_BORDER_PX),
        "b": observation.at_border("b", pixels["b"], _AT_BORDER_PX),
    }
    if not any(near.any() for near in at_border.values()):
        return observation
    angles = {view: rig.epipolar_angle(cameras[view], pixels[view]) for view in pixels}
    entering = {view: angles[view][at_border[view]] for view in pixels}
    fields = dict(zip("ab", observation.field_of_view or (), strict=True))
    for sign in (1.0, -1.0):  # the side of small angles, then that of large ones
        starts = {view: float(np.min(sign * angles[view])) for view in pixels}
        short, long = ("a", "b") if starts["a"] > starts["b"] else ("b", "a")
        extent = float(np.ptp(angles[short]))
        at_start = sign * entering[short] < starts[short] + 0.05 * extent
        if not at_start.any():
            continue
        line = sign * rig.epipolar_line(cameras[long], sign * starts[short])
        kept = pixels[long] @ line[:2] + line[2] >= 0
        pixels[long] = np.compress(kept, pixels[long], axis=0)
        fields[long] = clipped(fields[long], line)
    if all(len(pixels[view]) == len(angles[view]) for view in pixels):
        return observation
    if min(len(seen) for seen in pixels.values()) == 0:
        raise HardFrame("the two views see no common stretch of the device")
    return replace(
        observation,
        pixels_a=pixels["a"],
        pixels_b=pixels["b"],
        field_of_view=(fields["a"], fields["b"]),
    )


@dataclass(frozen=True, eq=False)
class Ends:
    """Both ends in space, (3,) each, mm, and how it was decided which one is the base."""

    base: Floats
    tip: Floats
    because: str


def find_ends(observation: Observation) -> Ends:
    """Triangulate both ends of the device and tell the base from the tip.

    The end at the border of the views is the base. Where that does not decide, the end
    that lies lower in the pictures is taken, and `because` says so.

    Parameters
    ----------
    observation : Observation
        Trimmed to the stretch that both views share.

    Raises
    ------
    HardFrame
        Where a view shows too little to have two ends.
    """
    rig = observation.rig
    ends_a = mask_ends(observation.pixels_a, observation.kind)
    ends_b = mask_ends(observation.pixels_b, observation.kind)
    open_a = _is_open(observation, "a", ends_a)
    open_b = _is_open(observation, "b", ends_b)
    if _swapped(rig, ends_a, ends_b, open_a, open_b):
        ends_b, open_b = ends_b[::-1], open_b[::-1]
    first, second = triangulate(rig, ends_a, ends_b)
    entering = open_a | open_b
    if entering[0] != entering[1]:
        because = "the base is the end at the picture's border"
        first_is_base = bool(entering[0])
    else:
        because = "nothing tells the base from the tip: the end lower in the pictures was taken"
        first_is_base = bool(ends_a[0, 1] + ends_b[0, 1] >= ends_a[1, 1] + ends_b[1, 1])
    return Ends(first, second, because) if first_is_base else Ends(second, first, because)


def oriented_ends(observation: Observation, options: Options) -> Ends:
    """Both ends as `find_ends` gives them, the base as the last curve or the prior tells it.

    Parameters
    ----------
    observation : Observation
        Trimmed to the stretch that both views share.
    options : Options
        `start`, else `prior.base`, decides which end is the base.

    Raises
    ------
    HardFrame
        Where a view shows too little to have two ends.
    """
    ends = find_ends(observation)
    if options.start is not None:
        known, because = options.start.base, ""
    elif options.prior.base is not None:
        known, because = options.prior.base, "the base is the end nearest to the given one"
    else:
        return ends
    base, tip = ends.base, ends.tip
    if np.linalg.norm(tip - known) < np.linalg.norm(base - known):
        base, tip = tip, base
    return Ends(base, tip, because)


def reach_ends(observation: Observation, references: Floats) -> Floats:
    """Add to ordered points in space the ends of the masks, where they lie beyond.

    Whatever averages over neighbors pulls the ends of a curve inward (the paper's Figure 5).

    Parameters
    ----------
    observation : Observation
    references : (k, 3) array
        Along the device, about equally spaced, mm; at least three.

    Returns
    -------
    (k + 2, 3) array
    """
    rig = observation.rig
    added = []
    for outermost in (references[:3], references[::-1][:3]):
        in_a = _end_beyond(observation.pixels_a, rig.a.project(outermost))
        in_b = _end_beyond(observation.pixels_b, rig.b.project(outermost))
        added.append(triangulate(rig, in_a[None], in_b[None]))
    return np.concatenate([added[0], references, added[1]])


def mask_ends(pixels: Floats, kind: Kind = "filled", at_most: int = 800) -> Floats:
    """The two pixels that are farthest apart along the device, (2, 2).

    The way along the device is the shortest path over links between near pixels, of at most
    `at_most` pixels evenly drawn. Where pixels trace the edges, more links reach across.

    Parameters
    ----------
    pixels : (n, 2) array
    kind : {'filled', 'edges'}
    at_most : int

    Raises
    ------
    HardFrame
        Where all pixels lie in one place.

    Examples
    --------
    >>> row = np.column_stack([np.arange(5.0), np.zeros(5)])
    >>> sorted(mask_ends(row)[:, 0].tolist())
    [0.0, 4.0]
    """
    order = np.lexsort(pixels.T)  # the result must not depend on the order of the pixels
    drawn = pixels[order[np.linspace(0, len(order) - 1, min(at_most, len(order))).astype(int)]]
    if len(drawn) < 2 or not np.ptp(drawn, axis=0).any():
        raise HardFrame("all device pixels lie in one place")
    neighbors = min(9 if kind == "filled" else 60, len(drawn))
    distance, index = cKDTree(drawn).query(drawn, k=neighbors)
    start = np.repeat(np.arange(len(drawn)), neighbors)
    # Pixels may coincide; a link of length zero would be no link at all.
    weights = np.maximum(np.ravel(distance), 1e-9)
    graph = csr_array((weights, (start, np.ravel(index))), shape=(len(drawn), len(drawn)))
    end = 0
    for _ in range(2):  # the farthest from anywhere is one end, the farthest from it the other
        begin = end
        reach = dijkstra(graph, directed=False, indices=[begin])[0]
        end = int(np.argmax(np.where(np.isfinite(reach), reach, -1)))
    return np.asarray(drawn[[begin, end]])


def _end_beyond(pixels: Floats, outermost: Floats) -> Floats:
    """Where the mask ends beyond the first of three projected points of a curve, (2,), px."""
    end, inward = outermost[0], outermost[0] - outermost[2]
    stride = float(np.linalg.norm(inward))
    if stride == 0:
        return np.asarray(end)
    outward = inward / stride
    along = (pixels - end) @ outward
    across = np.abs((pixels - end) @ [-outward[1], outward[0]])
    # Averaging pulls the end inward by less than two spacings, which is this stride.
    beyond = (along > 0) & (along < 2 * stride) & (across < max(2.0, 0.25 * stride))
    reach = float(np.percentile(along[beyond], 98)) if beyond.any() else 0.0
    return np.asarray(end + reach * outward)


def _is_open(observation: Observation, view: View, ends: Floats) -> Booleans:
    """Whether the device leaves the field of view at each of the (2, 2) end pixels."""
    pixels = observation.pixels_a if view == "a" else observation.pixels_b
    at_border = pixels[observation.at_border(view, pixels, _AT_BORDER_PX)]
    if len(at_border) == 0:
        return np.zeros(2, dtype=bool)
    extent = float(np.linalg.norm(np.ptp(pixels, axis=0)))
    distance, _ = cKDTree(at_border).query(ends)
    return np.asarray(distance <= 0.05 * extent)


def _swapped(
    rig: StereoRig, ends_a: Floats, ends_b: Floats, open_a: Booleans, open_b: Booleans
) -> bool:
    """Whether the first end in view a is the second one in view b."""
    if open_a[0] != open_a[1] and open_b[0] != open_b[1]:
        return bool(open_a[0] != open_b[0])
    angle_a, angle_b = rig.epipolar_angle(rig.a, ends_a), rig.epipolar_angle(rig.b, ends_b)
    straight = np.abs(angle_a - angle_b).sum()
    crossed = np.abs(angle_a - angle_b[::-1]).sum()
    return bool(crossed < straight)
