"""From a picture of an endoscope to a mask: by the background, by color, or by edges."""

from .color import Box, Stroke
from .edges import edge_mask
from .segmenter import Eye, segmenter

__all__ = ["Box", "Eye", "Stroke", "edge_mask", "segmenter"]
