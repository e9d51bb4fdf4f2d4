"""The region that a view sees, once its lens distortion is taken away."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from stereosom.arrays import Floats
from stereosom.polygons import clipped

from .model import Lens

_PER_SIDE = 16
_TOUCHES_PX = 1.5
# From step to step along a side, px.
_STEP_PX = 1.0

Corner = tuple[float, float]


def undistorted_field(corners: Floats, lens: Lens, pixels: Any) -> Floats:
    """Convex region, (m, 2) corners in the ideal camera's picture, in which a view sees.

    A lens bends the straight sides of a picture, inwards or outwards, while the core asks for a
    convex region, and asks it mainly whether a device ends at its border. So the region is the
    hull of the bent border, cut where the device meets the border by the border's tangent
    there.

    Parameters
    ----------
    corners : (n, 2) array
        In order, of the convex region in the seen picture.
    lens : Lens
    pixels : (n, 2) array
        Of the device in the seen picture.
    """
    field = _bent(lens, tuple(map(tuple, corners.tolist())))
    if field is None:
        return np.array(corners)
    middle = field.mean(axis=0)
    sides = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    for start, end, at in _touched(sides, pixels):
        side = _side(lens, tuple(start.tolist()), tuple(end.tolist()))
        before, after = side(at - 1), side(at + 1)
        across = np.array([before[1] - after[1], after[0] - before[0]])
        if np.isfinite(across).all():
            inward = across * np.sign(across @ (middle - before))
            field = _cut(field, before, inward)
    return field


@lru_cache(maxsize=4)
def _bent(lens: Lens, corners: tuple[Corner, ...]) -> Floats | None:
    """The hull of a border as the ideal camera has it; None where it is none."""
    start = np.array(corners)[:, None]
    share = np.linspace(0, 1, _PER_SIDE, endpoint=False)[:, None]
    border = start + share * (np.roll(start, -1, axis=0) - start)
    bent = lens.undistort_where_defined(border.reshape(-1, 2))
    bent = bent[np.isfinite(bent).all(axis=1)]
    if len(bent) < 3:
        return np.array(corners)
    try:
        return np.asarray(bent[ConvexHull(bent).vertices])
    except QhullError:
        return None


class _Side:
    """A side of a border as the ideal camera has it, at even steps, one of them beyond its ends."""

    def __init__(self, lens: Lens, start: Floats, end: Floats) -> None:
        length = float(np.linalg.norm(end - start))
        count = max(round(length / _STEP_PX), 1)
        share = np.arange(-1, count + 2)[:, None] / count
        self._step = length / count
        self._shown = lens.undistort_where_defined(start + share * (end - start))

    def __call__(self, at: float) -> Floats:
        """Where it is at a distance from its start, px."""
        place = min(max(at / self._step + 1, 0.0), len(self._shown) - 1.0)
        number = min(int(place), len(self._shown) - 2)
        share = place - number
        return np.asarray((1 - share) * self._shown[number] + share * self._shown[number + 1])


@lru_cache(maxsize=16)
def _side(lens: Lens, start: Corner, end: Corner) -> _Side:
    """A side, one and the same for all frames: a device enters now here, now there."""
    return _Side(lens, np.array(start), np.array(end))


def _touched(sides: list[tuple[Floats, Floats]], pixels: Any) -> list[tuple[Floats, Floats, float]]:
    """Sides that the device meets, and how far from their starts, px."""
    if len(pixels) == 0:
        return []
    found = []
    x, y = np.transpose(pixels)
    left, right, top, bottom = x.min(), x.max(), y.min(), y.max()
    box = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    for start, end in sides:
        length = float(np.linalg.norm(end - start))
        if length == 0:
            continue
        along = (end - start) / length
        across = np.array([-along[1], along[0]])
        away = (box - start) @ across
        if away.min() > _TOUCHES_PX or away.max() < -_TOUCHES_PX:
            continue  # of most sides, the box about the device tells so at once
        near = np.abs(pixels @ across - start @ across) <= _TOUCHES_PX
        at = np.sort((pixels[near] - start) @ along)
        groups = np.split(at, np.nonzero(np.diff(at) > 3)[0] + 1) if len(at) else []
        found += [(start, end, float(group.mean())) for group in groups]
    return found


def _cut(corners: Floats, place: Floats, inward: Floats) -> Floats:
    """The part of a convex polygon on the inner side of a line; all of it if that is nothing."""
    kept = clipped(corners, np.append(inward, -place @ inward))
    return kept if len(kept) > 2 else corners
