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
    angles = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    for blur, distance in scales:
        reach = int(np.ceil(TAPS * STRIDE + distance)) + 1
        smooth = np.pad(ndimage.gaussian_filter(log, blur, truncate=2.5), reach, mode="edge")
        # Of white noise a blur leaves 1 / (2 √π blur), a mean of independent taps its root.
        share = np.sqrt(2 / (2 * TAPS + 1)) / (2 * np.sqrt(np.pi) * blur)
        for number, angle in enumerate(angles):
            along = np.array([np.cos(angle), np.sin(angle)])
            line = _line_mean(smooth, along, int(np.ceil(TAPS * STRIDE)))
            margin = reach - int(np.ceil(TAPS * STRIDE))
            across = np.rint(distance * np.array([-along[1], along[0]])).astype(int)
            here = _shifted(line, (0, 0), margin)
            darker = np.minimum(_shifted(line, across, margin), _shifted(line, -across, margin))
            darker -= here
            better = darker > absorption
            np.copyto(absorption, darker, where=better)
            np.copyto(direction, np.int8(number), where=better)
            np.copyto(noise, np.float32(share) * level, where=better)
    return Ridges(absorption, noise, direction, _crest(absorption, direction))


def _line_mean(smooth: Gray, along: npt.NDArray[np.float64], margin: int) -> Gray:
    """Mean along a line through each pixel; the result is `margin` smaller on each side."""
    offsets = np.rint(np.arange(-TAPS, TAPS + 1)[:, None] * STRIDE * along).astype(int)
    total = _shifted(smooth, offsets[0], margin).copy()
    for offset in offsets[1:]:
        total += _shifted(smooth, offset, margin)
    total *= np.float32(1 / len(offsets))
    return total


def _shifted(array: Gray, offset: npt.NDArray[np.int_] | tuple[int, int], margin: int) -> Gray:
    """View of an array without its margin, moved by an offset (x, y) of at most the margin."""
    x, y = int(offset[0]), int(offset[1])
    rows, columns = array.shape
    return array[margin + y : rows - margin + y, margin + x : columns - margin + x]


def _crest(absorption: Gray, direction: npt.NDArray[np.int8]) -> Mask:
    """Pixels that absorb no less than both neighbors across their line."""
    padded = np.pad(absorption, 1)
    crest = np.zeros(absorption.shape, dtype=bool)
    for number in range(DIRECTIONS):
        angle = number * np.pi / DIRECTIONS
        across = np.rint([-np.sin(angle), np.cos(angle)]).astype(int)
        sides = np.maximum(_shifted(padded, across, 1), _shifted(padded, -across, 1))
        crest |= (direction == number) & (absorption >= sides) & (absorption > 0)
    return crest
