"""From how much each pixel looks like the device to a mask of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from stereosom_plugin.errors import require

from ..picture import Mask
from .frame import Light, over_colors

# Gaps between pieces of one device, as a share of the picture's longer side.
WIDEST_GAP = 0.035
# Pieces smaller than this share of the largest are specks.
SMALLEST = 0.02
# A highlight is at least so bright in every color.
HIGHLIGHT = 0.92
_SQUARE = np.ones((3, 3), dtype=bool)


def device_pixels(likeness: Light, low: float, high: float, width: int) -> Mask:
    """The pixels of the device: edges where its likeness has fallen to half.

    Parameters
    ----------
    likeness : (rows, columns) array
    low, high : float
        What the device has at least: anywhere, and somewhere in each of its pieces.
    width : int
        Its greatest width, px.

    Returns
    -------
    (rows, columns) array of bool
        Pieces that are near to each other, of all such groups the longest.
    """
    found = require("skimage.filters", "endoscopy").apply_hysteresis_threshold(likeness, low, high)
    if not found.any():
        return np.asarray(found, dtype=bool)
    typical = float(np.median(likeness[found & (likeness > high)]))
    bounded = np.minimum(likeness, typical)
    found &= bounded >= 0.5 * ndimage.maximum_filter(bounded, size=2 * (width // 2) + 1)
    return longest_group(found)


def longest_group(mask: Mask) -> Mask:
    """The longest group of pieces of a mask that are near to each other, without specks."""
    labels, count = ndimage.label(mask, _SQUARE)
    if count < 2:
        return mask
    size = np.bincount(labels.ravel(), minlength=count + 1)
    size[0] = 0
    big = np.flatnonzero(size >= max(SMALLEST * size.max(), 4))
    row, column = np.nonzero(mask & np.isin(labels, big))
    piece = np.searchsorted(big, labels[row, column])
    thinned = slice(None, None, max(1, len(row) // 20000))
    places, piece_of = np.column_stack([row, column])[thinned], piece[thinned]
    near = (
        cKDTree(places).query_pairs(WIDEST_GAP * max(mask.shape), output_type="ndarray")
        if len(places) < 6000
        else _border_pairs(places, WIDEST_GAP * max(mask.shape))
    )
    pair = piece_of[near]
    links = coo_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(len(big),) * 2)
    _, group = connected_components(links, directed=False)
    extent = [_extent(np.column_stack([row, column])[group[piece] == one])
              for one in range(group.max() + 1)]  # fmt: skip
    kept = big[group == int(np.argmax(extent))]
    return np.asarray(np.isin(labels, kept))


def with_highlights(mask: Mask, picture: Light, behind: Light, width: int) -> Mask:
    """Add what glares between pixels of the device, unless what is behind it glares as well.

    Parameters
    ----------
    mask : (rows, columns) array of bool
    picture, behind : (rows, columns, channels) array
        With the device, and what is behind it.
    width : int
        Greatest width of the device, px.
    """
    cv2 = require("cv2", "endoscopy")
    darkest, behind = (over_colors(np.minimum, each) for each in (picture, behind))
    glares = (darkest > HIGHLIGHT) & (behind <= HIGHLIGHT)
    if not glares.any():
        return mask
    reach = max(1, width // 2)
    padded = np.pad(mask, reach + 1)

    def beyond(place: Mask) -> Mask:
        """What lies farther from a place than the reach."""
        away = cv2.distanceTransform((~place).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        return np.asarray(away > reach + 1e-3)

    # Closed by a disk: by distances, which take no longer for a larger one.
    inner = (slice(reach + 1, -reach - 1),) * 2
    between = beyond(beyond(padded))[inner]
    return np.asarray(mask | (between & glares))


def _border_pairs(places: npt.NDArray[np.intp], reach: float) -> npt.NDArray[np.intp]:
    """Pairs of near places, a few for each only: of many, most lie within one piece."""
    coarse = max(1.0, reach / 4)
    _, first = np.unique(np.round(places / coarse), axis=0, return_index=True)
    pairs = cKDTree(places[first]).query_pairs(reach, output_type="ndarray")
    return np.asarray(first[pairs])


def _extent(places: npt.NDArray[np.intp]) -> float:
    """How long a thin group of pixels is, about: its spread, more for what holds more pixels."""
    return float(np.linalg.norm(np.ptp(places, axis=0))) + 1e-3 * len(places)
