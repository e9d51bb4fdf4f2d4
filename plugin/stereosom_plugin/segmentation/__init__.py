"""From a picture to a mask: which pixels show the device.

Any function that maps an image to a boolean mask of its size can stand in for
`segment_xray` in `observe`; `own.load_segmenter` finds one by name.
"""

from . import endoscope
from .binary import binary
from .biplane import BiplaneSegmenter
from .observing import Segment, Show, observe
from .outline import outline
from .picture import Mask
from .xray import segment_xray

__all__ = [
    "BiplaneSegmenter",
    "Mask",
    "Segment",
    "Show",
    "binary",
    "endoscope",
    "observe",
    "outline",
    "segment_xray",
]
