"""The picture that a round, flat-ended tube makes in one view."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from ...arrays import Floats, Integers

CAP_POINTS = 24
# What a tube may do at its base, and at its tip: go on, end flat, or end in half a ball.
OPEN, FLAT, ROUND = 0, 1, 2
# Where there is no flat end its points are put, so that nothing is near them, px.
NOWHERE = 1e9
# No outline bends more than this, 1/px; where its points coincide its curvature is not known.
SHARPEST = 0.5


def outline(
    projection: Floats,
    center: Floats,
    curve: Floats,
    tangents: Floats,
    radius: float,
    capped: Integers,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """Outline of a round tube in one view.

    A surface point c + R n, n across the curve, is on a rim where the ray that meets it touches
    the tube: n·(c + R n − o) = 0 for the camera centre o. With the part v of c − o across the
    curve, n·v = −R leaves one n on either side. The tangent plane there holds the ray, so the
    picture moves only with the part of a shift along n. A flat end is a disc; its picture is
    an ellipse, of which the half beyond the rims belongs to the outline. A rounded end is half a
    ball about the end of the curve: its outline, too, has n·(c − o) = −R, with n anywhere on
    the side where the tube ends.

    Parameters
    ----------
    projection : (3, 4) array
    center : (3,) array
    curve, tangents : (n, 3) arrays
        From base to tip, mm; unit tangents.
    radius : float
        mm.
    capped : (2,) array of int
        What the tube does at its base and at its tip: `OPEN`, `FLAT` or `ROUND`.

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
    for end, outward, kind in ((0, -1.0, capped[0]), (len(curve) - 1, 1.0, capped[1])):
        share = np.arange(1, CAP_POINTS + 1)[:, None] / (CAP_POINTS + 1)
        caps.append(slice(len(curve) * 2 + len(caps) * CAP_POINTS, None))
        if kind == ROUND:
            ray, far = seen_from[end], float(np.linalg.norm(seen_from[end]))
            onward = outward * (tangents[end] - (tangents[end] @ ray) / far**2 * ray)
            onward /= max(float(np.linalg.norm(onward)), 1e-12)
            around, turning = np.cos(np.pi * share), np.sin(np.pi * share)
            nearer = min(radius / far, 1.0)
            limb = around * beside[end] + turning * onward
            surface_normals.append(np.sqrt(1 - nearer**2) * limb - nearer / far * ray)
            along.append(around * onward - turning * beside[end])
            continue
        # The half that lies ahead in the picture: over the side towards the camera or not.
        _, jacobian = _project(projection, curve[end : end + 1])
        ahead = outward * (jacobian[0] @ tangents[end]) @ (jacobian[0] @ toward[end])
        begin = float(np.arctan2(sine[end, 0], cosine[end, 0]))
        stop = -begin if ahead > 0 else 2 * np.pi - begin
        angle = begin + share * (stop - begin)
        surface_normals.append(np.cos(angle) * toward[end] + np.sin(angle) * beside[end])
        along.append(np.cos(angle) * beside[end] - np.sin(angle) * toward[end])
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
    for cap, kind in zip(pieces(n)[2:], capped, strict=True):
        if kind != ROUND:
            lever = -radius * np.sum(pull[cap] * tangents[owner[cap]], axis=1)
            turn[cap] = lever[:, None] * normal[cap]
    bend = np.zeros(len(picture))
    for piece in pieces(n):
        bend[piece] = _bend(picture[piece], normals[piece])
    for cap, kind in zip(caps, capped, strict=True):
        if kind == OPEN:
            picture[cap] = NOWHERE
    return picture, normals, pull, turn, grow, bend


def owners(samples: int) -> Integers:
    """Sample of the curve that each point of an outline belongs to."""
    every = np.arange(samples)
    return np.concatenate([every, every, np.full(CAP_POINTS, 0), np.full(CAP_POINTS, samples - 1)])


@cache
def pieces(samples: int) -> tuple[slice, slice, slice, slice]:
    """Both rims and both flat ends among the points of an outline."""
    stops = [0, samples, 2 * samples, 2 * samples + CAP_POINTS, 2 * samples + 2 * CAP_POINTS]
    left, right, base, tip = (slice(a, b) for a, b in pairwise(stops))
    return left, right, base, tip


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
