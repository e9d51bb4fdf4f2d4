"""Dark lines of a picture: how much darker than on both sides, along the best direction.

At each pixel and direction the logarithm of the light is averaged along a short line, and
compared with the same average on either side. The lesser of both differences counts, so that
a step (the edge of a bone, of the body) is no line: it is brighter on one side only
(T. M. Koller et al., "Multiscale detection of curvilinear structures in 2-D and 3-D image
data", ICCV 1995). As logarithms, the differences are absorption, whatever lies behind.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from .loops import loops
from .loops.reference import shifted
from .picture import Gray, Mask, noise_of

DIRECTIONS = 12
# Points of a line, each side of the pixel, and how far apart they are, px.
TAPS, STRIDE = 3, 2.4
# Blur before, and distance of the sides, px: for widths up to 4, 8, and 13 px.
SCALES = ((0.9, 3.5), (1.4, 6.0), (2.0, 9.5))


@dataclass(frozen=True, eq=False)
class Ridges:
    """Dark lines, (rows, columns) each.

    `absorption` is the natural logarithm of light beside over light on the line, zero where
    there is none; `noise` its standard deviation; `direction` counts steps of π / DIRECTIONS
    from the x axis towards y; `crest` are the pixels that are darkest across the line.
    """

    absorption: Gray
    noise: Gray
    direction: npt.NDArray[np.int8]
    crest: Mask


def find_ridges(log: Gray, scales: tuple[tuple[float, float], ...] = SCALES) -> Ridges:
    """Find the dark lines of a picture.

    Parameters
    ----------
    log : (rows, columns) array
        Logarithm of the light.
    scales : tuple of (blur, distance), px
        Of the device's width.

    Examples
    --------
    A line that takes half of the light absorbs ln 2; the blur takes some of it:

    >>> log = np.zeros((40, 40), dtype=np.float32)
    >>> log[:, 17:24] -= np.log(2)
    >>> print(f"{find_ridges(log, SCALES[2:]).absorption[20, 20]:.1f}")
    0.6
    """
    absorption = np.zeros(log.shape, dtype=np.float32)
    direction = np.zeros(log.shape, dtype=np.int8)
    noise = np.zeros(log.shape, dtype=np.float32)
    level = noise_of(log)
    along = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    along = np.stack([np.cos(along), np.sin(along)], axis=1)
    taps = np.rint(np.arange(-TAPS, TAPS + 1)[:, None] * STRIDE * along[:, None]).astype(np.intp)
    for blur, distance in scales:
        aside = np.rint(distance * np.stack([-along[:, 1], along[:, 0]], axis=1)).astype(np.intp)
        reach = int(np.ceil(TAPS * STRIDE)) + int(np.ceil(distance)) + 1
        smooth = np.pad(ndimage.gaussian_filter(log, blur, truncate=2.5), reach, mode="edge")
        better = loops().darker_lines(smooth, taps, aside, absorption, direction)
        # Of white noise a blur leaves 1 / (2 √π blur), a mean of independent taps its root.
        share = np.sqrt(2 / (2 * TAPS + 1)) / (2 * np.sqrt(np.pi) * blur)
        np.copyto(noise, np.float32(share) * level, where=better)
    return Ridges(absorption, noise, direction, _crest(absorption, direction))


def _crest(absorption: Gray, direction: npt.NDArray[np.int8]) -> Mask:
    """Pixels that absorb no less than both neighbors across their line."""
    padded = np.pad(absorption, 1)
    crest = np.zeros(absorption.shape, dtype=bool)
    for number in range(DIRECTIONS):
        angle = number * np.pi / DIRECTIONS
        across = np.rint([-np.sin(angle), np.cos(angle)]).astype(int)
        sides = np.maximum(shifted(padded, across, 1), shifted(padded, -across, 1))
        crest |= (direction == number) & (absorption >= sides) & (absorption > 0)
    return crest
