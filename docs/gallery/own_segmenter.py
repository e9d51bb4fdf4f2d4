"""Your own segmentation: any function that turns a picture into a mask of its size will do."""

import sys
from pathlib import Path

import numpy as np
from skimage import filters, measure

import stereosom
from stereosom_plugin import fluoroscopy, polydata, render, segmentation

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
study = Path(__file__).parents[2] / "data" / "biplane"


def longest_dark_ridge(image):
    """Dark lines by the Sato filter of scikit-image; of those, the one that reaches farthest."""
    ridges = filters.sato(np.log1p(image.astype(float)), sigmas=[2, 3], black_ridges=True)
    low, high = np.quantile(ridges, [0.97, 0.995])
    parts = measure.label(filters.apply_hysteresis_threshold(ridges, low, high))
    longest = max(measure.regionprops(parts), key=lambda part: part.feret_diameter_max)
    return parts == longest.label


# The same function is named on the command line by --segmenter own_segmenter:longest_dark_ridge.
acquisition = fluoroscopy.read_biplane(study / "plane_a.dcm", study / "plane_b.dcm")
seen = next(segmentation.observe(acquisition, longest_dark_ridge))
result = stereosom.reconstruct(seen)
print(f"{result.status} {result.reason}")

line = polydata.to_centerline(result) if result.ok else None
views = []
for view, image in zip("ab", acquisition.read(0), strict=True):
    camera, pixels = getattr(seen.rig, view), getattr(seen, f"pixels_{view}")
    shown = render.Overlay.of(line, image, camera, view, f"view {view}", pixels)
    views.append(render.overlaid(shown, size=(400, 400)))
render.write_picture(render.beside(views), output / "own_segmenter.png")
