"""What can be chosen: one dataclass that feeds the panel, the run and its record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

SEGMENTERS = ("xray", "mask")
METHODS = ("joint-spline", "stereo-som")


@dataclass(frozen=True)
class Settings:
    """What is chosen for a run; zero stands for unknown, as in the panel.

    Parameters
    ----------
    segmenter : {'xray', 'mask'}
        Dark tubes in X-ray pictures, or pictures that are masks already (label maps, too).
    method : {'joint-spline', 'stereo-som'}
    radius, length : float
        Of the device, mm.
    samples : int
        Points of a centerline.
    rate : float
        Frames per second, for pictures that carry no times.
    """

    segmenter: str = "xray"
    method: str = "joint-spline"
    radius: float = 0.0
    length: float = 0.0
    samples: int = 200
    rate: float = 15.0

    def options(self) -> Any:
        """Options of the method, as the core takes them."""
        from stereosom.options import Options, Prior
        from stereosom.stereo_som import StereoSomOptions

        prior = Prior(length=self.length or None, radius=self.radius or None)
        return (StereoSomOptions if self.method == "stereo-som" else Options)(prior=prior)

    def segment(self) -> Any:
        """Image to mask."""
        from stereosom_plugin import segmentation

        return segmentation.binary if self.segmenter == "mask" else segmentation.segment_xray
