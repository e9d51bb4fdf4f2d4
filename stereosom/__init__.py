"""Two views of a thin flexible device in, its 3D backbone out.

Four words to learn: a `Camera` and the `StereoRig` of two, an `Observation` of what both saw,
the `Backbone` that is found, and the `Reconstruction` that says how sure it is.
"""

from .backbone import Backbone
from .camera import Camera, StereoRig, triangulate
from .joint_spline import JointSplineOptions
from .observation import Observation
from .options import Options, Prior
from .reconstruct import DEFAULT_METHOD, METHODS, reconstruct, track
from .reconstruction import Reconstruction
from .stereo_som import StereoSomOptions

__all__ = [
    "DEFAULT_METHOD",
    "METHODS",
    "Backbone",
    "Camera",
    "JointSplineOptions",
    "Observation",
    "Options",
    "Prior",
    "Reconstruction",
    "StereoRig",
    "StereoSomOptions",
    "reconstruct",
    "track",
    "triangulate",
]
