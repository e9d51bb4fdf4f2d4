"""What one view says of a tube, in the plainest numpy: `compiled` must give the same, faster.

An outline is kept as arrays, a row for each of its points: first the left rim, a point for each
of the n samples of the curve, then the right rim, then `CAP_POINTS` around the base's flat end
and as many around the tip's.
"""

from .contour import contour
from .covariance import by_length, covariance
from .descent import CAP_SHARE, LEAST_NOISE, Looked, descend, ends_shown, noise_of
from .edges import look, match, middle_offset, rims_seen, unseen
from .equations import assemble, crossed, roughness_like, step, sweep
from .lengths import evenly, reach_along, reach_in_pictures, steps_in_picture
from .noise import HARMONICS, likeness, rounding
from .outline import CAP_POINTS, FLAT, NOWHERE, OPEN, ROUND, outline, owners, pieces
from .pairing import pair_in_order
from .walk import walk

__all__ = [
    "CAP_POINTS",
    "CAP_SHARE",
    "FLAT",
    "HARMONICS",
    "LEAST_NOISE",
    "NOWHERE",
    "OPEN",
    "ROUND",
    "Looked",
    "assemble",
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
    "owners",
    "pair_in_order",
    "pieces",
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
