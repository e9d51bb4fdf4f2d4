"""An end of a tube, fitted on its own: a fraction of the work of fitting the whole."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Booleans, Floats
from ..camera import StereoRig
from .contour import Contour
from .fit import AS_BEGUN, TubeFit, fit_tube
from .kernels import kernels
from .reference import OPEN
from .spline import SAMPLES_A_PIECE

# So many radii from its end a tube runs as it does whatever the end does.
_LENGTH = 14.0
# An end that is a larger share of the tube than this is fitted as the whole.
_MOST = 0.45
# Edges no farther from its middle than so many half widths, and px, may be the end's.
_BESIDE, _BESIDE_PX = 3.0, 8.0
_FEWEST_SEGMENTS = 4


@dataclass(frozen=True, eq=False)
class EndPiece:
    """The last stretch of a fitted tube, with the edges about it.

    Attributes
    ----------
    rig : StereoRig
    whole : TubeFit
    end : int
        The base (0) or the tip (1).
    samples : slice
        Of the whole tube's curve.
    edges : pair of Contour
        Those nearer to this stretch than to the rest.
    """

    rig: StereoRig
    whole: TubeFit
    end: int
    samples: slice
    edges: tuple[Contour, Contour]

    @classmethod
    def of(
        cls, rig: StereoRig, whole: TubeFit, edges: tuple[Contour, Contour], end: int
    ) -> EndPiece:
        """Cut the base (0) or the tip (1) out of a tube that was fitted to edges."""
        curve = whole.tube.curve
        reach = kernels().reach_along(curve)
        length = _LENGTH * whole.radius
        if length > _MOST * reach[-1]:
            return cls(rig, whole, end, slice(0, len(curve)), edges)
        if end == 0:
            samples = slice(0, int(np.searchsorted(reach, length)) + 1)
        else:
            samples = slice(int(np.searchsorted(reach, reach[-1] - length)) - 1, len(curve))
        near = [
            contour.where(
                _nearest_to(
                    camera.project(curve), samples, contour.points,
                    _BESIDE * look.half_width + _BESIDE_PX,
                )
            )
            for camera, contour, look in zip((rig.a, rig.b), edges, whole.looks, strict=True)
        ]  # fmt: skip
        return cls(rig, whole, end, samples, (near[0], near[1]))

    @property
    def curve(self) -> Floats:
        """The stretch of the whole tube's curve, (n, 3)."""
        return self.whole.tube.curve[self.samples]

    @property
    def is_whole(self) -> bool:
        """Whether the end is all of the tube."""
        return bool(self.samples.stop - self.samples.start == len(self.whole.tube.curve))

    def fit(self, start: Floats, shape: int, **details: Any) -> TubeFit:
        """Fit a curve (n, 3) with such an end to the edges; `details` as of `fit_tube`."""
        count = self.samples.stop - self.samples.start
        ends = list(self.whole.tube.capped)
        ends[self.end] = shape
        if not self.is_whole:
            ends[1 - self.end] = OPEN
        return fit_tube(
            self.rig,
            self.edges,
            start,
            self.whole.radius,
            capped=(ends[0], ends[1]),
            radius_known=True,
            segments=max((count - 1) // SAMPLES_A_PIECE + 1, _FEWEST_SEGMENTS),
            gates=AS_BEGUN,
            **details,
        )

    def joined_to(self, curve: Floats, end: Floats) -> Floats:
        """A curve (n, 3) with the samples of the whole tube's, with another end, (m, 3)."""
        return np.vstack([curve[: self.samples.start], end, curve[self.samples.stop :]])


def _nearest_to(picture: Floats, samples: slice, points: Floats, farthest: float) -> Booleans:
    """Which points (m, 2) are nearest to such samples of a line (n, 2), and no farther off."""
    piece = picture[samples]
    (left, top), (right, bottom) = piece.min(axis=0) - farthest, piece.max(axis=0) + farthest
    x, y = points.T
    near = (x > left) & (x < right) & (y > top) & (y < bottom)
    distance, nearest = cKDTree(picture).query(points[near], distance_upper_bound=farthest)
    near[near] = (nearest >= samples.start) & (nearest < samples.stop) & np.isfinite(distance)
    return np.asarray(near)
