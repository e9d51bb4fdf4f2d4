"""What one view says of a tube, in the plainest numpy: `compiled` must give the same, faster.

An outline is kept as arrays, a row for each of its points: first the left rim, a point for each
of the n samples of the curve, then the right rim, then `CAP_POINTS` around the base's flat end
and as many around the tip's.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.spatial import cKDTree

from ..arrays import Booleans, Floats, Integers

CAP_POINTS = 24
# Where there is no flat end its points are put, so that nothing is near them, px.
NOWHERE = 1e9
# An edge belongs to a point of the outline only where their directions agree: cosine.
AGREEING = 0.5
# Along the outline it may lie this much farther than the next point, px.
ALONG_PX = 3.0
# No outline bends more than this, 1/px; where its points coincide its curvature is not known.
SHARPEST = 0.5
# A direction that is off counts as a distance by the device's half width, within these, px.
NARROWEST_PX, WIDEST_PX = 2.0, 40.0
# An edge and its place may differ in direction like so many half widths in place.
TURNED = 0.75
# Without a gate, edges are looked for this near, px; an edge cannot be told better than to
# LEAST_SPREAD, and is no part that is farther off than this, in spreads and in px.
NEAR_PX, LEAST_SPREAD, SPREADS, FARTHEST = 5.0, 0.5, 4.0, 2.0
# Of the rounding to pixels: higher ones are small.
HARMONICS = 3
# The outward direction of a mask's edge is read off the pixels around it, within this distance.
_AROUND_PX = 3
MARGIN = _AROUND_PX + 2
AROUND = np.array(
    [
        (x, y)
        for y in range(-_AROUND_PX, _AROUND_PX + 1)
        for x in range(-_AROUND_PX, _AROUND_PX + 1)
        if 0 < x**2 + y**2 <= _AROUND_PX**2
    ]
)


def outline(
    projection: Floats,
    center: Floats,
    curve: Floats,
    tangents: Floats,
    radius: float,
    capped: Booleans,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Outline of a round, flat-ended tube in one view.

    A surface point c + R n, n across the curve, is on a rim where the ray that meets it touches
    the tube: n·(c + R n − o) = 0 for the camera centre o. With the part v of c − o across the
    curve, n·v = −R leaves one n on either side. The tangent plane there holds the ray, so the
    picture moves only with the part of a shift along n. A flat end is a disc; its picture is
    an ellipse, of which the half beyond the rims belongs to the outline.

    Parameters
    ----------
    projection : (3, 4) array
    center : (3,) array
    curve, tangents : (n, 3) arrays
        From base to tip, mm; unit tangents.
    radius : float
        mm.
    capped : (2,) array of bool
        Whether the base and the tip are ends, or the tube goes on there.

    Returns
    -------
    picture, normals : (k, 2) arrays
        Points of the outline, px, and unit vectors outward.
    pull : (k, 3) array
        How the outline moves outward there with the curve, px/mm.
    turn : (k, 3) array
        The same with the curve's direction, px; zero on the rims.
    grow : (k,) array
        The same with the radius, px/mm.
    bend : (k,) array
        Curvature of the outline, 1/px, positive where it is convex.
    """
    seen_from = curve - center
    across = seen_from - np.sum(seen_from * tangents, axis=1, keepdims=True) * tangents
    distance = np.linalg.norm(across, axis=1, keepdims=True)
    toward = -across / np.maximum(distance, 1e-12)
    beside = np.cross(tangents, toward)
    cosine = np.clip(radius / np.maximum(distance, 1e-12), 0.0, 1.0)
    sine = np.sqrt(1 - cosine**2)

    surface_normals, along = [], []
    for side in (1.0, -1.0):
        normal = cosine * toward + side * sine * beside
        ray = curve + radius * normal - center
        surface_normals.append(normal)
        along.append(np.cross(normal, ray))
    caps: list[slice] = []
    for end, outward in ((0, -1.0), (len(curve) - 1, 1.0)):
        # The half that lies ahead in the picture: over the side towards the camera or not.
        _, jacobian = _project(projection, curve[end : end + 1])
        ahead = outward * (jacobian[0] @ tangents[end]) @ (jacobian[0] @ toward[end])
        begin = float(np.arctan2(sine[end, 0], cosine[end, 0]))
        stop = -begin if ahead > 0 else 2 * np.pi - begin
        share = np.arange(1, CAP_POINTS + 1) / (CAP_POINTS + 1)
        angle = (begin + share * (stop - begin))[:, None]
        surface_normals.append(np.cos(angle) * toward[end] + np.sin(angle) * beside[end])
        along.append(np.cos(angle) * beside[end] - np.sin(angle) * toward[end])
        caps.append(slice(len(curve) * 2 + len(caps) * CAP_POINTS, None))
    caps[0] = slice(caps[0].start, caps[1].start)

    n = len(curve)
    owner = owners(n)
    normal = np.vstack(surface_normals)
    picture, jacobian = _project(projection, curve[owner] + radius * normal)
    direction = np.einsum("kij,kj->ki", jacobian, np.vstack(along))
    normals = np.column_stack([direction[:, 1], -direction[:, 0]])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    outward = np.einsum("kij,kj->ki", jacobian, normal)
    for cap, sign in zip(caps, (-1.0, 1.0), strict=True):
        end = owner[cap.start]
        ahead = sign * (jacobian[cap] @ tangents[end])
        # Of a disc seen edge-on nothing shows but a line: there, outward is ahead.
        outward[cap] = outward[cap] + ahead
    normals *= np.where(np.sum(normals * outward, axis=1) < 0, -1.0, 1.0)[:, None]

    pull = np.einsum("kij,ki->kj", jacobian, normals)
    grow = np.sum(pull * normal, axis=1)
    turn = np.zeros_like(pull)
    turn[2 * n :] = (
        -radius * np.sum(pull * tangents[owner], axis=1)[2 * n :, None] * normal[2 * n :]
    )
    bend = np.zeros(len(picture))
    for piece in pieces(n):
        bend[piece] = _bend(picture[piece], normals[piece])
    for cap, present in zip(caps, capped, strict=True):
        if not present:
            picture[cap] = NOWHERE
    return picture, normals, pull, turn, grow, bend


