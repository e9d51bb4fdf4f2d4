"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from .contour import contour
from .covariance import by_length, covariance
from .descent import descend, ends_shown, noise_of
from .edges import look, match, middle_offset, rims_seen, unseen
from .equations import crossed, roughness_like, step, sweep
from .lengths import evenly, reach_along, reach_in_pictures, steps_in_picture
from .noise import likeness, rounding
from .outline import outline
from .pairing import pair_in_order
from .walk import walk

__all__ = [
    "by_length",
    "contour",
    "covariance",
    "crossed",
    "descend",
    "ends_shown",
    "evenly",
    "likeness",
    "look",
    "match",
    "middle_offset",
    "noise_of",
    "outline",
    "pair_in_order",
    "reach_along",
    "reach_in_pictures",
    "rims_seen",
    "roughness_like",
    "rounding",
    "step",
    "steps_in_picture",
    "sweep",
    "unseen",
    "walk",
]
