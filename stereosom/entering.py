"""What only one of two eyes that look the same way sees of an entering device: `trim_along`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from .arrays import Booleans, Floats, Integers
from .camera import StereoRig
from .observation import Observation
from .polygons import clipped, in_polygon

# Eyes that look the same way, within this, see a device run the same way.
_ALIKE_DEG = 15.0
# A curve is gone on with by this share of its length, to find where it leaves a view.
_BEYOND, _SAMPLES = 0.15, 400
# A border is moved inwards only where no more of what is kept than this lies beyond.
_BEYOND_CUT = 0.01
# Which place of a curve a pixel is nearest to is told for squares of this size, px.
_CELL_PX = 3.0


def eyes_alike(rig: StereoRig) -> bool:
    """Whether two views are those of eyes, close together, and not of planes across."""
    return rig.convergence_deg < _ALIKE_DEG


def trim_along(observation: Observation, curve: Floats) -> Observation:
    """Leave out what one view sees of an entering device beyond the border of the other.

    As `ends.trim_to_shared_stretch`, where the device runs along the epipolar lines, which then
    do not tell where the border of one view is in the other: a curve near the device does.

    Parameters
    ----------
    observation : Observation
    curve : (n, 3) array
        Points along it, mm.

    Returns
    -------
    Observation
        The same object where there is nothing to trim.
    """
    assert observation.field_of_view is not None
    cameras = (observation.rig.a, observation.rig.b)
    longer = _gone_on(curve)
    if min(float(camera.depth(longer).min()) for camera in cameras) <= 0:
        return observation
    shown = [camera.project(longer) for camera in cameras]
    inside: Booleans = np.logical_and(
        *(in_polygon(*view) for view in zip(observation.field_of_view, shown, strict=True))
    )
    both = np.flatnonzero(inside)
    if len(both) < 2 or inside.all():
        return observation
    first, last = int(both[0]), int(both[-1])
    pixels, fields = [], []
    for seen, field, way in zip(
        (observation.pixels_a, observation.pixels_b), observation.field_of_view, shown, strict=True
    ):
        tree, kept = cKDTree(way), seen
        for end, inward in ((first, 1), (last, -1)):
            if 0 < end < len(way) - 1 and len(kept):
                heading = inward * (way[end + 1] - way[end - 1])
                line = np.append(heading, -heading @ way[end])
                beyond = np.flatnonzero(kept @ line[:2] < -line[2])
                at = _nearest(tree, kept[beyond])
                gone = at < first if end == first else at > last
                # A device that comes back from beyond is not cut there.
                comes_back = np.count_nonzero(~gone)
                if comes_back < _BEYOND_CUT * (len(kept) - np.count_nonzero(gone)):
                    field = clipped(field, line)
                else:
                    beyond = beyond[gone]
                stays = np.ones(len(kept), dtype=bool)
                stays[beyond] = False
                kept = np.compress(stays, kept, axis=0)  # a tenth of what kept[stays] takes
        pixels.append(kept)
        fields.append(field)
    if min(len(kept) for kept in pixels) == 0:
        return observation
    return replace(
        observation,
        pixels_a=pixels[0],
        pixels_b=pixels[1],
        field_of_view=(fields[0], fields[1]),
    )


def _nearest(tree: cKDTree, pixels: Floats) -> Integers:
    """Which point is nearest to each pixel (n, 2), or to the middle of the square it lies in."""
    cell = np.floor(pixels / _CELL_PX)
    numbers = cell @ [1.0, 1e6]
    _, first, of = np.unique(numbers, return_index=True, return_inverse=True)
    nearest = np.asarray(tree.query((cell[first] + 0.5) * _CELL_PX)[1])
    return np.asarray(nearest[of])


def _gone_on(curve: Floats) -> Floats:
    """A curve (n, 3), even and gone on straight at both ends."""
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    even = np.linspace(0, reach[-1], _SAMPLES)
    points = np.column_stack([np.interp(even, reach, axis) for axis in curve.T])
    step = even[1]
    ahead = step * np.arange(1, int(_BEYOND * _SAMPLES) + 1)[:, None]
    ends = []
    for end, before in ((points[0], points[20]), (points[-1], points[-21])):
        heading = (end - before) / max(float(np.linalg.norm(end - before)), 1e-9)
        ends.append(end + ahead * heading)
    return np.vstack([ends[0][::-1], points, ends[1]])
