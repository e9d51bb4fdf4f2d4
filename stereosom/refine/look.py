"""What one view shows of a tube: the edges of its mask, each at its place on the outline."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Booleans, Floats, Integers
from ..camera import Camera
from ..reconstruction import HardFrame
from .contour import Contour
from .kernels import kernels
from .reference import CAP_SHARE, Looked, owners
from .spline import SplineBasis

# A rim is seen where edges lie no farther off than this, px and as a share of the half width.
_RIM_PX, _RIM_SHARE = 2.0, 0.3


@dataclass(frozen=True, eq=False)
class Tube:
    """A round tube.

    Attributes
    ----------
    curve : (n, 3) array
        Samples, mm.
    tangents : (n, 3) array
        Unit vectors there.
    speed : (n,) array
        Length of the derivative there by the curve's parameter, mm.
    radius : float
        mm.
    capped : (int, int)
        What it does at the base and at the tip: `OPEN`, `FLAT` or `ROUND` (see `reference`).
    """

    curve: Floats
    tangents: Floats
    speed: Floats
    radius: float
    capped: tuple[int, int]

    @classmethod
    def of(
        cls, basis: SplineBasis, control: Floats, radius: float, capped: tuple[int, int]
    ) -> Tube:
        """Around the spline of control points (m, 3)."""
        curve, speed, tangents = kernels().sweep(basis.values, basis.slopes, basis.first, control)
        return cls(curve, tangents, speed, radius, capped)

    @property
    def length(self) -> float:
        """Of the curve, mm."""
        return float(kernels().reach_along(self.curve)[-1])


@dataclass(frozen=True, eq=False)
class Look:
    """A tube's outline in a view, with what the contour says at each of its k points.

    Attributes
    ----------
    picture, normals, pull, turn, grow : arrays
        The outline, as `reference.outline` gives it.
    weight, total, squares : (k,) arrays
        Sums over the edges that belong to each point: of their weights, and of their residuals,
        px, and those squared, times weight.
    sums : three of four floats
        Of weight, total and squares: over the left rim, the right one, the base and the tip.
    noise : float
        Variance of an estimate times the sum of its weights, px²: of the residuals, where all
        weigh the same.
    stray : float
        Share of the contour that belongs nowhere.
    half_width : float
        Of the device in the picture, px.
    edges : int
        Number of points of the contour.
    told : int
        Number of points of the outline that edges belong to.
    alone : float
        Sum of squared weighted residuals over the sum of weights, px²: what the square of the
        former's sum over the latter's is on the mean, if each residual is on its own.
    stray_at_ends : (int, int)
        Number of points of the contour that belong nowhere, about the base and about the tip.
    slant : (float, float)
        How far the base and the tip point along the ray that sees them, as a cosine.
    """

    picture: Floats
    normals: Floats
    pull: Floats
    turn: Floats
    grow: Floats
    weight: Floats
    total: Floats
    squares: Floats
    sums: tuple[list[float], list[float], list[float]]
    noise: float
    stray: float
    half_width: float
    edges: int
    told: int
    alone: float
    stray_at_ends: tuple[int, int]
    slant: tuple[float, float]

    @classmethod
    def at(cls, tube: Tube, camera: Camera, contour: Contour, gate: float | None) -> Look:
        """Match a contour to a tube's outline.

        Parameters
        ----------
        tube : Tube
        camera : Camera
        contour : Contour
        gate : float, optional
            Edges farther off, px, are no part of it. Where not given, those are not that lie
            beyond some times the spread, and the far ones among the others count less.

        Raises
        ------
        HardFrame
            Where the tube runs behind the camera.
        """
        try:
            looked = kernels().look(
                camera.projection,
                camera.center,
                tube.curve,
                tube.tangents,
                tube.radius,
                np.array(tube.capped, dtype=np.int64),
                contour.points,
                contour.directions,
                float(gate or 0.0),
            )
        except ValueError:
            raise HardFrame("the fit runs behind a camera") from None
        return cls.of(looked, contour)

    @classmethod
    def of(cls, looked: Looked, contour: Contour) -> Look:
        """From what the kernels' `look` gave of a contour."""
        picture, normals, pull, turn, grow, weight, total, squares, sums, numbers = looked
        noise, stray, half_width, told, alone, *ends = numbers.tolist()
        return cls(
            picture, normals, pull, turn, grow, weight, total, squares, tuple(sums.tolist()),
            noise, stray, half_width, len(contour), int(told), alone,
            (int(ends[0]), int(ends[1])), (ends[2], ends[3]),
        )  # fmt: skip

    @property
    def samples(self) -> int:
        """Of the curve."""
        return len(self.picture) // 2 - _CAP

    @property
    def owner(self) -> Integers:
        """Sample of the curve that each point of the outline belongs to."""
        return owners(self.samples)

    @property
    def equations(self) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """What a step is made of."""
        return self.pull, self.turn, self.grow, self.weight, self.total

    @cached_property
    def rims_seen(self) -> Booleans:
        """Whether edges are at each sample's left and right rim, (2, n)."""
        tolerance = _RIM_PX + _RIM_SHARE * self.half_width
        seen: Booleans = kernels().rims_seen(self.weight, self.squares, self.samples, tolerance)
        return seen

    def unseen_px(self, capped: tuple[int, int]) -> tuple[float, float]:
        """Length of the rims that show no edges, px; where the tube goes on, from the first on.

        With those that the tube itself covers, where no mask has an edge, and without.
        """
        ends = np.array(capped, dtype=np.int64)
        length, bare = kernels().unseen(self.picture, self.rims_seen, ends)
        return length, bare

    @cached_property
    def spread(self) -> float:
        """Mean of the squared residuals, px²."""
        weight, _, squares = self.sums
        return sum(squares) / max(sum(weight), 1e-9)

    @cached_property
    def noise_variance(self) -> float:
        """Variance that the residuals would have if each were on its own, px²."""
        likeness = kernels().likeness(self.weight, self.total, self.alone, self.samples)
        return float(self.noise * likeness)

    @cached_property
    def cap_seen(self) -> tuple[bool, bool]:
        """Whether edges make a flat end at the base, and at the tip."""
        _, _, base, tip = self.sums[0]
        least = CAP_SHARE * 2 * self.half_width
        return base > least, tip > least

    @property
    def middle_offset(self) -> float:
        """How far the middle between both rims lies beside the curve, RMS, px."""
        return float(kernels().middle_offset(self.weight, self.total, self.samples))


_CAP = len(owners(1)) // 2 - 1
