"""Masks of rendered tubes, with edges as rough as wanted.

A mask's edge is moved by a smooth random displacement of the picture: its amplitude is the
standard deviation across the edge, `CORRELATION_PX` says how soon it forgets itself along it.
What a fit averages over is the noise's density at low frequency: for white noise smoothed by a
Gaussian of standard deviation ℓ the autocorrelation is exp(−d²/4ℓ²), its integral 2√π ℓ. One
boundary point a pixel, each on its own, would be as uncertain with a variance of amplitude² times
that integral; rounding to whole pixels adds 1/12.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from stereosom.arrays import Booleans, Floats
from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom.observation import Observation

from . import mockup
from .cramer_rao import PIXEL_DEVIATION

CORRELATION_PX = 2.0
"""ℓ, px."""

_MARGIN_PX = 12


def deviation(roughness: float) -> float:
    """Standard deviation of a boundary point, one a pixel, that is as good as a rough edge, px.

    Examples
    --------
    >>> round(deviation(0.0) ** 2, 4), round(deviation(0.5), 2)
    (0.0833, 1.36)
    """
    memory = 2 * np.sqrt(np.pi) * CORRELATION_PX
    return float(np.sqrt(PIXEL_DEVIATION**2 + roughness**2 * memory))


def coverage(curve: Backbone, radius: float, camera: Camera) -> Floats:
    """Share of each pixel that a flat-ended tube covers, (rows, columns), rendered by VTK.

    Only the part of the picture around the tube is rendered: the rest is empty.
    """
    width, height = camera.image_size
    points = curve.sample(400)
    pixels = camera.project(points)
    reach = radius / camera.pixel_size(points).min() + _MARGIN_PX
    low = np.clip(np.floor(pixels.min(axis=0) - reach), 0, None).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0) + reach), None, [width, height]).astype(int)
    shift = np.array([[1, 0, -low[0]], [0, 1, -low[1]], [0, 0, 1]])
    part = Camera(shift @ camera.projection, (int(high[0] - low[0]), int(high[1] - low[1])))
    # An odd number of rays across a pixel: none is half covered, so none is rounded either way.
    gray = mockup.render_tube(
        curve, radius, part, gray=0, background=255, light=None, oversampling=3, smoothed=False
    )
    whole = np.zeros((height, width))
    whole[low[1] : high[1], low[0] : high[0]] = 1 - gray / 255
    return whole


def roughened(covered: Floats, roughness: float, rng: np.random.Generator) -> Booleans:
    """The mask of a tube whose picture is displaced at random, (rows, columns).

    Parameters
    ----------
    covered : (rows, columns) array
        Of `coverage`.
    roughness : float
        Standard deviation of the displacement across any edge, px.
    rng : numpy random generator
    """
    if roughness == 0:
        return np.asarray(covered > 0.5)
    rows, columns = (np.flatnonzero(covered.any(axis=axis)) for axis in (1, 0))
    part = np.s_[
        max(rows[0] - _MARGIN_PX, 0) : rows[-1] + _MARGIN_PX,
        max(columns[0] - _MARGIN_PX, 0) : columns[-1] + _MARGIN_PX,
    ]
    shape = covered[part].shape
    # White noise loses all but 1/(2√π ℓ) of its deviation to the filter.
    scale = roughness * 2 * np.sqrt(np.pi) * CORRELATION_PX
    moved = [scale * gaussian_filter(rng.normal(size=shape), CORRELATION_PX) for _ in range(2)]
    mask = np.zeros(covered.shape, dtype=bool)
    grid = np.indices(shape)
    mask[part] = map_coordinates(covered[part], grid + moved, order=1, mode="nearest") > 0.5
    return mask


def observe(
    covered: tuple[Floats, Floats], rig: StereoRig, roughness: float, seed: int
) -> Observation:
    """What both views show of a tube, from its coverage in each."""
    rng = np.random.default_rng(seed)
    mask_a, mask_b = (roughened(view, roughness, rng) for view in covered)
    return Observation.from_masks(mask_a, mask_b, rig)
