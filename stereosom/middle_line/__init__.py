"""The device's middle line in one view, from end to end, in order: `middle_line`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..arrays import Floats
from ..reconstruction import HardFrame
from .centering import ALONG, to_ends, to_middle
from .graph import polyline_length, prune, skeleton_chains
from .kernels import kernels
from .route import longest_route

__all__ = ["MiddleLine", "middle_line"]

# Thinning takes a step per pixel of half the width; so many pixels of width are enough.
_THIN_WIDTH = 5.0
# Pieces smaller than this share of the largest are dirt.
_SMALLEST_PIECE = 0.05
# Holes of fewer of the thinned pixels are none.
_LARGEST_HOLE = 4 * _THIN_WIDTH**2
# Widths from point to point, and how many points there are at least and at most.
_POINT_EVERY, _POINTS = 2.0, (120, 400)
# A ragged mask of one device has some dozens; pruning takes the square of it.
_MOST_BRANCHES = 500


@dataclass(frozen=True, eq=False)
class MiddleLine:
    """Points (n, 2) along the middle of the device, px, and its width, px.

    The steps between them are equal, but for those to the two ends.
    """

    points: Floats
    width: float

    @property
    def independent(self) -> float:
        """How much a point tells beside one that errs on its own: neighbors share their pixels.

        A Gaussian mean of white noise is worth 1 in √(4π) σ values; the rounding to pixels
        cancels better than white noise, and twice as many are taken.
        """
        spacing = polyline_length(self.points) / (len(self.points) - 1)
        return float(min(1.0, spacing / (np.sqrt(np.pi) * ALONG * self.width)))


def middle_line(pixels: Floats, count: int | None = None, *, centered: bool = True) -> MiddleLine:
    """Find the way of a device through its mask.

    The mask is thinned; short dead ends are roughness and are taken off; where the device
    crosses itself the way goes straight on, and gaps are bridged where it goes on behind them.

    Parameters
    ----------
    pixels : (n, 2) array
        Of a filled mask, in any order.
    count : int, optional
        Number of points. Default: two widths apart, but 120 at least and 400 at most.
    centered : bool
        Whether the smoothed skeleton, half a pixel off here and there, is moved to the middle of
        the pixels beside it.

    Returns
    -------
    MiddleLine
        It ends where the device does.

    Raises
    ------
    HardFrame
        Where the mask holds no line.
    """
    mask, *corner, factor = kernels().small_mask(pixels, _THIN_WIDTH)
    mask = kernels().without_small(mask, True, _SMALLEST_PIECE, np.inf)
    mask = kernels().without_small(mask, False, 1.0, _LARGEST_HOLE)
    skeleton = kernels().thin(mask)
    width = float(mask.sum()) / max(float(skeleton.sum()), 1.0)
    chains = skeleton_chains(skeleton)
    if len(chains) > _MOST_BRANCHES:
        raise HardFrame(f"the mask is no device: it branches into {len(chains)} pieces")
    route = longest_route(prune(chains, width), width)
    if len(route) < 2:
        raise HardFrame("the mask holds no line that could be a device")
    points = (route[:, ::-1] + 0.5) * factor - 0.5 + corner
    if count is None:
        count = int(np.clip(polyline_length(route) / (_POINT_EVERY * width), *_POINTS))
    row, column = np.divmod(np.flatnonzero(mask), mask.shape[1])
    filled = (np.column_stack([column, row]) + 0.5) * factor - 0.5 + corner
    width *= factor
    line = _smooth(points, count, 0.7 * width)
    if centered:
        line = to_middle(line, filled, width)
    return MiddleLine(to_ends(line, filled, width), width)


def _smooth(points: Floats, count: int, sigma: float) -> Floats:
    """Equal steps along a polyline (n, 2), smoothed by a Gaussian of `sigma` px."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    reach = np.concatenate([[0.0], np.cumsum(steps)])
    even = np.linspace(0.0, reach[-1], count)
    line = np.column_stack([np.interp(even, reach, axis) for axis in points.T])
    # Continued beyond its ends point by point mirrored, so that smoothing does not shorten it.
    sigma = min(sigma / even[1], count / 8)
    margin = min(int(4 * sigma) + 1, count - 1)
    before = 2 * line[0] - line[margin:0:-1]
    after = 2 * line[-1] - line[-2 : -margin - 2 : -1]
    smooth = ndimage.gaussian_filter1d(np.vstack([before, line, after]), sigma, axis=0)
    return np.asarray(smooth[margin:-margin])
