"""The whole search for a device in one picture, and what tells it from the rest: `Finder`."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from stereosom.arrays import Floats
from stereosom_plugin.errors import InputError

from ..loops import loops
from ..picture import Mask
from .color import SHADES, DeviceColor
from .difference import difference, plain_background
from .frame import Light
from .pieces import device_pixels, with_highlights
from .straight import Evidence, sample

# Of the full range of light: what differs from the background at least, and clearly.
LEAST, CLEAR = 0.08, 0.2
# The same in units of the picture's noise.
LEAST_NOISE, CLEAR_NOISE = 5.0, 12.0
# Logarithm of how much likelier a color is on the device: at least, and clearly.
LIKELY, VERY_LIKELY = 0.7, 2.0
# Greatest width of the device, as a share of the picture's longer side.
WIDEST = 0.05


class Finder(Protocol):
    """A way to tell the device from what is behind it.

    It is eager where its evidence takes a little of the device for all of it.
    """

    @property
    def eager(self) -> bool:
        """Whether it is."""

    def whole(self, picture: Light) -> tuple[Mask, Evidence]:
        """Its pixels in the whole picture, and what its edges are to be found by."""

    def learned(self, picture: Light, mask: Mask) -> Evidence:
        """What tells it from the rest, where the first search found it rightly."""


class ByColor:
    """What has a color that was learned from a sample."""

    eager = False

    def __init__(self, color: DeviceColor, channels: int, width_px: float | None) -> None:
        self.color, self.channels, self.width_px = color, channels, width_px

    def whole(self, picture: Light) -> tuple[Mask, Evidence]:
        """As `Finder.whole`."""
        if picture.shape[2] != self.channels:
            raise InputError("picture", "has other colors than the example", "give one like it")
        return _of_color(self.color, picture, self.width_px), color_evidence(self.color)

    def learned(self, picture: Light, mask: Mask) -> Evidence:
        """As `Finder.learned`: the device's other colors, its shaded side, too."""
        return color_evidence(DeviceColor(picture, mask))


class Before:
    """What differs from a background: one that is given, or the surroundings."""

    def __init__(self, background: Light | None, width_px: float | None) -> None:
        self.background, self.width_px = background, width_px
        self.eager = background is not None

    def whole(self, picture: Light) -> tuple[Mask, Evidence]:
        """As `Finder.whole`."""
        width = greatest_width(picture, self.width_px)
        behind = plain_background(picture) if self.background is None else self.background
        apart = difference(picture, behind)
        noise = 1.4826 * float(np.median(apart[::2, ::2]))
        low, high = max(LEAST, LEAST_NOISE * noise), max(CLEAR, CLEAR_NOISE * noise)
        mask = with_highlights(device_pixels(apart, low, high, width), picture, behind, width)
        if not mask.any():
            return mask, color_evidence(None)
        return mask, self.learned(picture, mask)

    def learned(self, picture: Light, mask: Mask) -> Evidence:
        """As `Finder.learned`."""
        color = DeviceColor(picture, mask)
        if self.background is None:
            return color_evidence(color)
        background = self.background

        def both(picture: Any, x: Floats, y: Floats) -> Floats:
            seen, behind = sample(picture, x, y) / np.float32(255), sample(background, x, y)
            # Where a thin line goes on, it is no shadow.
            differs = np.clip(difference(seen, behind, shadows=False) / LEAST - 1, -1, 1)
            like_it = _likeness(color, seen)
            # Before what has its own color, a device may make no difference, and its color proves
            # none, unless it has both sides there: the stub that the empty scene shows as well.
            alike = np.clip(_likeness(color, behind), 0, 1)
            narrow = np.mean(like_it < 0, axis=1, keepdims=True) > 0.5
            unchanged = np.where(narrow, np.clip(like_it / 2, 0, 1), 0)
            both_say = (differs + like_it) / 2
            return np.asarray((1 - alike) * both_say + alike * np.maximum(differs, unchanged))

        return both


def color_evidence(color: DeviceColor | None) -> Evidence:
    """Evidence of a color's likelihood; none for none."""
    if color is None:
        return lambda picture, x, y: np.zeros(x.shape)
    table = np.clip(color.log_quotient.ravel() / VERY_LIKELY, -1, 1)

    def evidence(picture: Any, x: Floats, y: Floats) -> Floats:
        if SHADES ** picture.shape[2] != len(table):
            raise InputError("picture", "has other colors than those before", "give one like them")
        return np.asarray(loops().likeness(picture, x, y, table, SHADES))

    return evidence


def _likeness(color: DeviceColor, seen: Light) -> Floats:
    """From -1, surely something else, to 1, surely the device."""
    return np.asarray(np.clip(color(seen) / VERY_LIKELY, -1, 1))


def _of_color(color: DeviceColor, picture: Light, width_px: float | None) -> Mask:
    width = greatest_width(picture, width_px)
    likely = np.maximum(color(picture), 0)
    mask = device_pixels(likely, LIKELY, VERY_LIKELY, width)
    return with_highlights(mask, picture, plain_background(picture), width)


def greatest_width(picture: Light, width_px: float | None) -> int:
    """Of the device, px."""
    return max(3, round(WIDEST * max(picture.shape[:2]) if width_px is None else width_px))
