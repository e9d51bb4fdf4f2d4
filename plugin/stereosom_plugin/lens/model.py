"""`Lens`, and what its models share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from stereosom.arrays import Floats, check_array

EXACT_PX = 1e-7
MOST_STEPS = 30


class Lens(ABC):
    """What stands between an ideal camera's picture and the one that is seen."""

    def undistort(self, pixels: Any) -> Floats:
        """Pixels of the picture, (n, 2), to those of the ideal camera, (n, 2).

        Raises
        ------
        ValueError
            Where a pixel lies outside the region in which the model can be inverted.
        """
        pixels = check_array(pixels, "pixels", (None, 2))
        return _checked(self._undistorted(pixels), pixels, "undistorted")

    def distort(self, pixels: Any) -> Floats:
        """Pixels of the ideal camera, (n, 2), to those of the picture, (n, 2).

        Raises
        ------
        ValueError
            Where a pixel lies outside the region that the model describes.
        """
        pixels = check_array(pixels, "pixels", (None, 2))
        return _checked(self._distorted(pixels), pixels, "distorted")

    def undistort_where_defined(self, pixels: Any) -> Floats:
        """As `undistort`, but not a number where the model cannot be inverted."""
        return self._undistorted(check_array(pixels, "pixels", (None, 2)))

    def distort_where_defined(self, pixels: Any) -> Floats:
        """As `distort`, but not a number where the model describes nothing: for drawing."""
        return self._distorted(check_array(pixels, "pixels", (None, 2)))

    @abstractmethod
    def described(self) -> dict[str, Any]:
        """The entries that stand for this lens in a camera of a `rig.json`."""

    @abstractmethod
    def _undistorted(self, pixels: Floats) -> Floats:
        """Undistorted pixels; not a number where there are none."""

    @abstractmethod
    def _distorted(self, pixels: Floats) -> Floats:
        """Distorted pixels; not a number where there are none."""


def checked_intrinsics(intrinsics: Any) -> Floats:
    """Return K, (3, 3), or raise ValueError where it is none."""
    matrix = check_array(intrinsics, "intrinsics", (3, 3))
    if abs(np.linalg.det(matrix)) < 1e-12 or np.any(matrix[2] != [0, 0, 1]):
        raise ValueError("intrinsics: must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]]")
    return matrix


def homogeneous(points: Floats, matrix: Floats) -> Floats:
    """Points of a plane, (n, 2), mapped by a (3, 3) matrix."""
    mapped = points @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def to_rays(intrinsics: Floats, pixels: Floats) -> Floats:
    """Pixels (n, 2) as rays of depth 1, (n, 2)."""
    return homogeneous(pixels, np.asarray(np.linalg.inv(intrinsics), dtype=np.float64))


def to_pixels(intrinsics: Floats, rays: Floats) -> Floats:
    """Rays of depth 1, (n, 2), as pixels (n, 2)."""
    return rays @ intrinsics[:2, :2].T + intrinsics[:2, 2]


def invert(
    function: Callable[[Floats], tuple[Floats, Floats]],
    start: Floats,
    wanted: Floats,
    pixels_per_unit: float,
) -> Floats:
    """Newton's method: points whose images are the wanted ones, (n, 2), or not a number.

    `function` gives the images of (n, 2) points and the derivatives (n, 2, 2).
    """
    points = np.array(start)
    found = np.zeros(len(points), dtype=bool)
    active = np.arange(len(points))
    with np.errstate(all="ignore"):
        for _ in range(MOST_STEPS):
            image, derivatives = function(points[active])
            gap = wanted[active] - image
            size = np.abs(gap).max(axis=1) * pixels_per_unit
            found[active] = size < EXACT_PX
            # Those that are exact, or ran off, need no more steps.
            going = (size >= EXACT_PX / 10) & np.isfinite(size)
            if not going.any():
                break
            active, gap, derivatives = active[going], gap[going], derivatives[going]
            (a, b), (c, d) = np.moveaxis(derivatives, 0, -1)
            x, y = gap.T
            solved = np.stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)
            points[active] += solved.T
    points[~found] = np.nan
    return points


def _checked(mapped: Floats, pixels: Floats, done: str) -> Floats:
    wrong = np.asarray(~np.isfinite(mapped).all(axis=1))
    if wrong.any():
        x, y = pixels[np.argmax(wrong)]
        raise ValueError(
            f"lens: {wrong.sum()} of {len(wrong)} pixels cannot be {done}, the first at "
            f"({x:.1f}, {y:.1f}): the model folds back or ends there; give a calibration that "
            "covers the picture"
        )
    return mapped
