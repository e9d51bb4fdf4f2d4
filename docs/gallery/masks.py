"""Masks of your own: two pictures that are white on the device, and where the cameras stood."""

import sys
from pathlib import Path

from PIL import Image

import stereosom
from stereosom.synthetic import converging_rig, growing_helix, silhouette
from stereosom_plugin import masks, polydata, render, segmentation

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# The mock-up of the 2010 paper: a helix of 239 mm, 6.4 mm thick, seen by two cameras 45° apart.
rig = converging_rig(45)
for name, camera in (("a", rig.a), ("b", rig.b)):
    Image.fromarray(silhouette(growing_helix(), 3.2, camera)).save(output / f"mask_{name}.png")

# From here on as with any two pictures; --rig of `stereosom masks` reads calibrations instead.
acquisition = masks.read_masks(output / "mask_a.png", output / "mask_b.png", (rig,))
result = stereosom.reconstruct(next(segmentation.observe(acquisition, segmentation.binary)))
print(f"{result.backbone.length:.1f} mm of 239 mm")

line = polydata.to_centerline(result)
views = [
    render.overlaid(render.Overlay.of(line, picture, camera, view, f"view {view}"), size=(448, 336))
    for picture, camera, view in zip(acquisition.read(0), (rig.a, rig.b), "ab", strict=True)
]
render.write_picture(render.beside(views), output / "masks.png")
