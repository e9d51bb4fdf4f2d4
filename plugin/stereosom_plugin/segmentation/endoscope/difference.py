"""How far a picture is from its background."""

from __future__ import annotations

import numpy as np

from stereosom_plugin.errors import InputError, require

from .frame import Light, over_colors

# Share of the shorter side over which a background is taken for even, and the pixels per side of
# the small picture on which that is done.
EVEN_OVER, SMALL_SIDE = 0.3, 240
# So many pixels, evenly spread, tell the exposure.
EXPOSED = 100_000
# A shadow darkens all colors alike, by no more than this, and no less alike than that.
DEEPEST_SHADOW, ALIKE = 0.45, 0.06


def plain_background(picture: Light) -> Light:
    """What lies behind a thin device where nothing else is known: the median around each pixel.

    Parameters
    ----------
    picture : (rows, columns, channels) array
    """
    cv2 = require("cv2", "endoscopy")
    rows, columns, channels = picture.shape
    scale = min(1.0, SMALL_SIDE / min(rows, columns))
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    levels = np.rint(small * 255).astype(np.uint8)
    side = max(3, round(EVEN_OVER * min(small.shape[:2])) | 1)
    # The filter goes on beyond the border with the outermost pixels: a device that ends there
    # would be its own background, so the picture is mirrored first.
    levels = cv2.copyMakeBorder(levels, side, side, side, side, cv2.BORDER_REFLECT_101)
    smooth = cv2.medianBlur(levels, side)[side:-side, side:-side].astype(np.float32) / 255
    whole = cv2.resize(smooth, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return np.asarray(whole.reshape(rows, columns, channels))


def difference(picture: Light, background: Light, *, shadows: bool = True) -> Light:
    """Largest difference over the colors, (rows, columns), 0 to 1; shadows make none.

    The background is brought to the picture's exposure first, each color by the median quotient.

    Parameters
    ----------
    picture, background : (rows, columns, channels) array
    shadows : bool
        Whether shadows are looked for.

    Raises
    ------
    InputError
        Where the background has another size.

    Examples
    --------
    >>> empty = np.full((20, 20, 3), 0.5, dtype=np.float32)
    >>> seen = empty.copy()
    >>> seen[5] = 0.1, 0.1, 0.3  # a bluish line
    >>> seen[9] *= 0.7  # a shadow
    >>> difference(seen, empty)[[5, 9], 0].round(2).tolist()
    [0.4000000059604645, 0.0]
    """
    if picture.shape != background.shape:
        sizes = ["×".join(map(str, one.shape[1::-1])) for one in (background, picture)]
        raise InputError(
            "background",
            f"is {sizes[0]} with {background.shape[2]} colors, the frame {sizes[1]} with "
            f"{picture.shape[2]}",
            "give the empty scene as the same camera saw it",
        )
    gain = np.ones(picture.shape[2], dtype=np.float32)
    some = max(1, int(np.sqrt(picture[..., 0].size / EXPOSED)))
    seen, behind = picture[::some, ::some], background[::some, ::some]
    lit = over_colors(np.minimum, behind) > 0.05
    if lit.sum() > 100:
        gain = np.median(seen[lit] / behind[lit], axis=0)
        gain = np.where((gain > 0.5) & (gain < 2), gain, 1).astype(np.float32)
    expected = background * gain
    apart = over_colors(np.maximum, np.abs(picture - expected))
    if shadows and picture.shape[2] == 3:
        quotient = (picture + 0.02) / (expected + 0.02)
        darkest, brightest = (over_colors(f, quotient) for f in (np.minimum, np.maximum))
        shadow = (darkest > DEEPEST_SHADOW) & (brightest < 1) & (brightest - darkest < ALIKE)
        apart[shadow] = 0
    return np.asarray(apart, dtype=np.float32)
