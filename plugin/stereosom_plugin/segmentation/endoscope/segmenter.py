"""`segmenter`: one function per eye, from a picture to a mask."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from stereosom.arrays import Floats
from stereosom.middle_line import middle_line
from stereosom_plugin.errors import InputError

from ..observing import Segment
from ..picture import Mask
from .color import Box, DeviceColor, Stroke, in_box, on_stroke
from .edges import edge_mask
from .finding import Before, ByColor, Finder
from .frame import as_bytes, light
from .ribbon import Ribbon, trace
from .straight import Evidence, brought_to

# A whole search learns the device's color anew, from what it found the time before, so often at
# most, and as long as what is found becomes longer by more than this.
_LEARNED, _LONGER = 6, 1.01
# A narrower device has edges that are not told apart by straightening it, px.
_NARROW_PX = 3.0
# Share of its length and width that a device keeps from one frame to the next.
_KEPT = 0.7


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
        Greatest width that the device may have. Default: 5 % of the picture's longer side.

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
            Eye(Before(light(one, f"background ({eye})"), width_px))
            for one, eye in zip(background, ("left", "right"), strict=True)
        )
        return left, right
    if color_box is not None or stroke is not None:
        if example is None:
            raise InputError("color", "has no picture to be learned from", "give the example")
        seen = light(example, "example")
        sample = in_box(seen.shape, color_box) if color_box else on_stroke(seen.shape, stroke or ())
        by_color = ByColor(DeviceColor(seen, sample), seen.shape[2], width_px)
        return Eye(by_color), Eye(by_color)
    plain = Before(None, width_px)
    return Eye(plain), Eye(plain)


class _Edges:
    def __init__(self, threshold: float) -> None:
        self.threshold = threshold

    def __call__(self, image: Any) -> Mask:
        gray = light(image).mean(axis=2) * 255
        return np.asarray(edge_mask(np.rint(gray).astype(np.uint8), self.threshold))


class Eye:
    """One eye's segmentation. It remembers where the device was, and looks there first."""

    def __init__(self, finder: Finder) -> None:
        self.finder = finder
        self.last: Ribbon | None = None
        self.evidence: Evidence | None = None

    def __call__(self, image: Any) -> Mask:
        """The mask of a picture."""
        if self.last is not None and self.evidence is not None:
            picture = as_bytes(image)
            line, width = self.last.middle[self.last.seen], self.last.width
            line = brought_to(picture, line, width, self.evidence)
            ends = self.finder.eager
            ribbon = trace(picture, line, width, self.evidence, place_ends=ends, middle=True)
            if ribbon is not None and _goes_on(self.last, ribbon):
                self.last = ribbon
                return ribbon.mask(picture.shape)
        return self._anew(image)

    def _anew(self, image: Any) -> Mask:
        picture, seen = as_bytes(image), light(image)
        mask, evidence = self.finder.whole(seen)
        self.last = None
        try:
            found = middle_line(np.argwhere(mask)[:, ::-1].astype(float))
        except ValueError:  # holds no line: what was found is left as it is
            return mask
        if found.width < _NARROW_PX or _meets_itself(found.points, found.width):
            return mask
        # How it heads is told by what lies before its ends, which lean to a corner of the mask.
        line, width = found.points[1:-1], found.width
        for number in range(_LEARNED):
            ribbon = trace(picture, line, width, evidence, place_ends=self.finder.eager)
            if ribbon is None:
                return mask
            longer = _length(ribbon.middle) > _LONGER * _length(line)
            self.last, mask = ribbon, ribbon.mask(picture.shape)
            line, width = ribbon.middle[ribbon.seen], ribbon.width
            evidence = self.evidence = self.finder.learned(seen, mask)
            if not longer and number:
                break
        return mask


def _length(line: Floats) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _goes_on(before: Ribbon, now: Ribbon) -> bool:
    """Whether a ribbon can be that of the frame before."""
    kept = now.seen.sum() * now.width > _KEPT * before.seen.sum() * before.width
    return bool(kept and 1 / _KEPT > now.width / before.width > _KEPT)


def _meets_itself(line: Floats, width: float) -> bool:
    """Whether a line comes back to within a width and a half of itself."""
    step = float(np.linalg.norm(np.diff(line, axis=0), axis=1).mean())
    near = cKDTree(line).query_pairs(1.5 * width, output_type="ndarray")
    return bool(np.any(np.abs(near[:, 0] - near[:, 1]) * step > 5 * width))
