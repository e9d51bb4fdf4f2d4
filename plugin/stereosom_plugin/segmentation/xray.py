"""One X-ray picture: where a device may be, which line it is, and its mask."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats, check_array

from .chains import Chain, find_chains
from .free_ends import sharpen_end
from .picture import Gray, Mask, binned, checked, darkest, in_polygon, log_light
from .ridges import SCALES, find_ridges
from .tube import Tube, draw, fit_tube

# The search is made where the longer side of the picture has about so many pixels.
SEARCH_SIDE = 512
# Greatest width of a device, px of the search.
WIDEST = 12.0
# Absorption, natural logarithm, below which one picture alone shows no device: anatomy does so too.
LEAST_ALONE = 0.25
# Greatest variation of the absorption along a device, as a share of it.
MOST_VARIATION = 0.35
# A line that comes so near to the border of the field, px of the search, goes on beyond.
AT_BORDER = 5.0
# Half the width of the band about where the device was, px of the search.
BAND = 24.0
# Radius, px, below which a device of known width is not made narrower by a coarser search.
NARROW = 1.7


@dataclass(frozen=True, eq=False)
class Candidate:
    """A line that may be the device: points (n, 2), px of the whole picture, and how likely."""

    points: Floats
    enters: tuple[bool, bool]
    absorption: float
    likely: float


@dataclass(frozen=True, eq=False)
class View:
    """One picture, prepared.

    `factor` is how many of its pixels make one of the search; `margin` the distance to the
    border of the field, in fours of those, at every fourth of them.
    """

    picture: Gray
    factor: int
    margin: Gray
    greatest_width: float
    field_of_view: Floats | None = None

    def distance_to_border(self, points: Floats) -> Floats:
        """Of points (n, 2), px of the whole picture, to the border of the field, px."""
        at = np.rint(points / (4 * self.factor)).astype(int)
        column = np.clip(at[:, 0], 0, self.margin.shape[1] - 1)
        row = np.clip(at[:, 1], 0, self.margin.shape[0] - 1)
        height, width = self.picture.shape
        x, y = points.T
        picture = np.minimum(np.minimum(x, width - 1 - x), np.minimum(y, height - 1 - y))
        # The search keeps away from the border of the field by some pixels of the search.
        field = (4 * self.margin[row, column] - 10) * self.factor
        nearest = np.minimum(picture, np.where(self.margin[row, column] < 1e3, field, np.inf))
        return np.asarray(nearest, dtype=float)


def segment_xray(
    image: Any, *, field_of_view: Any | None = None, width_px: float | None = None
) -> Mask:
    """Find the pixels of one dark tube, metal in an X-ray picture.

    Dark lines are found at the scales of a device and linked across gaps and crossings; of
    those, the one that absorbs most, evenly, over its length, and comes from outside is the
    device. Its middle line, width and ends are then fitted to a fraction of a pixel.

    Parameters
    ----------
    image : (rows, columns) array
        In proportion to the light: dark where much is absorbed.
    field_of_view : (m, 2) array, optional
        Corners (x, y), px, of the region in which the picture shows anything.
    width_px : float, optional
        Greatest width that the device may have. Default: 12 px per 512 px of picture.

    Returns
    -------
    (rows, columns) array of bool
        True on the device, filled to its edges; all False where none is seen.

    Raises
    ------
    InputError
        Where the image has no two dimensions or holds values that are not finite.

    Examples
    --------
    >>> picture = np.full((200, 200), 1000)
    >>> picture[50:, 98:103] = 250  # enters from below, 5 pixels wide
    >>> mask = segment_xray(picture)
    >>> mask[100].nonzero()[0]
    array([ 98,  99, 100, 101, 102])
    """
    view = prepare(image, field_of_view=field_of_view, width_px=width_px)
    for candidate in candidates(view)[:4]:
        if candidate.absorption < LEAST_ALONE:
            continue
        tube = fit(view, candidate)
        if tube is not None:
            return within(view, fill(view, tube))
    return fill(view, None)


def prepare(image: Any, *, field_of_view: Any | None = None, width_px: float | None = None) -> View:
    """Take the logarithm of a picture, and find out where anything can be seen."""
    picture = checked(image)
    side = max(picture.shape)
    factor = max(1, round(side / SEARCH_SIDE))
    # Where light comes, at every fourth pixel: a device is bridged, a collimator is not.
    lit = picture[:: 4 * factor, :: 4 * factor] > darkest(picture)
    if not lit.all():
        lit = ndimage.binary_closing(np.pad(lit, 4, mode="edge"), iterations=4)[4:-4, 4:-4]
    if field_of_view is not None:
        field_of_view = check_array(field_of_view, "field of view", (None, 2))
        row, column = 4 * factor * np.indices(lit.shape)
        places = np.stack([column, row], axis=-1).reshape(-1, 2)
        lit &= in_polygon(places, field_of_view).reshape(lit.shape)
    margin = np.full(lit.shape, 1e6) if lit.all() else ndimage.distance_transform_edt(lit)
    width = WIDEST * side / SEARCH_SIDE if width_px is None else width_px
    return View(picture, factor, margin.astype(np.float32), float(width), field_of_view)


def candidates(view: View, near: Floats | None = None, radius: float = 0.0) -> list[Candidate]:
    """Lines of a picture that may be the device, the likeliest first.

    Parameters
    ----------
    view : View
    near : (n, 2) array, optional
        A line, px of the whole picture, about which to look.
    radius : float
        Of the device, px, where it is known: it tells how coarse a search will do.
    """
    factor = view.factor
    scales: tuple[tuple[float, float], ...] = SCALES
    if radius:
        factor, scales = max(1, int(radius / NARROW)), SCALES[:1]
        if radius / factor > SCALES[0][1] - 1:
            scales = SCALES[1:2]
    else:
        width = view.greatest_width / factor
        scales = tuple(scale for scale in SCALES if scale[1] < width + 1) or SCALES[:1]
    rows, columns = (length // factor for length in view.picture.shape)
    window, field = (slice(0, rows), slice(0, columns)), None
    if near is not None:
        window, field = _band(near / factor, BAND * view.factor / factor, (rows, columns))
    whole = tuple(slice(part.start * factor, part.stop * factor) for part in window)
    coarse = log_light(binned(view.picture[whole], factor), darkest(view.picture))
    if view.margin.min() < 1e3:
        row = np.minimum(np.arange(rows) * factor // (4 * view.factor), view.margin.shape[0] - 1)
        column = np.arange(columns) * factor // (4 * view.factor)
        column = np.minimum(column, view.margin.shape[1] - 1)
        lit = view.margin[row[window[0]]][:, column[window[1]]] >= 1.5
        field = lit if field is None else field & lit
    origin = np.array([window[1].start, window[0].start])
    found = [
        _candidate(view, chain, (chain.points + origin + 0.5) * factor - 0.5)
        for chain in find_chains(find_ridges(coarse, scales), field)[:40]
    ]
    return sorted((one for one in found if one is not None), key=lambda one: -one.likely)


def fit(view: View, candidate: Candidate, blur: float | None = None) -> Tube | None:
    """Fit a tube to the picture along a candidate."""
    return fit_tube(
        view.picture,
        candidate.points,
        enters=candidate.enters,
        greatest_width=view.greatest_width,
        blur=blur,
    )


def fill(view: View, tube: Tube | None) -> Mask:
    """Mask of a tube, its pixels within the picture, folded ends included; empty without one."""
    rows, columns = view.picture.shape
    if tube is None:
        return np.zeros((rows, columns), dtype=bool)
    mask = draw(tube, (rows, columns))
    for end in (0, -1):
        sharpen_end(mask, view.picture, tube, end)
    return mask


def within(view: View, mask: Mask) -> Mask:
    """Take out, in place, what lies beyond the field of a view."""
    rows, columns = view.picture.shape
    if view.field_of_view is None and view.margin.min() < 1:
        lit = np.kron(view.margin >= 1, np.ones((4 * view.factor,) * 2, dtype=bool))
        mask &= lit[:rows, :columns]
    if view.field_of_view is not None:
        row, column = np.nonzero(mask)
        mask[row, column] = in_polygon(np.column_stack([column, row]), view.field_of_view)
    return mask


def _candidate(view: View, chain: Chain, points: Floats) -> Candidate | None:
    """Judge a line; None where it can be no device."""
    side = max(view.picture.shape)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    enters = view.distance_to_border(points[[0, -1]]) < AT_BORDER * view.factor
    # A device comes from outside. One that does not must be long to be believed.
    if length < (side / 12 if enters.any() else side / 6):
        return None
    if chain.variation > MOST_VARIATION:
        return None
    even = 1 - chain.variation / (2 * MOST_VARIATION)
    likely = chain.typical * length * even * (0.4, 1.0, 0.5)[int(enters.sum())]
    return Candidate(points, (bool(enters[0]), bool(enters[1])), chain.typical, likely)


def _band(line: Floats, band: float, shape: tuple[int, ...]) -> tuple[tuple[slice, slice], Mask]:
    """Window about a line, with a margin, and its pixels within a band about it."""
    size = np.array(shape[::-1])
    low = np.clip(np.floor(line.min(axis=0) - band - 8).astype(int), 0, size - 1)
    high = np.clip(np.ceil(line.max(axis=0) + band + 9).astype(int), low + 1, size)
    near = np.zeros(high[::-1] - low[::-1], dtype=bool)
    at = np.rint(line - low).astype(int)
    at = at[np.all((at >= 0) & (at < high - low), axis=1)]
    near[at[:, 1], at[:, 0]] = True
    near = ndimage.maximum_filter(near, 2 * round(band) + 1)
    return (slice(low[1], high[1]), slice(low[0], high[0])), near
