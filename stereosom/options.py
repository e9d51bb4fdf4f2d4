"""What is known beforehand (`Prior`), and what every method's options share."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .arrays import Floats, check_array
from .backbone import Backbone
from .reconstruction import Tried

# What is shorter than an atom or longer than a kilometre is a slip of the finger or of the unit.
_SHORTEST_MM, _FARTHEST_MM = 1e-7, 1e6


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
        if self.base is not None and np.abs(self.base).max() > _FARTHEST_MM:
            raise ValueError("base: lies more than a kilometre away; give it in mm")
        if self.direction is not None:
            largest = float(np.abs(self.direction).max())
            if largest == 0:
                raise ValueError("direction: must not be zero")
            direction = self.direction / largest  # first, so that no square under- or overflows
            direction = direction / np.linalg.norm(direction)
            object.__setattr__(self, "direction", check_array(direction, "direction", (3,)))
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
    tried : Tried, optional
        What the frame before has tried in vain: not tried again where this one is no worse.
    """

    prior: Prior = field(default_factory=Prior)
    start: Backbone | None = None
    tried: Tried | None = None


def check_whole(value: Any, name: str, least: int, most: int) -> None:
    """Raise ValueError where a value is not a whole number from `least` to `most`."""
    if not isinstance(value, (int, np.integer)) or not least <= value <= most:
        raise ValueError(
            f"{name}: must be a whole number of at least {least} and at most {most}, is {value!r}"
        )


def check_positive(value: Any, name: str) -> None:
    """Raise ValueError where a value is given that is no length in mm."""
    if value is not None and not _SHORTEST_MM < value < _FARTHEST_MM:
        raise ValueError(f"{name}: must be a positive number of mm, is {value!r}")
