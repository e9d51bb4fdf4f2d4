"""`Reconstruction`: the backbone at one instant, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from .arrays import Booleans, Floats, check_array
from .backbone import Backbone
from .vectors import cross, dot, perpendicular

Status = Literal["ok", "predicted", "lost", "failed"]
_STATUSES: tuple[str, ...] = get_args(Status)


class HardFrame(ValueError):
    """A method's word that it cannot reconstruct this observation, and why."""


@dataclass(frozen=True)
class Tried:
    """What was tried for the ends of a fit, for the frame that follows it.

    Attributes
    ----------
    odd_ends : (bool, bool)
        Whether the base, and the tip, stays seen worse than the rest, whatever is tried.
    cost : float
        Per point of the outlines, px².
    round_ends : (bool, bool)
        Whether the base, and the tip, was found to be rounded.
    """

    odd_ends: tuple[bool, bool]
    cost: float
    round_ends: tuple[bool, bool] = (False, False)

    def reversed(self) -> Tried:
        """The same of the curve from tip to base."""
        return Tried(self.odd_ends[::-1], self.cost, self.round_ends[::-1])


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """What was made of one observation.

    Parameters
    ----------
    index : int
        Number of the frame in its source, from zero.
    time : float
        Seconds.
    status : {'ok', 'predicted', 'lost', 'failed'}
        `predicted`: carried over a gap. `lost` and `failed` have no backbone.
    reason : str
        Why it is not ok; where it is ok, what the result assumed (may be empty).
    method : str
        Name of the method.
    backbone : Backbone, optional
    covariance : (n, 3, 3) array, optional
        Covariance of the position at n equal steps of arc length, mm².
    residuals : (float, float), optional
        RMS reprojection residual of view a and of view b, px.
    radius : float, optional
        Of the device, mm, where known.
    tried : Tried, optional
        What a tracker need not try again in the next frame.

    Raises
    ------
    ValueError
        Where a status that has a curve comes without one, or the other way round.
    """

    index: int
    time: float
    status: Status
    reason: str = ""
    method: str = ""
    backbone: Backbone | None = None
    covariance: Floats | None = None
    residuals: tuple[float, float] | None = None
    radius: float | None = None
    tried: Tried | None = None

    def __post_init__(self) -> None:
        if self.status not in _STATUSES:
            raise ValueError(f"status: {self.status!r} is not one of {', '.join(_STATUSES)}")
        has_curve = self.status in ("ok", "predicted")
        parts = (self.backbone, self.covariance, self.residuals)
        if any((part is not None) != has_curve for part in parts):
            wants = "needs" if has_curve else "has no"
            raise ValueError(
                f"reconstruction: {self.status} {wants} backbone, covariance and residuals"
            )
        if not has_curve and not self.reason:
            raise ValueError(f"reconstruction: {self.status} needs a reason")
        if self.covariance is not None:
            covariance = check_array(self.covariance, "covariance", (None, 3, 3))
            object.__setattr__(self, "covariance", covariance)

    @property
    def ok(self) -> bool:
        """Whether there is a backbone (seen or predicted)."""
        return self.backbone is not None

    def covariance_at(self, s: Any) -> Floats:
        """Covariance at arc lengths `s` (n,), mm: (n, 3, 3), mm², linear between samples."""
        backbone, covariance = self._curve()
        at = np.asarray(s, dtype=float) / backbone.length * (len(covariance) - 1)
        low = np.clip(at.astype(int), 0, len(covariance) - 2)
        share = (at - low)[:, None, None]
        return np.asarray((1 - share) * covariance[low] + share * covariance[low + 1])

    def standard_deviation_at(self, s: Any) -> Floats:
        """Standard deviation at arc lengths `s` (n,), mm.

        The square root of the largest eigenvalue of the covariance across the curve; at the
        two ends, along it too.
        """
        backbone, _ = self._curve()
        s = np.asarray(s, dtype=float)
        covariance = self.covariance_at(s)
        largest = np.empty(len(s))
        at_end = (s <= 1e-6 * backbone.length) | (s >= (1 - 1e-6) * backbone.length)
        largest[at_end] = np.linalg.eigvalsh(covariance[at_end])[:, -1]
        if not at_end.all():
            # Across the curve there are but two directions.
            tangent = backbone.tangent(s)
            one = perpendicular(tangent)
            two = cross(tangent, one)
            by_one, by_two = (np.einsum("nij,nj->ni", covariance, side) for side in (one, two))
            in_one, in_two, both = dot(by_one, one), dot(by_two, two), dot(by_one, two)
            across = (in_one + in_two) / 2 + np.hypot((in_one - in_two) / 2, both)
            largest = np.where(at_end, largest, across)
        return np.asarray(np.sqrt(np.maximum(largest, 0.0)))

    def determined_at(self, s: Any) -> Booleans:
        """Whether the views determine the curve at arc lengths `s` (n,).

        Not where the standard deviation exceeds 1 mm or three times the radius, whichever
        is larger.
        """
        return np.asarray(self.standard_deviation_at(s) <= self.most_determined)

    @property
    def most_determined(self) -> float:
        """Greatest standard deviation of a place that the views determine, mm."""
        return max(1.0, 3 * (self.radius or 0.0))

    def _curve(self) -> tuple[Backbone, Floats]:
        if self.backbone is None or self.covariance is None:
            raise ValueError(f"frame {self.index} has no backbone: {self.reason}")
        return self.backbone, self.covariance
