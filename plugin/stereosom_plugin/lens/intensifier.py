"""`IntensifierLens`: the curved screen of an X-ray image intensifier."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats, check_array

from .model import Lens, invert


@dataclass(frozen=True, eq=False)
class IntensifierLens(Lens):
    """An X-ray image intensifier: a smooth map of the picture, fitted to a grid of beads.

    Its input screen is curved and its electrons are turned by the earth's field, so that the
    picture is stretched and twisted like an S: no radial model fits. Both coordinates become
    polynomials of the two, as is usual (E. Gronenschild, "The accuracy and reproducibility of a
    global method to correct for geometric image distortion in the x-ray imaging chain", Med.
    Phys. 24, 1997).

    Parameters
    ----------
    low, high : (2,) array
        Corners of the box, px, in which the grid was seen. Beyond it nothing is known.
    coefficients : (degree + 1, degree + 1, 2) array
        Of T_i(u) T_j(v), Chebyshev polynomials of the pixel's place in the box, −1 to 1: the
        undistorted pixel's x and y.
    """

    low: Floats
    high: Floats
    coefficients: Floats

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, check_array(getattr(self, name), name, (2,)))
        given = check_array(self.coefficients, "undistortion", (None, None, 2))
        if given.shape[0] != given.shape[1] or not 2 <= len(given) <= 16:
            raise ValueError("undistortion: must be (degree + 1) × (degree + 1) × 2")
        if np.any(self.high - self.low <= 0):
            raise ValueError("undistortion: its box has no extent")
        object.__setattr__(self, "coefficients", given)

    @classmethod
    def fitted(cls, distorted: Any, ideal: Any, degree: int = 7) -> IntensifierLens:
        """Fit the map to matched points, (n, 2) px each, of the picture and of the true grid.

        Raises
        ------
        ValueError
            Where the points are too few for the degree, or do not spread over a plane.
        """
        seen = check_array(distorted, "grid points", (None, 2))
        true = check_array(ideal, "grid references", (None, 2))
        terms = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
        if len(seen) != len(true) or len(seen) < 2 * len(terms):
            raise ValueError(
                f"grid: {len(seen)} points with {len(true)} references; "
                f"at least {2 * len(terms)} of each are needed"
            )
        low, high = seen.min(axis=0), seen.max(axis=0)
        if np.any(high - low <= 0):
            raise ValueError("grid: its points lie on a line")
        # A frame beyond the outermost bead, to the next that is no more seen.
        margin = 0.02 * (high - low)
        low, high = low - margin, high + margin
        u, v = (2 * (seen - low) / (high - low) - 1).T
        powers = np.polynomial.chebyshev.chebvander2d(u, v, [degree, degree])
        columns = np.column_stack([powers[:, i * (degree + 1) + j] for i, j in terms])
        solved, _, rank, _ = np.linalg.lstsq(columns, true, rcond=None)
        if rank < len(terms):
            raise ValueError("grid: its points do not spread over the picture")
        coefficients = np.zeros((degree + 1, degree + 1, 2))
        for (i, j), value in zip(terms, solved, strict=True):
            coefficients[i, j] = value
        return cls(low, high, coefficients)

    def __str__(self) -> str:
        return (
            f"image intensifier, undistorted by polynomials of degree {len(self.coefficients) - 1}"
        )

    def _undistorted(self, pixels: Floats) -> Floats:
        ideal = self._map(pixels)[0]
        ideal[~self._inside(pixels)] = np.nan
        return ideal

    def _distorted(self, pixels: Floats) -> Floats:
        seen = invert(self._map, pixels, pixels, 1.0)
        seen[~self._inside(seen)] = np.nan
        return seen

    def described(self) -> dict[str, Any]:
        """The entries of a `rig.json`."""
        return {
            "distortion_model": "intensifier",
            "distortion": self.coefficients.tolist(),
            "distortion_box": [self.low.tolist(), self.high.tolist()],
        }

    def _inside(self, pixels: Floats) -> npt.NDArray[np.bool_]:
        return np.asarray(np.all((pixels >= self.low) & (pixels <= self.high), axis=1))

    def _map(self, pixels: Floats) -> tuple[Floats, Floats]:
        """Undistorted pixels (n, 2), and the derivatives (n, 2, 2)."""
        to_unit = 2 / (self.high - self.low)
        u, v = ((pixels - self.low) * to_unit - 1).T
        evaluate = np.polynomial.chebyshev.chebval2d
        by_u, by_v = (
            np.polynomial.chebyshev.chebder(self.coefficients, axis=axis) for axis in (0, 1)
        )
        derivatives = np.stack(
            [evaluate(u, v, by_u).T * to_unit[0], evaluate(u, v, by_v).T * to_unit[1]], axis=-1
        )
        return np.asarray(evaluate(u, v, self.coefficients).T), derivatives
