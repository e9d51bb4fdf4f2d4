"""Digital subtraction: what changed against a mask, as the object itself prescribes.

The standard subtracts logarithms (PS3.3 C.7.6.10); for pixels in proportion to the light that
is a quotient, which is again in proportion to the light that only the changed things let pass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage

from stereosom.arrays import Floats
from stereosom_plugin.acquisition import Image

from .header import Header, label

UNCHANGED = 1000.0  # what a pixel becomes where nothing changed
DARK = 1e-3  # what of the brightest is behind a shutter, where nothing can change
MOST_AVERAGED = 64


@dataclass(frozen=True)
class Subtraction:
    """One mask operation.

    Parameters
    ----------
    masks : dict of int to tuple of int
        The frames whose mean is the mask, for each frame to which the operation applies.
    shift : (float, float)
        By which the mask is moved, px: down, right.
    averaged : int
        How many frames from the contrast frame on are averaged.
    kept : dict
        The mask that was made last, by its frames: most operations have one for all.
    """

    masks: dict[int, tuple[int, ...]]
    shift: tuple[float, float] = (0.0, 0.0)
    averaged: int = 1
    kept: dict[tuple[int, ...], Floats] = field(default_factory=dict, compare=False, repr=False)

    def apply(self, read: Callable[[int], Image], frame: int) -> Image:
        """Divide a frame by its mask; `read` gives light, and frames are counted from zero."""
        contrast = _mean(read, range(frame, frame + self.averaged))
        mask = self._mask(read, self.masks[frame])
        lit = mask > DARK * mask.max()
        share = np.divide(contrast, mask, out=np.ones_like(mask), where=lit)
        return (UNCHANGED * np.maximum(share, 0)).astype(np.float32)

    def _mask(self, read: Callable[[int], Image], frames: tuple[int, ...]) -> Floats:
        if frames not in self.kept:
            mask = _mean(read, frames)
            if any(self.shift):
                mask = ndimage.shift(mask, self.shift, order=1, mode="nearest")
            self.kept.clear()
            self.kept[frames] = mask
        return self.kept[frames]


def read_subtractions(header: Header, frames: int) -> tuple[Subtraction, ...]:
    """Read the mask operations of an object.

    Raises
    ------
    InputError
        Where there are none, or they name frames that are not there.
    """
    items = header.items("MaskSubtractionSequence")
    read = tuple(operation for item in items if (operation := _operation(item, frames)) is not None)
    if not read:
        raise header.refuse(
            f"prescribes no subtraction ({label('MaskSubtractionSequence')})", "leave out --dsa"
        )
    return read


def _operation(item: Header, frames: int) -> Subtraction | None:
    operation = item.text("MaskOperation").upper()
    averaged = item.whole("ContrastFrameAveraging", 1)
    shift = item.numbers("MaskSubPixelShift") or (0.0, 0.0)
    if not 1 <= averaged <= MOST_AVERAGED or len(shift) != 2 or max(map(abs, shift)) > 1000:
        raise _unusable(item)
    bounds = [int(bound) for bound in item.numbers("ApplicableFrameRange")]
    if len(bounds) % 2:
        raise _unusable(item)
    pairs = list(zip(bounds[::2], bounds[1::2], strict=True)) or [(1, frames)]
    applicable = [
        frame
        for frame in range(1, frames - averaged + 2)
        if any(first <= frame <= last for first, last in pairs)
    ]
    offset = item.whole("TIDOffset", 1)
    if operation == "AVG_SUB":
        masks = tuple(int(number) for number in item.numbers("MaskFrameNumbers"))
        chosen = dict.fromkeys(applicable, masks)
        if not 1 <= len(masks) <= MOST_AVERAGED:
            raise _unusable(item)
    elif operation == "TID":
        chosen = {frame: (frame - offset,) for frame in applicable}
        if not bounds:  # "a range where the offset results in a valid frame number"
            chosen = {frame: mask for frame, mask in chosen.items() if 1 <= mask[0] <= frames}
    elif operation == "REV_TID":
        first = pairs[0][0]
        chosen = {frame: (first - offset - (frame - first),) for frame in applicable}
    elif operation == "NONE":
        return None
    else:
        raise item.refuse(
            f"its mask operation is {operation[:16]!r}, not AVG_SUB, TID or REV_TID",
            "leave out --dsa",
        )
    if any(not 1 <= mask <= frames for masks in chosen.values() for mask in masks):
        raise _unusable(item)
    return Subtraction(
        {frame - 1: tuple(mask - 1 for mask in masks) for frame, masks in chosen.items()},
        (shift[0], shift[1]),
        averaged,
    )


def _unusable(item: Header) -> Exception:
    return item.refuse(
        f"{label('MaskSubtractionSequence')} names frames or shifts that cannot be",
        "leave out --dsa",
    )


def _mean(read: Callable[[int], Image], frames: range | tuple[int, ...]) -> Floats:
    total: Floats = sum((read(frame).astype(np.float64) for frame in frames), start=np.zeros(()))
    return total / len(frames)
