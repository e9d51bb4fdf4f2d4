"""How a tracked device moves: where it will be in the next frame, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .backbone import Backbone
from .reconstruction import Reconstruction

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
    velocity : (m, 3) array
        Of its control points, mm/s.
    interval : float
        Time between frames, s.
    """

    last: Reconstruction
    velocity: Floats
    interval: float

    @classmethod
    def after(cls, result: Reconstruction, before: Motion | None) -> Motion:
        """What a curve that was seen tells, after another or as the first."""
        curve = result.backbone
        assert curve is not None
        rest = cls(result, np.zeros_like(curve.coefficients), before.interval if before else 0.0)
        if before is None or before.last.backbone is None:
            return rest
        passed = result.time - before.last.time
        if passed <= 0 or not np.array_equal(curve.knots, before.last.backbone.knots):
            return rest
        moved = curve.coefficients - before.last.backbone.coefficients
        return cls(result, moved / passed, passed / max(result.index - before.last.index, 1))

    def at(self, time: float) -> Backbone:
        """The curve that is expected at a time, s."""
        curve, rest = self.last.backbone, _GOES_ON * self.interval
        assert curve is not None
        if rest == 0:
            return curve
        reach = rest * (1 - np.exp(-max(time - self.last.time, 0.0) / rest))
        return Backbone(curve.knots, curve.coefficients + reach * self.velocity, curve.degree)

    def predicted(self, index: int, time: float, why: str) -> Reconstruction:
        """A result for a frame that shows too little: carried on, and less sure with each."""
        last = self.last
        assert last.backbone is not None and last.covariance is not None
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
