"""What every picture shares: its colors, its typeface, its units."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import require

Picture = npt.NDArray[np.uint8]
"""(rows, columns, 3) bytes, red, green, blue."""

# Blue and orange of the Okabe-Ito palette: told apart with any color vision.
VIEW_COLORS = {"a": "#0072B2", "b": "#D55E00"}
SEGMENTED = "#00D9A3"  # its bluish green, brighter: it must show on black bone and white field
BACKGROUND, SHEET = "#f7f8fa", "#e4e7ec"
INK, FAINT_INK = "#22262b", "#59616b"
GHOST, ENVELOPE, UNDETERMINED = "#8b95a1", "#7a5fb0", "#c3c7cd"

# So many lines of small text fill the height of a picture.
LINES = 50

COLOR_BY = {
    "Curvature": ("curvature (1/mm)", "viridis"),
    "StandardDeviation": ("standard deviation (mm)", "plasma"),
    "Time": ("time (s)", "cividis"),
}


def letter_height(size: tuple[int, int]) -> int:
    """Height of small words in a picture of (width, height), px.

    A narrow picture takes smaller words, so that both upper corners have room for theirs; but
    no words smaller than can be read.

    Examples
    --------
    >>> letter_height((1600, 1200)), letter_height((600, 1200)), letter_height((160, 120))
    (24, 9, 8)
    """
    width, height = size
    return max(8, round(min(height, 0.75 * width) / LINES))


def rgb(color: str) -> tuple[int, int, int]:
    """Bytes of a color.

    Examples
    --------
    >>> rgb("#0072B2")
    (0, 114, 178)
    """
    return int(color[1:3], 16), int(color[3:5], 16), int(color[5:7], 16)


def colors_of(values: Any, limits: tuple[float, float], color_by: str) -> Picture:
    """Colors of (n,) values between two limits, (n, 3); where there is no number, gray."""
    table = require("matplotlib", "vtk").colormaps[COLOR_BY[color_by][1]]
    low, high = limits
    values = np.asarray(values, dtype=float)
    share = np.clip((np.nan_to_num(values) - low) / (high - low), 0, 1)
    colors = np.round(255 * table(share)[:, :3]).astype(np.uint8)
    colors[~np.isfinite(values)] = rgb(UNDETERMINED)
    return np.asarray(colors)


@cache
def typeface(height: int) -> Any:
    """The typeface at a height in pixels. It comes with matplotlib and has every sign we use."""
    folder = Path(require("matplotlib", "vtk").get_data_path())
    font = require("PIL.ImageFont", "vtk")
    return font.truetype(str(folder / "fonts" / "ttf" / "DejaVuSans.ttf"), height)


def round_step(span: float, steps: float) -> float:
    """The largest of 1, 2, 5, 10, ... (times a power of ten) that fits `steps` times in a span.

    Examples
    --------
    >>> round_step(87, 4)
    20.0
    """
    power = 10.0 ** np.floor(np.log10(span / steps))
    # The logarithm of a number just below a power of ten may be rounded up to it.
    fitting = [factor for factor in (0.5, 1, 2, 5) if factor * power <= span / steps]
    return float(power * max(fitting))
