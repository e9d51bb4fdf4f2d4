"""`RadialTangentialLens`: the usual lens of an endoscope or a camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial
from numpy.polynomial.polynomial import polyval

from stereosom.arrays import Floats, check_array

from .model import Lens, checked_intrinsics, homogeneous, invert, to_pixels, to_rays

_COUNTS = (4, 5, 8, 12, 14)


@dataclass(frozen=True, eq=False)
class RadialTangentialLens(Lens):
    """The model of Brown and Conrady, with OpenCV's extensions.

    With (x, y) the ray of depth 1, r² = x² + y², and the coefficients in OpenCV's order
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, τx, τy (documentation of OpenCV's calib3d,
    "Camera calibration and 3D reconstruction"):

        x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
             + 2 p1 x y + p2 (r² + 2 x²) + s1 r² + s2 r⁴
        y' = y (…) + p1 (r² + 2 y²) + 2 p2 x y + s3 r² + s4 r⁴

    then the sensor's tilt by τx and τy (rad), then the intrinsics.

    Parameters
    ----------
    intrinsics : (3, 3) array
        Of the picture, px.
    coefficients : (4,), (5,), (8,), (12,) or (14,) array

    Examples
    --------
    With k1 alone, a ray at r = 0.5 moves outwards by k1 r² = 2.5 % of its radius:

    >>> lens = RadialTangentialLens([[1000, 0, 320], [0, 1000, 240], [0, 0, 1]], [0.1, 0, 0, 0])
    >>> lens.distort([[820, 240]]).round(6)  # 320 + 500 · 1.025
    array([[832.5, 240. ]])
    >>> lens.undistort([[832.5, 240]]).round(6)
    array([[820., 240.]])
    """

    intrinsics: Floats
    coefficients: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "intrinsics", checked_intrinsics(self.intrinsics))
        given = check_array(np.ravel(self.coefficients), "distortion", (None,))
        if len(given) not in _COUNTS:
            raise ValueError(f"distortion: must be 4, 5, 8, 12 or 14 numbers, is {len(given)}")
        object.__setattr__(self, "coefficients", given)

    def __str__(self) -> str:
        return f"radial-tangential lens of {len(self.coefficients)} coefficients"

    def _undistorted(self, pixels: Floats) -> Floats:
        """Newton's method from the radial part's inverse."""
        bent = homogeneous(
            to_rays(self.intrinsics, pixels),
            np.asarray(np.linalg.inv(self._tilt), dtype=np.float64),
        )
        focal = float(np.abs(self.intrinsics[[0, 1], [0, 1]]).max())
        rays = invert(self._bend, self._radially_undistorted(bent), bent, focal)
        rays[~self._valid(rays)] = np.nan
        return to_pixels(self.intrinsics, rays)

    def _distorted(self, pixels: Floats) -> Floats:
        rays = to_rays(self.intrinsics, pixels)
        rays[~self._valid(rays)] = np.nan
        return to_pixels(self.intrinsics, homogeneous(self._bend(rays)[0], self._tilt))

    def described(self) -> dict[str, Any]:
        """The entries of a `rig.json`."""
        return {
            "intrinsics": self.intrinsics.tolist(),
            "distortion": self.coefficients.tolist(),
            "distortion_model": "radial-tangential",
        }

    @cached_property
    def _all(self) -> Floats:
        return np.concatenate([self.coefficients, np.zeros(14 - len(self.coefficients))])

    @cached_property
    def _radial(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator in r²."""
        k1, k2, _, _, k3, k4, k5, k6 = self._all[:8]
        return Polynomial([1, k1, k2, k3]), Polynomial([1, k4, k5, k6])

    @cached_property
    def _factors(self) -> tuple[Floats, ...]:
        """Coefficients of both, and of their derivatives."""
        over, under = self._radial
        all_four = (over, under, over.deriv(), under.deriv())
        return tuple(np.asarray(each.coef, dtype=np.float64) for each in all_four)

    @cached_property
    def _greatest_radius(self) -> float:
        """Where the radial part r N(r²)/D(r²) stops growing: beyond it the picture folds back."""
        over, under = self._radial
        u = Polynomial([0, 1])
        slope = over * under + 2 * u * (over.deriv() * under - over * under.deriv())
        roots = np.concatenate([slope.trim(1e-15).roots(), under.trim(1e-15).roots()])
        turns = roots.real[(np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots))) & (roots.real > 0)]
        return float(np.sqrt(turns.min())) if len(turns) else np.inf

    @cached_property
    def _tilt(self) -> Floats:
        x, y = self._all[12:]
        about_x = [[1, 0, 0], [0, np.cos(x), np.sin(x)], [0, -np.sin(x), np.cos(x)]]
        about_y = [[np.cos(y), 0, -np.sin(y)], [0, 1, 0], [np.sin(y), 0, np.cos(y)]]
        turn = np.array(about_y) @ np.array(about_x)
        onto = [[turn[2, 2], 0, -turn[0, 2]], [0, turn[2, 2], -turn[1, 2]], [0, 0, 1]]
        return np.asarray(np.array(onto) @ turn)

    def _bend(self, rays: Floats) -> tuple[Floats, Floats]:
        """Rays (n, 2) as the lens bends them, and the derivatives (n, 2, 2)."""
        _, _, p1, p2 = self._all[:4]
        s1, s2, s3, s4 = self._all[8:12]
        x, y = rays.T
        u = x**2 + y**2
        over, under, over_slope, under_slope = (polyval(u, each) for each in self._factors)
        factor = over / under
        slope = (over_slope - factor * under_slope) / under  # of the factor, by r²
        bent = np.column_stack(
            [
                x * factor + 2 * p1 * x * y + p2 * (u + 2 * x**2) + s1 * u + s2 * u**2,
                y * factor + p1 * (u + 2 * y**2) + 2 * p2 * x * y + s3 * u + s4 * u**2,
            ]
        )
        prism_x, prism_y = 2 * (s1 + 2 * s2 * u), 2 * (s3 + 2 * s4 * u)
        derivatives = np.empty((len(rays), 2, 2))
        derivatives[:, 0, 0] = factor + 2 * x**2 * slope + 2 * p1 * y + 6 * p2 * x + prism_x * x
        derivatives[:, 0, 1] = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + prism_x * y
        derivatives[:, 1, 0] = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + prism_y * x
        derivatives[:, 1, 1] = factor + 2 * y**2 * slope + 6 * p1 * y + 2 * p2 * x + prism_y * y
        return bent, derivatives

    def _valid(self, rays: Floats) -> npt.NDArray[np.bool_]:
        inside = np.isfinite(rays).all(axis=1)
        inside &= np.hypot(*np.nan_to_num(rays).T) < self._greatest_radius
        with np.errstate(all="ignore"):
            unfolded = np.linalg.det(self._bend(np.nan_to_num(rays))[1]) > 0
        return np.asarray(inside & unfolded)

    def _radially_undistorted(self, bent: Floats) -> Floats:
        """Invert the radial part alone, by a table of it."""
        distance = np.hypot(*bent.T)
        reach = min(self._greatest_radius, 2.0)
        radius, shown = _radii(self, reach)
        while reach < min(self._greatest_radius, 1e3) and shown[-1] < distance.max(initial=0.0):
            reach = min(2 * reach, self._greatest_radius)
            radius, shown = _radii(self, reach)
        start = np.interp(distance, shown, radius)
        return np.asarray(bent * (start / np.maximum(distance, 1e-12))[:, None])


@lru_cache(maxsize=16)
def _radii(lens: RadialTangentialLens, reach: float) -> tuple[Floats, Floats]:
    """A table of radii up to a reach, and of those at which the radial part shows them."""
    over, under = lens._radial
    radius = np.linspace(0, reach * (1 - 1e-9), 2000)
    return radius, np.asarray(radius * over(radius**2) / under(radius**2))
