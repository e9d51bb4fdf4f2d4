"""Biplane X-ray from DICOM: where the device lies, between the two pictures that show it."""

import sys
from pathlib import Path

import stereosom
from stereosom_plugin import fluoroscopy, render, segmentation

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
study = Path(__file__).parents[2] / "data" / "biplane"

# The planes come in either order; geometry, times and brightness are read from their headers.
acquisition = fluoroscopy.read_biplane(study / "plane_a.dcm", study / "plane_b.dcm")
observation = next(segmentation.observe(acquisition))
result = stereosom.reconstruct(observation)
print(f"{result.backbone.length:.1f} mm long, tip at {result.backbone.tip.round(1)} mm (LPS)")

# Each picture stands where its rays pass, so it still covers the device as seen from its source.
pictures = acquisition.read(result.index)
render.scene(result, observation.rig, output / "biplane.png", pictures, size=(800, 600))
