"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from .edges import contour, look, match
from .equations import along, assemble, sliding
from .noise import rounding
from .outline import outline

__all__ = ["along", "assemble", "contour", "look", "match", "outline", "rounding", "sliding"]
