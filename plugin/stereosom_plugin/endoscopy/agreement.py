"""Do the pictures agree with the calibration? Asked of places that both eyes see, once a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import StereoRig, triangulate

from ..acquisition import Image
from ..errors import require
from ..lens import Lens

# Fewer places say nothing.
LEAST_PLACES = 25
# A calibration fits where half of the places lie this near to their epipolar lines (px, or share
# of the picture's width), and this share of those before both eyes.
NEAR_PX, NEAR_SHARE, IN_FRONT = 2.0, 0.003, 0.7
# Chance partners share no epipolar geometry: beside the eight that any matrix is fitted to, it
# holds for fewer of them than this.
_FITTED, _SHARED = 8, 0.5
_LOOKED_AT = 960  # px; larger pictures are made smaller to be matched
# Places are told from noise by this contrast at least: half of what SIFT asks for, since tissue
# is faint.
_PLACES, _CONTRAST = 1500, 0.02
_RATIO = 0.75  # Lowe's, between the best and the second best partner


@dataclass(frozen=True)
class Agreement:
    """How well places that both eyes see agree with a rig.

    Parameters
    ----------
    gap : float
        Median distance from the epipolar lines, px.
    in_front : float
        Share of the places on their lines that lie before both eyes.
    width : int
        Of the picture, px.
    """

    gap: float
    in_front: float
    width: int

    @property
    def good(self) -> bool:
        """Whether the rig can be that of the pictures."""
        return self.gap <= max(NEAR_PX, NEAR_SHARE * self.width) and self.in_front >= IN_FRONT


def matched_places(left: Image, right: Image) -> tuple[Floats, Floats]:
    """Places that both pictures show, (n, 2) px each: SIFT, each the other's best partner."""
    cv2 = require("cv2", "endoscopy")
    finder, found = cv2.SIFT_create(_PLACES, contrastThreshold=_CONTRAST), []
    for picture in (left, right):
        gray = picture if picture.ndim == 2 else picture[..., :3].mean(axis=2).astype(np.uint8)
        step = max(1, round(max(gray.shape) / _LOOKED_AT))
        small = np.ascontiguousarray(gray[::step, ::step])
        points, described = finder.detectAndCompute(small, None)
        if described is None or len(points) < 2:
            return np.empty((0, 2)), np.empty((0, 2))
        found.append((step * np.array([point.pt for point in points]), described))
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    there, back = (
        _best(matcher.knnMatch(one[1], other[1], k=2)) for one, other in (found, found[::-1])
    )
    pairs = [(a, b) for a, b in there.items() if back.get(b) == a]
    chosen = np.array(pairs, dtype=int).reshape(-1, 2)
    return found[0][0][chosen[:, 0]], found[1][0][chosen[:, 1]]


def agreement(
    rig: StereoRig, lenses: tuple[Lens, Lens] | None, places: tuple[Floats, Floats]
) -> Agreement:
    """Compare places of view a and b, (n, 2) px as seen, with a rig."""
    ideal = list(places)
    if lenses is not None:
        pairs = zip(places, lenses, strict=True)
        ideal = [lens.undistort_where_defined(seen) for seen, lens in pairs]
    known = np.isfinite(ideal[0]).all(axis=1) & np.isfinite(ideal[1]).all(axis=1)
    a, b = ideal[0][known], ideal[1][known]
    width = rig.a.image_size[0]
    if len(a) < LEAST_PLACES:
        return Agreement(np.inf, 0.0, width)
    line = np.column_stack([a, np.ones(len(a))]) @ rig.fundamental.T
    gap = np.abs((line[:, :2] * b).sum(axis=1) + line[:, 2]) / np.linalg.norm(line[:, :2], axis=1)
    near = gap <= np.median(gap)
    try:
        points = triangulate(rig, a[near], b[near])
    except ValueError:  # rays that meet nowhere
        return Agreement(float(np.median(gap)), 0.0, width)
    before = (rig.a.depth(points) > 0) & (rig.b.depth(points) > 0)
    return Agreement(float(np.median(gap)), float(before.mean()), width)


def tell_something(places: tuple[Floats, Floats], width: int) -> bool:
    """Whether places of both pictures, (n, 2) px each, agree on where the eyes stand, anywhere.

    From places that look different from either eye, as where the views are far apart, chance
    partners are left, and no calibration is to blame for those.
    """
    if len(places[0]) < LEAST_PLACES:
        return False
    cv2 = require("cv2", "endoscopy")
    within = max(NEAR_PX, NEAR_SHARE * width)
    _, kept = cv2.findFundamentalMat(*places, cv2.FM_RANSAC, within, 0.99)
    if kept is None:
        return False
    return int(kept.sum()) - _FITTED >= _SHARED * (len(kept) - _FITTED)


def row_gap(places: tuple[Floats, Floats]) -> float:
    """Median distance between the rows of places, px; infinite where depths make no sense.

    In rectified pictures what both eyes see lies in one row, farther right in the left eye.
    """
    left, right = places
    if len(left) < LEAST_PLACES or np.mean(left[:, 0] >= right[:, 0]) < IN_FRONT:
        return np.inf
    return float(np.median(np.abs(left[:, 1] - right[:, 1])))


def _best(candidates: Any) -> dict[int, int]:
    return {
        pair[0].queryIdx: pair[0].trainIdx
        for pair in candidates
        if len(pair) == 2 and pair[0].distance < _RATIO * pair[1].distance
    }
