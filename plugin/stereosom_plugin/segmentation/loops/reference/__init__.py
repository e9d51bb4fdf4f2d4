"""What takes the time of a segmentation, in plain numpy: `compiled` must give the same, faster."""

from .edges import fill, half_way, weighted
from .lines import absorbed, best_way, blurred, log_across, medians, tube_profile
from .pictures import blurred_root, darker_lines, draw_line, even, heaped, shadow, shifted

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
    "shifted",
    "tube_profile",
    "weighted",
]
