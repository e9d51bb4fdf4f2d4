"""What is known beforehand (`Prior`), and what every method's options share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .arrays import Floats, check_array
from .backbone import Backbone


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the device before it is seen. All of it is optional.

    Parameters
    ----------
    base : (3,) array, optional
        Where the device begins, mm.
    direction : (3,) array, optional
        Direction of deployment at the base; any length.
    length : float, optional
        Deployed arc length, mm.
    radius : float, optional
        Of the device, mm.

    Raises
    ------
    ValueError
        Where a number is not finite, a length or radius not positive, a direction zero.
    """

    base: Floats | None = None
    direction: Floats | None = None
    length: float | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        for name in ("base", "direction"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, check_array(getattr(self, name), name, (3,)))
        if self.direction is not None:
            norm = float(np.linalg.norm(self.direction))
            if norm == 0:
                raise ValueError("direction: must not be zero")
            object.__setattr__(
                self, "direction", check_array(self.direction / norm, "direction", (3,))
            )
        for name in ("length", "radius"):
            check_positive(getattr(self, name), name)


@dataclass(frozen=True, eq=False)
class Options:
    """What every method takes.

    Parameters
    ----------
    prior : Prior
    start : Backbone, optional
        A curve to start from, most often that of the frame before.
    """

    prior: Prior = field(default_factory=Prior)
    start: Backbone | None = None


def check_positive(value: Any, name: str) -> None:
    """Raise ValueError where a value is given that is not a positive, finite number."""
    if value is not None and not (np.isfinite(value) and value > 0):
        raise ValueError(f"{name}: must be a positive number of mm, is {value!r}")
