"""`reference` once more, in loops that numba compiles; importing this needs numba."""

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
    "heaped",
    "log_across",
    "medians",
    "shadow",
    "tube_profile",
]