def contour(pixels: Floats) -> tuple[Floats, Floats]:
    """Edge points of a mask, and the outward directions there; see `mask_contour`.

    Parameters
    ----------
    pixels : (n, 2) array

    Returns
    -------
    (m, 2) array, px; (m, 2) array of unit vectors
    """
    corner = np.floor(pixels.min(axis=0)) - MARGIN
    cells = np.rint(pixels - corner).astype(np.int64)
    width, height = cells.max(axis=0) + MARGIN + 1
    inside = np.zeros(width * height, dtype=np.uint8)
    at = np.unique(cells[:, 1] * width + cells[:, 0])  # in one order, whatever theirs is
    inside[at] = 1
    points, directions = [], []
    for step, across in (
        (1, (0.5, 0.0)),
        (-1, (-0.5, 0.0)),
        (width, (0.0, 0.5)),
        (-width, (0.0, -0.5)),
    ):
        edge = inside[at + step] == 0
        points.append(np.column_stack([at[edge] % width, at[edge] // width]) + across)
        away = np.zeros((int(edge.sum()), 2))
        for x, y in AROUND:
            beside = inside[at[edge] + y * width + x].astype(float)
            beside += inside[at[edge] + step + y * width + x]
            away -= beside[:, None] * (float(x), float(y))
        # Of a line of single pixels both sides look alike: then outward is away from the pixel.
        directions.append(away + np.multiply(across, 0.5))
    direction = np.vstack(directions)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
    return np.vstack(points) + corner, direction


def owners(samples: int) -> Integers:
    """Sample of the curve that each point of an outline belongs to."""
    every = np.arange(samples)
    return np.concatenate([every, every, np.full(CAP_POINTS, 0), np.full(CAP_POINTS, samples - 1)])


def pieces(samples: int) -> tuple[slice, slice, slice, slice]:
    """Both rims and both flat ends among the points of an outline."""
    stops = [0, samples, 2 * samples, 2 * samples + CAP_POINTS, 2 * samples + 2 * CAP_POINTS]
    left, right, base, tip = (slice(a, b) for a, b in pairwise(stops))
    return left, right, base, tip


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
    capped: Booleans,
    points: Floats,
    directions: Floats,
    gate: float,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
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
    (3,) array
        Noise, share of stray edges and half width, as in `Look`.
    """
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
    nearest, residual = nearest[found], residual[found]
    spread, limit = 0.0, gate
    if gate <= 0 and len(residual):
        spread = max(LEAST_SPREAD, 1.4826 * float(np.median(np.abs(residual))))
        limit = max(FARTHEST, SPREADS * spread)
    kept = np.abs(residual) < limit
    nearest, residual = nearest[kept], residual[kept]
    far = (residual / (2 * spread)) ** 2 if spread > 0 else np.zeros(len(residual))
    weight = 1 / (1 + far)
    # P. J. Huber, "Robust Statistics", 1981, section 7.6: E ψ² / (E ψ')², where ψ is the
    # weighted residual; times the mean weight, because it is divided by their sum.
    noise = 0.0
    if len(residual):
        holding = max(float(np.mean((1 - far) * weight**2)), 0.1)
        noise = float(np.mean((weight * residual) ** 2)) * float(weight.mean()) / holding**2
    sums = [
        np.asarray(np.bincount(nearest, summand, len(picture)), dtype=np.float64)
        for summand in (weight, weight * residual, weight * residual**2)
    ]
    return (
        picture, normals, pull, turn, grow, sums[0], sums[1], sums[2],
        np.array([noise, 1 - len(residual) / max(len(points), 1), half_width]),
    )  # fmt: skip


def sliding(values: Floats, first: Integers, tangents: Floats) -> Floats:
    """Normal matrix (3m, 3m) of shifts of the samples along the curve.

    Parameters
    ----------
    values, first
        As of `SplineBasis`.
    tangents : (n, 3) array
    """
    rows = (values[:, :, None] * tangents[:, None, :]).reshape(len(tangents), -1)
    return np.asarray(rows.T @ rows)


def rounding(
    picture: Floats, normals: Floats, weight: Floats, samples: int, together: int
) -> Floats:
    """Variance that an edge shares with its neighbors, times their number, at each point, px².

    Pixels tell an edge that runs along them no better than to one of them, however many they
    are: the rounding is the same for all. It is a sawtooth of the edge's place x, in px; over
    all places of the grid, its mean over a stretch has the variance Σ |⟨exp 2πihx⟩|² / 2π²h²
    (its Fourier series): 1/12 where x stays, nothing where it runs through whole pixels.

    Parameters
    ----------
    picture, normals, weight
        As in `Look`.
    samples : int
        Of the curve.
    together : int
        So many neighboring points are told apart by nothing.

    Returns
    -------
    (k,) array
    """
    shared = np.zeros(len(weight))
    for number, piece in enumerate(pieces(samples)):
        place, edges = picture[piece], weight[piece]
        step = np.gradient(place, axis=0)
        variance = np.zeros(len(place))
        for axis in (0, 1):
            of_axis = np.zeros(len(place))
            for h in range(1, HARMONICS + 1):
                # Between two points of the outline it runs on.
                phase = np.exp(2j * np.pi * h * place[:, axis]) * np.sinc(h * step[:, axis])
                if number < 2:
                    mean = gaussian_filter1d(phase, together / 2.5, mode="nearest")
                else:
                    crossed = edges * np.abs(normals[piece, axis])
                    mean = np.sum(crossed * phase) / max(float(crossed.sum()), 1e-9)
                of_axis += np.abs(mean) ** 2 / (2 * np.pi**2 * h**2)
            variance = np.maximum(variance, of_axis)
        if number < 2:
            count = uniform_filter1d(edges, together, mode="nearest") * together
        else:
            count = np.full(len(edges), float(edges.sum()))
        shared[piece] = variance * count
    return shared


def assemble(
    values: Floats,
    slopes: Floats,
    first: Integers,
    speed: Floats,
    pull: Floats,
    turn: Floats,
    grow: Floats,
    weight: Floats,
    total: Floats,
) -> tuple[Floats, Floats]:
    """Normal equations for the shifts of the m control points and of the radius.

    Parameters
    ----------
    values, slopes, first
        As of `SplineBasis`.
    speed : (n,) array
        Length of the curve's derivative by its parameter at the samples, mm.
    pull, turn, grow
        As from `outline`.
    weight, total : (k,) arrays
        Sum of the weights of the edge points that belong to each point of the outline, and of
        their residuals times weight.

    Returns
    -------
    (3m + 1, 3m + 1) array, (3m + 1,) array
        Coordinates of each control point together; the radius last.
    """
    owner = owners(len(values))
    rows = values[owner][:, :, None] * pull[:, None, :]
    rows = rows + (slopes[owner] / speed[owner, None])[:, :, None] * turn[:, None, :]
    rows = np.column_stack([rows.reshape(len(owner), -1), grow])
    return rows.T @ (weight[:, None] * rows), rows.T @ total


def along(values: Floats, first: Integers, covariance: Floats) -> Floats:
    """Covariance (n, 3, 3) of the samples, from that of the control points, (3m, 3m).

    Parameters
    ----------
    values, first
        As of `SplineBasis`.
    covariance : (3m, 3m) array
    """
    n, m = values.shape
    half = (values @ covariance.reshape(m, -1)).reshape(n, 3, m, 3)
    found = np.einsum("nimj,nm->nij", half, values)
    return np.asarray((found + found.transpose(0, 2, 1)) / 2)


def _project(projection: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Pixels (k, 2) and their derivatives (k, 2, 3) by the point, px/mm."""
    homogeneous = points @ projection[:, :3].T + projection[:, 3]
    pixels = homogeneous[:, :2] / homogeneous[:, 2:]
    jacobian = projection[:2, :3] - pixels[:, :, None] * projection[2, :3]
    return pixels, jacobian / homogeneous[:, 2:, None]


def _bend(picture: Floats, normals: Floats) -> Floats:
    """Curvature of a piece of the outline: how its normal turns along it."""
    step = np.empty_like(picture)
    turned = np.empty_like(picture)
    for gained, held in ((step, picture), (turned, normals)):
        gained[1:-1] = held[2:] - held[:-2]
        gained[0], gained[-1] = held[1] - held[0], held[-1] - held[-2]
    length = np.maximum(np.sum(step**2, axis=1), 1e-12)
    return np.asarray(np.clip(np.sum(turned * step, axis=1) / length, -SHARPEST, SHARPEST))


def _spacing(picture: Floats, samples: int) -> Floats:
    """Distance from each point of the outline to the farther of its neighbors, px."""
    spacing = np.zeros(len(picture))
    for piece in pieces(samples):
        steps = np.linalg.norm(np.diff(picture[piece], axis=0), axis=1)
        spacing[piece] = np.maximum(np.append(steps, 0.0), np.append(0.0, steps))
    return spacing
