"""What a whole run spans: so that eye and colors stay the same from frame to frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from stereosom.arrays import Floats

from ..centerline import Centerline
from .device import shape_of, tube
from .look import extent

# Of each curve so many points are kept: memory stays small however long the run.
_KEPT = 25
# Doubt may be wider than the device is long; the pictures make way for so much of it.
_MOST_REACH = 0.3


@dataclass(frozen=True, eq=False)
class Survey:
    """Where the curves of a run lie, and between which values their colors run.

    Parameters
    ----------
    points : (n, 3) array
        Some of every curve, mm.
    surface : (m, 3) array
        Some of every tube, mm.
    reach : float
        How far from a curve the device may be, within two standard deviations, mm; no more
        than a share of the curves' extent.
    color_by : str, optional
        A key of `COLOR_BY`; None leaves the device plain.
    limits : (float, float)
        Values at both ends of the color bar.
    """

    points: Floats
    surface: Floats
    reach: float
    color_by: str | None
    limits: tuple[float, float]


def survey(lines: Iterable[Centerline], color_by: str | None = None) -> Survey:
    """Look through the curves of a run once, one at a time.

    Parameters
    ----------
    lines : iterable of Centerline
        At least one.
    color_by : {'Curvature', 'StandardDeviation', 'Time'}, optional
        Default: curvature where the first file holds it.

    Raises
    ------
    InputError
        Where a curve does not hold what it shall be colored by.
    """
    points: list[Floats] = []
    surface: list[Floats] = []
    values: list[Floats] = []
    reach = 0.0
    for line in lines:
        if color_by is None and not points and "Curvature" in line.arrays:
            color_by = "Curvature"
        shape = shape_of(line, color_by)
        kept = np.linspace(0, len(shape.points) - 1, _KEPT).astype(int)
        points.append(shape.points[kept])
        rings = np.asarray(tube(shape).points).reshape(len(shape.points), -1, 3)
        surface.append(rings[kept, :: rings.shape[1] // 4].reshape(-1, 3))
        widest = 0.0 if shape.spread is None else np.linalg.eigvalsh(shape.spread).max()
        reach = max(reach, float(shape.radius.max() + 2 * np.sqrt(max(widest, 0.0))))
        if shape.values is not None:
            values.append(shape.values[kept][shape.determined[kept]])
    found = np.concatenate(values) if values else np.empty(0)
    spanned = np.vstack(points)
    return Survey(
        spanned,
        np.vstack(surface),
        min(reach, _MOST_REACH * extent(spanned)),
        color_by,
        _limits(found[np.isfinite(found)], color_by),
    )


def _limits(values: Floats, color_by: str | None) -> tuple[float, float]:
    if not len(values):
        return (0.0, 1.0)
    if color_by == "Time":
        low, high = float(values.min()), float(values.max())
        return (low, high) if high > low else (low - 0.5, low + 0.5)
    # Both others begin at zero. A single sharp place, at an end perhaps, must not take all
    # the colors.
    high = float(np.percentile(values, 97))
    return (0.0, high if high > 0 else 1.0)
