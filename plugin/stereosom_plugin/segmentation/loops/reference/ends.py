"""What a free end that is seen obliquely, or along, leaves in a picture."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats


def even(points: Floats, way: Floats, spacing: float) -> tuple[Floats, float]:
    """Points (m, 2) at the middles of equal steps, no longer than a spacing, and the step.

    Parameters
    ----------
    points : (n, 2) array
    way : (n,) array
        To each of them, not decreasing, from zero.
    spacing : float
    """
    count = max(16, int(np.ceil(way[-1] / spacing)))
    step = float(way[-1]) / count
    at = (np.arange(count) + 0.5) * step
    return np.column_stack([np.interp(at, way, points[:, i]) for i in (0, 1)]), step


def shadow(
    pixels: Floats, line: Floats, radius: float, pace: float, ends: bool, face: bool
) -> Floats:
    """Chord through a tube at each of n pixels, (n,), as a share of its diameter.

    The nearest part of it counts alone.

    Parameters
    ----------
    pixels : (n, 2) array
    line : (m, 2) array
        Its axis, px.
    radius : float
        px.
    pace : float
        Length of the last piece of the axis in space, px as seen from the side.
    ends : bool
        Whether it ends there.
    face : bool
        Whether the end's face is seen.
    """
    steps = np.diff(line, axis=0)
    square = np.maximum((steps**2).sum(axis=1), 1e-12)
    offset = pixels[:, None] - line[:-1]
    along = np.clip((offset * steps).sum(axis=2) / square, 0, 1)
    distance = ((offset - along[..., None] * steps) ** 2).sum(axis=2)
    nearest = distance.argmin(axis=1)
    share = np.sqrt(np.maximum(1 - distance.min(axis=1) / radius**2, 0))
    if not ends:
        return np.asarray(share)
    shown = float(np.sqrt(square[-1]))
    x_ahead, y_ahead = steps[-1] / shown
    x, y = (pixels - line[-1]).T
    beyond = x * x_ahead + y * y_ahead
    past = (nearest == len(steps) - 1) & (beyond > -0.5)
    share = np.where(past, np.clip(0.5 - beyond, 0, 1), 1.0) * share
    if face:
        thick = max(1 - (shown / pace) ** 2, 0.02)
        away = beyond**2 / thick + (y * x_ahead - x * y_ahead) ** 2
        share = np.maximum(share, np.sqrt(np.maximum(1 - away / radius**2, 0)))
    return np.asarray(share)


def covered(
    pixels: Floats,
    body: Floats,
    line: Floats,
    radius: float,
    pace: float,
    face: bool,
    absorption: float,
    weights: Floats,
    shape: tuple[int, int],
) -> Floats:
    """Root of the light, (n,), that a body and a tail to its end leave at n pixels.

    Parameters
    ----------
    pixels : (n, 2) array
        Whole numbers.
    body : (n,) array
        Chord through it at each of them, as a share of its diameter.
    line, radius, pace, face
        The tail, as of `shadow`.
    absorption : float
        Of a whole diameter, natural logarithm.
    weights : (2 k + 1,) array
        Of the blur.
    shape : (rows, columns)
        Of the window.
    """
    share = np.maximum(body, shadow(pixels, line, radius, pace, True, face))
    column, row = pixels.T.astype(int)
    light = np.ones(shape)
    light[row, column] = np.exp(-absorption * share)
    return np.asarray(np.sqrt(smooth(light, weights)[row, column]))


def deviations(light: Floats, seen: Floats, noise: float, most: float, more: Floats) -> Floats:
    """How far light (n,) is off what was seen (n,), per noise and at most so far; and some more."""
    return np.concatenate([np.clip((light - seen) / noise, -most, most), more])


def tail(
    bend: Floats, depth: Floats, unit: float, center: Floats, rays: Floats, projection: Floats
) -> tuple[Floats, Floats]:
    """A stretch of which one view shows all but the depth: where it is seen by the other.

    Parameters
    ----------
    bend : (3,) array
        Powers of what is added to the depth, in units, over the stretch from 0 to 1.
    depth : (n,) array
        Along the rays, mm.
    unit : float
        mm.
    center : (3,) array
        Where the rays begin, mm.
    rays : (n, 3) array
        Of length one.
    projection : (3, 4) array
        Of the view that sees it, from mm to px.

    Returns
    -------
    points : (n, 2) array
        px.
    way : (n,) array
        In space, from the first of them, units.
    """
    share = np.linspace(0, 1, len(rays))
    powers = np.stack([share, share**2, share**3], axis=1)
    places = center + (depth + unit * (powers @ bend))[:, None] * rays
    seen = places @ projection[:, :3].T + projection[:, 3]
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    return seen[:, :2] / seen[:, 2:], np.append(0.0, np.cumsum(lengths)) / unit


def smooth(picture: Floats, weights: Floats) -> Floats:
    """Blur of a picture, mirrored beyond its borders, by weights (2 k + 1,) along both axes."""
    return np.asarray(ndimage.correlate1d(ndimage.correlate1d(picture, weights, 0), weights, 1))


def discs(
    centers: Floats, step: float, across: Floats, along: Floats, shape: tuple[int, int]
) -> Floats:
    """How many points of discs lie at each pixel, shared between the four about each.

    Parameters
    ----------
    centers : (n, 2) array
        px.
    step : float
        Between them in space, px as seen from the side: it tells how obliquely they are seen.
    across, along : (m,) array
        Points of a disc, px: on the diameter that is seen whole, and on that which is seen
        obliquely.
    shape : (rows, columns)
    """
    moves = np.gradient(centers, axis=0) / step
    sine = np.linalg.norm(moves, axis=1)
    ahead = moves / np.maximum(sine, 1e-6)[:, None]
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    thick = np.sqrt(1 - np.minimum(sine, 1) ** 2)[:, None] * along
    points = centers[:, None] + across[:, None] * aside[:, None]
    points += thick[..., None] * ahead[:, None]
    return heaped(points.reshape(-1, 2), shape)


def heaped(points: Floats, shape: tuple[int, int]) -> Floats:
    """How many of points (n, 2), px, lie at each pixel, shared between the four about each."""
    rows, columns = shape
    # One more on each side, where all that lies beyond is heaped.
    x = np.clip(points[:, 0] + 1, 0, columns + 1)
    y = np.clip(points[:, 1] + 1, 0, rows + 1)
    column, row = x.astype(int), y.astype(int)
    right, down = x - column, y - row
    first = row * (columns + 2) + column
    place = np.concatenate([first, first + 1, first + columns + 2, first + columns + 3])
    share = np.concatenate(
        [(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down]
    )
    heap = np.bincount(place, share, (rows + 3) * (columns + 2))
    heap = heap[: (rows + 2) * (columns + 2)].reshape(rows + 2, columns + 2)
    return np.asarray(heap[1:-1, 1:-1])


def damped_step(slopes: Floats, misfit: Floats, damping: float) -> Floats:
    """Step (4,) of Levenberg and Marquardt's, from slopes (n, 4) and a misfit (n,)."""
    normal = slopes.T @ slopes
    normal += damping * np.diag(np.diag(normal) + 1e-6)
    return np.asarray(np.linalg.solve(normal, -slopes.T @ misfit), dtype=float)


def learn_slopes(slopes: Floats, change: Floats, step: Floats) -> None:
    """Mend slopes (n, 4), in place, so that a step (4,) gives the change (n,) it gave (Broyden)."""
    slopes += np.outer(change - slopes @ step, step) / (step @ step)
