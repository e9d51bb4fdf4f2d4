"""`segmenter`: one function per eye, from a picture to a mask."""

from __future__ import annotations

from typing import Any

import numpy as np

from stereosom_plugin.errors import InputError

from ..observing import Segment
from ..picture import Mask
from .color import Box, DeviceColor, Stroke, in_box, on_stroke
from .difference import difference, plain_background
from .edges import edge_mask
from .frame import Light, light
from .pieces import device_pixels, with_highlights

# Of the full range of light: what differs from the background at least, and clearly.
LEAST, CLEAR = 0.08, 0.2
# The same in units of the picture's noise.
LEAST_NOISE, CLEAR_NOISE = 5.0, 12.0
# Logarithm of how much likelier a color is on the device: at least, and clearly.
LIKELY, VERY_LIKELY = 0.7, 2.0
# Greatest width of the device, as a share of the picture's longer side.
WIDEST = 0.03


def segmenter(
    *,
    background: tuple[Any, Any] | None = None,
    color_box: Box | None = None,
    stroke: Stroke | None = None,
    example: Any = None,
    edges: float | None = None,
    width_px: float | None = None,
) -> tuple[Segment, Segment]:
    """Make the segmentations of the left and the right eye, for `segmentation.observe`.

    With nothing given, the device is what differs from its surroundings: a thin thing before an
    even background.

    Parameters
    ----------
    background : pair of pictures, optional
        The same scene without the device, left and right.
    color_box : (x, y, width, height), optional
        A box, px of `example`, on the device: its color is learned there.
    stroke : sequence of (x, y), optional
        Points along the device instead of a box.
    example : picture, optional
        In which the box or the stroke was drawn, of either eye.
    edges : float, optional
        The paper's edges (`edge_mask`) above this threshold, gray levels of 256; the
        observation is then of kind `edges`.
    width_px : float, optional
        Greatest width that the device may have. Default: 3 % of the picture's longer side.

    Returns
    -------
    pair of callables
        Picture, (rows, columns) or (rows, columns, 3), to mask, (rows, columns).

    Raises
    ------
    InputError
        Where more than one way is asked for, or a box or stroke lies outside the picture.

    Examples
    --------
    >>> picture = np.full((60, 80, 3), 200, dtype=np.uint8)
    >>> picture[28:31, 10:70] = 40, 40, 60
    >>> left, right = segmenter()
    >>> left(picture)[:, 40].nonzero()[0].tolist()
    [28, 29, 30]
    """
    if sum(way is not None for way in (background, color_box, stroke, edges)) > 1:
        raise InputError(
            "segmentation",
            "background, color box, stroke and edges exclude each other",
            "give one of them",
        )
    if width_px is not None and not 0 < width_px < 1e5:
        raise InputError("width", f"{width_px} px is no width", "give a positive number")
    if edges is not None:
        if not np.isfinite(edges):
            raise InputError("edges", "the threshold is no number", "give gray levels")
        by_edges = _Edges(edges)
        return by_edges, by_edges
    if background is not None:
        left, right = (
            _BeforeBackground(light(one, f"background ({eye})"), width_px)
            for one, eye in zip(background, ("left", "right"), strict=True)
        )
        return left, right
    if color_box is not None or stroke is not None:
        if example is None:
            raise InputError("color", "has no picture to be learned from", "give the example")
        seen = light(example, "example")
        sample = in_box(seen.shape, color_box) if color_box else on_stroke(seen.shape, stroke or ())
        by_color = _ByColor(DeviceColor(seen, sample), seen.shape[2], width_px)
        return by_color, by_color
    plain = _BeforeBackground(None, width_px)
    return plain, plain


class _Edges:
    def __init__(self, threshold: float) -> None:
        self.threshold = threshold

    def __call__(self, image: Any) -> Mask:
        gray = light(image).mean(axis=2) * 255
        return np.asarray(edge_mask(np.rint(gray).astype(np.uint8), self.threshold))


class _BeforeBackground:
    """What differs from a background: one that is given, or the surroundings."""

    def __init__(self, background: Light | None, width_px: float | None) -> None:
        self.background, self.width_px = background, width_px

    def __call__(self, image: Any) -> Mask:
        picture = light(image)
        width = _width(picture, self.width_px)
        behind = plain_background(picture) if self.background is None else self.background
        apart = difference(picture, behind)
        noise = 1.4826 * float(np.median(apart[::2, ::2]))
        low, high = max(LEAST, LEAST_NOISE * noise), max(CLEAR, CLEAR_NOISE * noise)
        return with_highlights(device_pixels(apart, low, high, width), picture, width)


class _ByColor:
    """What has the device's color."""

    def __init__(self, color: DeviceColor, channels: int, width_px: float | None) -> None:
        self.color, self.channels, self.width_px = color, channels, width_px

    def __call__(self, image: Any) -> Mask:
        picture = light(image)
        if picture.shape[2] != self.channels:
            raise InputError("picture", "has other colors than the example", "give one like it")
        width = _width(picture, self.width_px)
        likely = np.maximum(self.color(picture), 0)
        return with_highlights(device_pixels(likely, LIKELY, VERY_LIKELY, width), picture, width)


def _width(picture: Light, width_px: float | None) -> int:
    return max(3, round(WIDEST * max(picture.shape[:2]) if width_px is None else width_px))
