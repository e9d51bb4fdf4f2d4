"""`reference` once more, in loops that numba compiles; importing this needs numba."""

from .edges import fill, half_way, weighted
from .lines import absorbed, best_way, blurred, log_across, medians, tube_profile
from .pictures import blurred_root, darker_lines, draw_line, even, heaped, shadow

__all__ = [
    "absorbed",
    "best_way",
    "blurred",
    "blurred_root",
    "darker_lines",
    "draw_line",
    "even",
    "fill",
    "half_way",
    "heaped",
    "log_across",
    "medians",
    "shadow",
    "tube_profile",
    "weighted",
]
