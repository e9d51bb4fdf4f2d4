"""The edge of a mask: where device and background meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Booleans, Floats
from .kernels import kernels


@dataclass(frozen=True, eq=False)
class Contour:
    """Points (m, 2) on the edge of a mask, px, and the outward directions there."""

    points: Floats
    directions: Floats

    def __len__(self) -> int:
        return len(self.points)

    def where(self, kept: Booleans | slice) -> Contour:
        """The part of it that is kept, by an (m,) array or a slice."""
        if isinstance(kept, slice):
            return Contour(self.points[kept].copy(), self.directions[kept].copy())
        # Takes a tenth of the time that indexing by the array does.
        parts = (np.compress(kept, whole, axis=0) for whole in (self.points, self.directions))
        return Contour(*parts)


def mask_contour(pixels: Floats) -> Contour:
    """Points half-way between neighboring pixels in and out of a mask.

    Each is where the true edge crosses between two pixel centres, to half a pixel either way
    and zero on the mean. The outward direction leads away from the device's pixels around it.

    Parameters
    ----------
    pixels : (n, 2) array
        Of a filled mask.
    """
    return Contour(*kernels().contour(pixels))
