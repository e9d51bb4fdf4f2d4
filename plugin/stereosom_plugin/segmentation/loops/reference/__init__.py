"""What takes the time of a segmentation, in plain numpy: `compiled` must give the same, faster."""

from .edges import fill, half_way, weighted
from .ends import (
    covered,
    damped_step,
    deviations,
    discs,
    even,
    learn_slopes,
    shadow,
    smooth,
    tail,
)
from .lines import absorbed, best_way, blurred, evenly, light_across, medians, normals
from .pictures import darker_lines, draw_line, shifted
from .profiles import fitted_profile, tube_profile

__all__ = [
    "absorbed",
    "best_way",
    "blurred",
    "covered",
    "damped_step",
    "darker_lines",
    "deviations",
    "discs",
    "draw_line",
    "even",
    "evenly",
    "fill",
    "fitted_profile",
    "half_way",
    "learn_slopes",
    "light_across",
    "medians",
    "normals",
    "shadow",
    "shifted",
    "smooth",
    "tail",
    "tube_profile",
    "weighted",
]
