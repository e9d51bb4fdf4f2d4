"""`FisheyeLens`: wide endoscopes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from stereosom.arrays import Floats, check_array

from .model import EXACT_PX, MOST_STEPS, Lens, checked_intrinsics, to_pixels, to_rays


@dataclass(frozen=True, eq=False)
class FisheyeLens(Lens):
    """OpenCV's fisheye: a ray at angle θ from the axis is shown at θ (1 + k1 θ² + … + k4 θ⁸).

    After J. Kannala, S. Brandt, "A generic camera model and calibration method for
    conventional, wide-angle, and fish-eye lenses", IEEE PAMI 28(8), 2006, as in the
    documentation of OpenCV's `fisheye` module. Rays at 90° and beyond have no place in an ideal
    camera's picture: they are refused.

    Parameters
    ----------
    intrinsics : (3, 3) array
        Of the picture, px.
    coefficients : (4,) array
        k1, k2, k3, k4.

    Examples
    --------
    Without coefficients, 45° falls on π/4 of the focal length:

    >>> lens = FisheyeLens([[1000, 0, 320], [0, 1000, 240], [0, 0, 1]], [0, 0, 0, 0])
    >>> lens.distort([[1320, 240]]).round(3)
    array([[1105.398,  240.   ]])
    """

    intrinsics: Floats
    coefficients: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "intrinsics", checked_intrinsics(self.intrinsics))
        given = check_array(np.ravel(self.coefficients), "fisheye distortion", (4,))
        object.__setattr__(self, "coefficients", given)

    def __str__(self) -> str:
        return "fisheye lens"

    def _undistorted(self, pixels: Floats) -> Floats:
        """Newton's method for the angle, from a table of it."""
        bent = to_rays(self.intrinsics, pixels)
        shown = np.hypot(*bent.T)
        greatest = self._greatest_angle
        angles = np.linspace(0, greatest, 2000)
        angle = np.interp(shown, self._shown(angles), angles)
        slope = self._shown.deriv()
        for _ in range(MOST_STEPS):
            step = (self._shown(angle) - shown) / np.maximum(slope(angle), 1e-9)
            angle = np.clip(angle - step, 0, greatest)
        focal = float(np.abs(self.intrinsics[[0, 1], [0, 1]]).max())
        found = np.abs(self._shown(angle) - shown) * focal < EXACT_PX
        stretch = np.where(shown > 1e-12, np.tan(angle) / np.maximum(shown, 1e-12), 1.0)
        stretch[~found] = np.nan
        return to_pixels(self.intrinsics, bent * stretch[:, None])

    def _distorted(self, pixels: Floats) -> Floats:
        rays = to_rays(self.intrinsics, pixels)
        radius = np.hypot(*rays.T)
        angle = np.arctan(radius)
        shrink = np.where(radius > 1e-12, self._shown(angle) / np.maximum(radius, 1e-12), 1.0)
        shrink[angle > self._greatest_angle] = np.nan
        return to_pixels(self.intrinsics, rays * shrink[:, None])

    def described(self) -> dict[str, Any]:
        """The entries of a `rig.json`."""
        return {
            "intrinsics": self.intrinsics.tolist(),
            "distortion": self.coefficients.tolist(),
            "distortion_model": "fisheye",
        }

    @cached_property
    def _shown(self) -> Polynomial:
        """Radius at which an angle (rad) is shown, in focal lengths."""
        k1, k2, k3, k4 = self.coefficients
        return Polynomial([0, 1, 0, k1, 0, k2, 0, k3, 0, k4])

    @cached_property
    def _greatest_angle(self) -> float:
        roots = self._shown.deriv().trim(1e-15).roots()
        turns = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)]
        return float(min([np.pi / 2 - 1e-3, *(turns * (1 - 1e-9))]))
