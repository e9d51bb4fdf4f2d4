"""Lens distortion: from pixels as a picture shows them to those of a pinhole, and back.

`undistort` takes pixels of the picture to where an ideal camera of the same intrinsics would
show them; `distort` goes the other way. Each is the other's inverse to 1e-6 px, or says that it
has none there: far from the axis most models fold back, and nothing is meant by them.
"""

from __future__ import annotations

from .field import undistorted_field
from .fisheye import FisheyeLens
from .intensifier import IntensifierLens
from .mask import undistorted_mask_pixels
from .model import Lens
from .observation import undistorted_observation
from .radial_tangential import RadialTangentialLens

__all__ = [
    "FisheyeLens",
    "IntensifierLens",
    "Lens",
    "RadialTangentialLens",
    "undistorted_field",
    "undistorted_mask_pixels",
    "undistorted_observation",
]
