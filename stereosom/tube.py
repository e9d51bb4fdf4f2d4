"""A round tube with flat ends as a camera sees it, and the outline of a mask."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .arrays import Floats, Integers
from .camera import Camera

_CAP_POINTS = 24


@dataclass(frozen=True, eq=False)
class Outline:
    """Points of a tube's surface that make its silhouette in one view, around it.

    `points` (m, 3) in mm; `owner` (m,), the sample of the curve that each belongs to; `normals`
    (m, 3), from there outward across the curve, unit vectors.
    """

    points: Floats
    owner: Integers
    normals: Floats


def tube_outline(
    camera: Camera, curve: Floats, tangents: Floats, radius: float, capped: tuple[bool, bool]
) -> Outline:
    """Silhouette of a tube: both rims, and the outer half of each flat end.

    A surface point c + R n, n across the curve, is on the rim where the ray that meets it
    touches the tube: n·(c + R n − o) = 0 for the camera centre o. With the part v of c − o across
    the curve, n·v = −R leaves one n on either side. A flat end is a disc; its picture is an
    ellipse, of which the half beyond the rims belongs to the outline.

    Parameters
    ----------
    camera : Camera
    curve, tangents : (n, 3) arrays
        From base to tip, mm; unit tangents.
    radius : float
        mm.
    capped : (bool, bool)
        Whether the base and the tip are ends, or the tube goes on there.

    Examples
    --------
    Seen from afar, the rims of a straight tube lie a radius to its sides:

    >>> from stereosom.synthetic import converging_rig
    >>> z = np.linspace(0, 100, 5)
    >>> curve, up = np.column_stack([0 * z, 0 * z, z]), np.tile([0.0, 0, 1], (5, 1))
    >>> camera = converging_rig(60, distance=1e6).a
    >>> rims = tube_outline(camera, curve, up, 2.0, (False, False)).points
    >>> np.linalg.norm(rims[:, :2], axis=1).round(6)
    array([2., 2., 2., 2., 2., 2., 2., 2., 2., 2.])
    """
    seen_from = curve - camera.center
    across = seen_from - np.sum(seen_from * tangents, axis=1, keepdims=True) * tangents
    distance = np.linalg.norm(across, axis=1, keepdims=True)
    toward = -across / np.maximum(distance, 1e-12)
    side = np.cross(tangents, toward)
    cosine = np.clip(radius / np.maximum(distance, 1e-12), 0.0, 1.0)
    sine = np.sqrt(1 - cosine**2)
    left, right = cosine * toward + sine * side, cosine * toward - sine * side
    order = np.arange(len(curve))
    owners, normals = [order], [left]
    for end, outward in ((len(curve) - 1, 1.0), (0, -1.0)):
        if capped[0 if end == 0 else 1]:
            begin = float(np.arctan2(sine[end, 0], cosine[end, 0]))
            # The half that lies ahead in the picture: over the side towards the camera or not.
            jacobian = camera.jacobian(curve[end : end + 1])[0]
            ahead = outward * (jacobian @ tangents[end]) @ (jacobian @ toward[end])
            stop = -begin if ahead > 0 else 2 * np.pi - begin
            angle = np.linspace(begin, stop, _CAP_POINTS + 2)[1:-1, None]
            cap = np.cos(angle) * toward[end] + np.sin(angle) * side[end]
            normals.append(cap if end else cap[::-1])
            owners.append(np.full(_CAP_POINTS, end))
        if end:
            owners.append(order[::-1])
            normals.append(right[::-1])
    owner, normal = np.concatenate(owners), np.vstack(normals)
    return Outline(curve[owner] + radius * normal, owner, normal)


@dataclass(frozen=True, eq=False)
class Contour:
    """Points (m, 2) on the edge of a mask, px, and the outward directions there."""

    points: Floats
    directions: Floats


def mask_contour(pixels: Floats) -> Contour:
    """Points half-way between neighboring pixels in and out of a mask.

    Each is where the true edge crosses between two pixel centres, to half a pixel either way
    and zero on the mean. The outward direction is the descent of the blurred mask.

    Parameters
    ----------
    pixels : (n, 2) array
        Of a filled mask.
    """
    corner = np.floor(pixels.min(axis=0)) - 4
    column, row = np.rint(pixels - corner).astype(int).T
    mask = np.zeros((row.max() + 5, column.max() + 5), dtype=bool)
    mask[row, column] = True
    row, column = np.nonzero(mask[:, 1:] != mask[:, :-1])
    below, beside = np.nonzero(mask[1:] != mask[:-1])
    x = np.concatenate([column + 0.5, beside])
    y = np.concatenate([row, below + 0.5])
    blurred = ndimage.gaussian_filter(mask.astype(np.float32), 1.5)
    # Descent between pixels: differences across two pixels beside the point.
    left, right = np.floor(x).astype(int), np.ceil(x).astype(int)
    up, down = np.floor(y).astype(int), np.ceil(y).astype(int)
    wide = blurred[up, right + 1] + blurred[down, right + 1]
    wide -= blurred[up, left - 1] + blurred[down, left - 1]
    high = blurred[down + 1, left] + blurred[down + 1, right]
    high -= blurred[up - 1, left] + blurred[up - 1, right]
    descent = -np.column_stack([wide / (right - left + 2), high / (down - up + 2)]).astype(float)
    descent /= np.maximum(np.linalg.norm(descent, axis=1, keepdims=True), 1e-9)
    return Contour(np.column_stack([x, y]) + corner, descent)
