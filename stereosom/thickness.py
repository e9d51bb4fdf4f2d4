"""A device stays as thick as it is: what its clear frames tell of that holds in the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .camera import StereoRig
from .entering import eyes_alike
from .reconstruction import Reconstruction

# However many frames are taken together, a thickness is known no better than this share: masks
# are too wide or too narrow by a part of a pixel, in all of them alike.
_LEAST = 0.015
# A frame that by itself knows it so many times less well is fitted with it.
_LESS = 2.0
SAID = "depth is settled by the device's thickness in the frames before"


@dataclass(frozen=True)
class Thickness:
    """The radius of a device before two eyes, by the frames so far.

    Where a device runs along the line between the eyes, depth and radius can grow together, and
    neither view tells: a curve that is followed then drifts away.

    Parameters
    ----------
    radius : float
        Weighted mean, mm.
    weight : float
        Sum of the frames' weights: one through the square of the share to which each knows it.
    """

    radius: float = 0.0
    weight: float = 0.0

    @property
    def share(self) -> float:
        """To what share of it the radius is known (one standard deviation)."""
        return max(_LEAST, self.weight**-0.5) if self.weight else np.inf

    def after(self, result: Reconstruction, rig: StereoRig) -> Thickness:
        """With what another frame tells, fitted on its own; before two eyes only."""
        if not eyes_alike(rig):
            return self
        share = _share_known(result, rig)
        if result.radius is None or not 0 < share < np.inf:
            return self
        weight = self.weight + share**-2
        return Thickness(self.radius + (result.radius - self.radius) * share**-2 / weight, weight)

    def settled(
        self, result: Reconstruction, rig: StereoRig, fit: Callable[[float], Reconstruction]
    ) -> Reconstruction:
        """A frame's result, or that of a `fit` with the known radius, where it knows less itself.

        The known radius is not known exactly: along the lines of sight, the covariance of such a
        result grows by as much.
        """
        if not eyes_alike(rig) or not _share_known(result, rig) > _LESS * self.share:
            return result
        again = fit(self.radius)
        if again.backbone is None or again.covariance is None:
            return result
        away = again.backbone.sample(len(again.covariance)) - rig.a.center
        covariance = again.covariance + self.share**2 * away[:, :, None] * away[:, None, :]
        return replace(again, covariance=covariance, reason=again.reason or SAID)


def _share_known(result: Reconstruction, rig: StereoRig) -> float:
    """To what share a frame by itself knows depth, and with it the radius."""
    if result.backbone is None:
        return float(np.inf)
    s = result.backbone.arc_lengths(11)[1:-1]
    away = np.linalg.norm(result.backbone(s) - rig.a.center, axis=1)
    return float(np.median(result.standard_deviation_at(s) / away))
