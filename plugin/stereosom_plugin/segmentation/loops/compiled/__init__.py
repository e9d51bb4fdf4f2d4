"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from .ends import discs, even, shadow, smooth, tail
from .lines import absorbed, best_way, blurred, log_across, medians, tube_profile
from .pictures import darker_lines, draw_line

__all__ = [
    "absorbed",
    "best_way",
    "blurred",
    "darker_lines",
    "discs",
    "draw_line",
    "even",
    "log_across",
    "medians",
    "shadow",
    "smooth",
    "tail",
    "tube_profile",
]
