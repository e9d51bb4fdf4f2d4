"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from .edges import contour, look, match, rims_seen, unseen
from .equations import by_length, covariance, step, sweep
from .noise import likeness, rounding
from .outline import outline

__all__ = [
    "by_length",
    "contour",
    "covariance",
    "likeness",
    "look",
    "match",
    "outline",
    "rims_seen",
    "rounding",
    "step",
    "sweep",
    "unseen",
]
