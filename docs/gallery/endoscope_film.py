"""A stereo endoscope's film: the curve as the left eye sees it, and how sure it is, from aside."""

import sys
from pathlib import Path

import numpy as np

import stereosom
from stereosom_plugin import endoscopy, polydata, render, segmentation

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
film = Path(__file__).parents[2] / "data" / "endoscope"

acquisition = endoscopy.read_stereo(
    film / "left.mp4", film / "right.mp4", film / "calibration.yaml", check=False
)
segmenter = segmentation.endoscope.segmenter()
lines = []
for result in stereosom.track(segmentation.observe(acquisition, segmenter, frames=range(10))):
    lines.append(polydata.to_centerline(result))
    sigma = np.median(lines[-1].arrays["StandardDeviation"])
    print(f"{result.time:.2f} s  {result.backbone.length:.1f} mm, known to {sigma:.2f} mm")

rig, lens = acquisition.rig(0), acquisition.lenses[0]
pictures = []
# Depth, which eyes 5 mm apart tell least of, shows from aside: a halo of two deviations.
told = render.survey(lines, "StandardDeviation")
with render.Stage(told, rig, view="best", size=(448, 336)) as stage:
    for number, line in enumerate(lines):
        image = acquisition.read(number)[0]
        over = render.Overlay.of(line, image, rig.a, "a", f"{line.time:.2f} s", lens=lens)
        aside = stage.draw(render.Shot(line, rig))
        pictures.append(render.beside([render.overlaid(over, size=(448, 336)), aside]))
render.write_film(pictures, output / "endoscope_film.mp4", fps=6)
render.write_picture(pictures[-1], output / "endoscope_film.png")
