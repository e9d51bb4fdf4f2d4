"""Where the two views stand: `Camera`, `StereoRig`, triangulation, epipolar geometry.

World points are in mm. Pixels are points (x right, y down); the centre of the top-left
pixel is (0, 0). Formulas: R. Hartley, A. Zisserman, "Multiple View Geometry in Computer
Vision", 2nd edition, chapters 6 (camera), 9 (epipolar geometry), 12 (triangulation).
"""

from .projection import Camera
from .rig import Frame, StereoRig, triangulate

__all__ = ["Camera", "Frame", "StereoRig", "triangulate"]
