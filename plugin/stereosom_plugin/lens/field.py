"""The region that a view sees, once its lens distortion is taken away."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from stereosom.arrays import Floats

from .model import Lens

_PER_SIDE = 16
_TOUCHES_PX = 1.5


def undistorted_field(corners: Floats, lens: Lens, mask: Any) -> Floats:
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
    mask : (rows, columns) array of bool
        The device in the seen picture.
    """
    sides = list(zip(corners, np.roll(corners, -1, axis=0), strict=True))
    share = np.linspace(0, 1, _PER_SIDE, endpoint=False)[:, None]
    border = np.vstack([start + share * (end - start) for start, end in sides])
    bent = lens.undistort_where_defined(border)
    bent = bent[np.isfinite(bent).all(axis=1)]
    try:
        field = bent[ConvexHull(bent).vertices] if len(bent) > 2 else np.array(corners)
    except QhullError:
        return np.array(corners)
    middle = field.mean(axis=0)
    for place, along in _touched(sides, np.argwhere(mask)[:, ::-1]):
        before, after = lens.undistort_where_defined(np.array([place - along, place + along]))
        across = np.array([before[1] - after[1], after[0] - before[0]])
        if np.isfinite(across).all():
            inward = across * np.sign(across @ (middle - before))
            field = _cut(field, before, inward)
    return field


def _touched(sides: list[tuple[Floats, Floats]], pixels: Any) -> list[tuple[Floats, Floats]]:
    """Places on the border where the device meets it, and the sides' directions there."""
    found = []
    for start, end in sides:
        length = float(np.linalg.norm(end - start))
        if length == 0:
            continue
        along = (end - start) / length
        offset = pixels - start
        near = np.abs(offset @ np.array([-along[1], along[0]])) <= _TOUCHES_PX
        at = np.sort((offset @ along)[near])
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
