"""From a picture to a mask: which pixels show the device.

Any function that maps an image to a boolean mask of its size can stand in for
`segment_xray` in `observe`; `own.load_segmenter` finds one by name.
"""

from typing import Any

from . import endoscope
from .binary import binary
from .biplane import BiplaneSegmenter
from .mask_files import MaskFiles
from .observing import Segment, Segmentation, Show, observe
from .outline import outline
from .picture import Mask
from .xray import segment_xray

__all__ = [
    "BiplaneSegmenter",
    "Mask",
    "MaskFiles",
    "Segment",
    "Segmentation",
    "Show",
    "binary",
    "endoscope",
    "is_own",
    "observe",
    "outline",
    "segment_xray",
]


def is_own(segment: Any) -> bool:
    """Whether what segments is this package's own alone: no model, no function of a user's."""
    pair = segment if isinstance(segment, tuple) else (segment,)
    return all(one is segment_xray or isinstance(one, (endoscope.Eye, MaskFiles)) for one in pair)
