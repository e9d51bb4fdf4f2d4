"""What takes the time of a segmentation, in plain numpy: `compiled` must give the same, faster."""

from .colors import counted, likeness, sampled, shades
from .edges import fill, half_way, held, most_gain, weighted
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
from .lines import absorbed, best_way, blurred, evenly, light_across, medians, middles, normals
from .pictures import darker_lines, draw_line, shifted
from .profiles import fitted_profile, tube_profile

__all__ = [
    "absorbed",
    "best_way",
    "blurred",
    "counted",
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
    "held",
    "learn_slopes",
    "light_across",
    "likeness",
    "medians",
    "middles",
    "most_gain",
    "normals",
    "sampled",
    "shades",
    "shadow",
    "shifted",
    "smooth",
    "tail",
    "tube_profile",
    "weighted",
]
