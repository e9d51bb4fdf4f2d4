"""How a tracked device moves: where it will be in the next frame, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .backbone import Backbone
from .reconstruction import Reconstruction
from .refine.spline import spline_basis

# Points that a curve's motion is told at, and pieces of the curve that is predicted.
_POINTS, _PIECES = 80, 16
# A device goes on as it moved for about so many frames' time, and then rests.
_GOES_ON = 3.0
# What a device may move from one frame to the next that was seen at rest, mm.
_LEAST_STEP = 0.1


@dataclass(frozen=True, eq=False)
class Motion:
    """The last curve that was seen, and how fast it moved.

    Attributes
    ----------
    last : Reconstruction
        With a backbone.
    places : (n, 3) array
        Points at equal steps along it, mm.
    velocity : (n, 3) array
        Of these points, mm/s.
    interval : float
        Time between frames, s.
    """

    last: Reconstruction
    places: Floats
    velocity: Floats
    interval: float

    @classmethod
    def after(cls, result: Reconstruction, before: Motion | None) -> Motion:
        """What a curve that was seen tells, after another or as the first."""
        assert result.backbone is not None
        places = result.backbone.polyline(_POINTS)
        if before is None:
            return cls(result, places, np.zeros_like(places), 0.0)
        passed = result.time - before.last.time
        if passed <= 0:
            return cls(result, places, np.zeros_like(places), before.interval)
        frames = max(result.index - before.last.index, 1)
        return cls(result, places, (places - before.places) / passed, passed / frames)

    def at(self, time: float) -> Backbone:
        """The curve that is expected at a time, s."""
        rest = _GOES_ON * self.interval
        if rest == 0:
            assert self.last.backbone is not None
            return self.last.backbone
        reach = rest * (1 - np.exp(-max(time - self.last.time, 0.0) / rest))
        basis = spline_basis(_PIECES, _POINTS)
        return basis.backbone(basis.through(self.places + reach * self.velocity))

    def predicted(self, index: int, time: float, why: str) -> Reconstruction:
        """A result for a frame that shows too little: carried on, and less sure with each."""
        last = self.last
        assert last.backbone is not None
        assert last.covariance is not None
        frames = max(index - last.index, 1)
        speed = np.sqrt(np.mean(np.sum(self.velocity**2, axis=1)))
        step = max(float(speed) * self.interval, _LEAST_STEP)
        return Reconstruction(
            index=index,
            time=time,
            status="predicted",
            reason=f"{why}; carried on from frame {last.index}",
            method=last.method,
            backbone=self.at(time),
            covariance=last.covariance + (step * frames) ** 2 * np.eye(3),
            residuals=last.residuals,
            radius=last.radius,
        )
