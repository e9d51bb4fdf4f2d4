"""The edges of a mask, and where on a tube's outline each of them belongs."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.spatial import cKDTree

from ...arrays import Booleans, Floats, Integers
from .outline import outline, pieces

# An edge belongs to a point of the outline only where their directions agree: cosine.
AGREEING = 0.5
# Along the outline it may lie this much farther than the next point, px.
ALONG_PX = 3.0
# A direction that is off counts as a distance by the device's half width, within these, px.
NARROWEST_PX, WIDEST_PX = 2.0, 40.0
# An edge and its place may differ in direction like so many half widths in place.
TURNED = 0.75
# Without a gate, edges are looked for this near, px; an edge cannot be told better than to
# LEAST_SPREAD, and is no part that is farther off than this, in spreads and in px.
NEAR_PX, LEAST_SPREAD, SPREADS, FARTHEST = 5.0, 0.5, 4.0, 2.0
# What lies so much deeper than a rim within a tube is covered by it, px.
COVERED_PX = 1.5
# An edge lies about an end that is no farther off than so many half widths.
ABOUT = 2.0


def match(
    picture: Floats,
    normals: Floats,
    bend: Floats,
    samples: int,
    points: Floats,
    directions: Floats,
    turning: float,
    reach: float,
) -> tuple[Integers, Floats]:
    """Find for each edge point the point of the outline that it belongs to, and its residual.

    It is the nearest in place and direction: a direction that is off by an angle α counts like
    a distance of 2 sin(α/2) times `turning`, px.

    Parameters
    ----------
    picture, normals, bend
        As from `outline`.
    samples : int
    points, directions : (m, 2) arrays
        Of a contour, px, and unit vectors outward.
    turning : float
    reach : float
        No partner is farther, px.

    Returns
    -------
    (m,) array of int
        Number of the point of the outline; −1 where there is none.
    (m,) array
        How far the edge lies outside of the outline, px.
    """
    tree = cKDTree(np.hstack([picture, turning * normals]))
    _, found = tree.query(np.hstack([points, turning * directions]), distance_upper_bound=reach)
    nearest = np.where(found < len(picture), found, -1).astype(np.int64)
    offset = points - picture[nearest]
    normal = normals[nearest]
    along = normal[:, 0] * offset[:, 1] - normal[:, 1] * offset[:, 0]
    outside = np.sum(offset * normal, axis=1) + 0.5 * bend[nearest] * along**2
    agrees = np.sum(directions * normal, axis=1) > AGREEING
    agrees &= np.abs(along) < _spacing(picture, samples)[nearest] + ALONG_PX
    nearest[~agrees] = -1
    return nearest, np.where(nearest >= 0, outside, 0.0)


def look(
    projection: Floats,
    center: Floats,
    curve: Floats,
    tangents: Floats,
    radius: float,
    capped: Integers,
    points: Floats,
    directions: Floats,
    gate: float,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
    """Outline of a tube, and the sums over the edges that belong to each of its points.

    Parameters
    ----------
    projection, center, curve, tangents, radius, capped
        As of `outline`.
    points, directions
        As of `match`.
    gate : float
        As of `Look.at`; zero for none.

    Returns
    -------
    picture, normals, pull, turn, grow, weight, total, squares : arrays
        As in `Look`.
    (3, 4) array
        Sums of weight, total and squares over both rims, the base and the tip.
    (9,) array
        Noise, share of stray edges and half width, as in `Look`; number of points of the outline
        that edges belong to; the sum of squared weighted residuals over that of weights, px²;
        number of stray edges about the base, and about the tip; how far either end points along
        the ray that sees it, as a cosine.

    Raises
    ------
    ValueError
        Where the tube runs behind the camera.
    """
    if np.min(curve @ projection[2, :3] + projection[2, 3]) <= 2 * radius:
        raise ValueError("the tube runs behind the camera")
    picture, normals, pull, turn, grow, bend = outline(
        projection, center, curve, tangents, radius, capped
    )
    half_width = radius * float(np.median(grow[: 2 * len(curve)]))
    turning = min(max(half_width, NARROWEST_PX), WIDEST_PX)
    reach = (gate if gate > 0 else NEAR_PX) + TURNED * turning
    nearest, residual = match(
        picture, normals, bend, len(curve), points, directions, turning, reach
    )
    found = nearest >= 0
    spread, limit = 0.0, gate
    if gate <= 0 and found.any():
        spread = max(LEAST_SPREAD, 1.4826 * float(np.median(np.abs(residual[found]))))
        limit = max(FARTHEST, SPREADS * spread)
    kept = found & (np.abs(residual) < limit)
    left, right, _, _ = pieces(len(curve))
    ends = (picture[left][[0, -1]] + picture[right][[0, -1]]) / 2
    away = np.linalg.norm(points[~kept][:, None] - ends, axis=2)
    about_base, about_tip = np.count_nonzero(away < ABOUT * half_width, axis=0)
    nearest, residual = nearest[kept], residual[kept]
    far = (residual / (2 * spread)) ** 2 if spread > 0 else np.zeros(len(residual))
    weight = 1 / (1 + far)
    # P. J. Huber, "Robust Statistics", 1981, section 7.6: E ψ² / (E ψ')², where ψ is the
    # weighted residual; times the mean weight, because it is divided by their sum.
    noise = alone = 0.0
    if len(residual):
        alone = float(np.sum((weight * residual) ** 2) / weight.sum())
        holding = max(float(np.mean((1 - far) * weight**2)), 0.1)
        noise = float(np.mean((weight * residual) ** 2)) * float(weight.mean()) / holding**2
    sums = [
        np.asarray(np.bincount(nearest, summand, len(picture)), dtype=np.float64)
        for summand in (weight, weight * residual, weight * residual**2)
    ]
    starts = [piece.start for piece in pieces(len(curve))]
    rays = curve[[0, -1]] - center
    slant = np.sum(rays * tangents[[0, -1]], axis=1) / np.linalg.norm(rays, axis=1)
    return (
        picture, normals, pull, turn, grow, sums[0], sums[1], sums[2],
        np.add.reduceat(sums, starts, axis=1),
        np.array([
            noise, 1 - len(residual) / max(len(points), 1), half_width, np.count_nonzero(sums[0]),
            alone, about_base, about_tip, *np.abs(slant),
        ]),
    )  # fmt: skip


def rims_seen(weight: Floats, squares: Floats, samples: int, tolerance: float) -> Booleans:
    """Whether edges are at each sample's left and right rim, or at one of the two next to it.

    Parameters
    ----------
    weight, squares
        As in `Look`.
    samples : int
    tolerance : float
        RMS residual up to which edges are the rim's, px.

    Returns
    -------
    (2, n) array of bool
    """
    rms = np.sqrt(squares / np.maximum(weight, 1e-12))
    seen = (weight > 0) & (rms < tolerance)
    left, right, _, _ = pieces(samples)
    return np.asarray(maximum_filter1d(np.stack([seen[left], seen[right]]), 5, axis=1))


def middle_offset(weight: Floats, total: Floats, samples: int) -> float:
    """RMS of how far the middle between both rims lies beside the curve, px; 0 where none is seen.

    Parameters
    ----------
    weight, total
        As in `Look`.
    samples : int
        Of the curve.
    """
    left, right, _, _ = pieces(samples)
    both = (weight[left] > 0) & (weight[right] > 0)
    mean = total / np.maximum(weight, 1e-12)
    offsets = (mean[left] - mean[right])[both] / 2
    return float(np.sqrt(np.mean(offsets**2))) if len(offsets) else 0.0


def unseen(picture: Floats, seen: Booleans, capped: Integers) -> tuple[float, float]:
    """Length of the rims that show no edges, px; where the tube goes on, from the first on.

    Parameters
    ----------
    picture
        As from `outline`.
    seen : (2, n) array of bool
        As from `rims_seen`.
    capped : (2,) array of int
        As of `outline`.

    Returns
    -------
    float
    float
        The same without what the tube itself covers, where no mask has an edge.
    """
    left, right, _, _ = pieces(seen.shape[1])
    length = bare = 0.0
    for rim, shown in zip((left, right), seen, strict=True):
        spacing = np.linalg.norm(np.gradient(picture[rim], axis=0), axis=1)
        found = np.flatnonzero(shown)
        start = 0 if capped[0] or len(found) == 0 else found[0]
        stop = None if capped[1] or len(found) == 0 else found[-1]
        missing = np.zeros(len(shown), dtype=bool)
        missing[start:stop] = ~shown[start:stop]
        length += float(np.sum(spacing[missing]))
        missing[missing] = ~_within(picture[rim][missing], picture[left], picture[right])
        bare += float(np.sum(spacing[missing]))
    return length, bare


def _within(points: Floats, left: Floats, right: Floats) -> Booleans:
    """Which points (k, 2) a tube of such rims, (n, 2) each, covers."""
    middle, half_width = (left + right) / 2, np.linalg.norm(left - right, axis=1) / 2
    away = np.linalg.norm(points[:, None] - middle, axis=2)
    return np.asarray(np.any(away < half_width - COVERED_PX, axis=1))


def _spacing(picture: Floats, samples: int) -> Floats:
    """Distance from each point of the outline to the farther of its neighbors, px."""
    spacing = np.zeros(len(picture))
    for piece in pieces(samples):
        steps = np.linalg.norm(np.diff(picture[piece], axis=0), axis=1)
        spacing[piece] = np.maximum(np.append(steps, 0.0), np.append(0.0, steps))
    return spacing
