"""The region that a view sees, once its lens distortion is taken away."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from stereosom.arrays import Floats

from .model import Lens

_PER_SIDE = 16
_TOUCHES_PX = 1.5


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
    sides = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    field = _bent(lens, tuple(map(tuple, corners.tolist())))
    if field is None:
        return np.array(corners)
    middle = field.mean(axis=0)
    touched = [(place - along, place + along) for place, along in _touched(sides, pixels)]
    ideal = lens.undistort_where_defined(np.reshape(touched, (-1, 2))).reshape(-1, 2, 2)
    for before, after in ideal:
        across = np.array([before[1] - after[1], after[0] - before[0]])
        if np.isfinite(across).all():
            inward = across * np.sign(across @ (middle - before))
            field = _cut(field, before, inward)
    return field


@lru_cache(maxsize=4)
def _bent(lens: Lens, corners: tuple[tuple[float, float], ...]) -> Floats | None:
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


def _touched(sides: list[tuple[Floats, Floats]], pixels: Any) -> list[tuple[Floats, Floats]]:
    """Places on the border where the device meets it, and the sides' directions there."""
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
        found += [(start + along * float(group.mean()), along) for group in groups]
    return found


def _cut(corners: Floats, place: Floats, inward: Floats) -> Floats:
    """The part of a convex polygon on the inner side of a line; all of it if that is nothing."""
    height = (corners - place) @ inward
    kept: list[Floats] = []
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if height[i] >= 0:
            kept.append(corners[i])
        if (height[i] >= 0) != (height[j] >= 0):
            share = height[i] / (height[i] - height[j])
            kept.append(corners[i] + share * (corners[j] - corners[i]))
    return np.array(kept) if len(kept) > 2 else corners
