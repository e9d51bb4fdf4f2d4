"""Stereo endoscopy: films or pictures of both eyes and a calibration -> Acquisition."""

from .layout import LAYOUTS, Layout
from .reading import read_stereo

__all__ = ["LAYOUTS", "Layout", "read_stereo"]
