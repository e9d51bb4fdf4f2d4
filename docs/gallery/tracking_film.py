"""A run over time: every frame leans on the one before; a film, and its last picture."""

import sys
from pathlib import Path

import stereosom
from stereosom_plugin import fluoroscopy, polydata, render, segmentation

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
study = Path(__file__).parents[2] / "data" / "biplane"

acquisition = fluoroscopy.read_biplane(study / "plane_a.dcm", study / "plane_b.dcm")
lines = []
for result in stereosom.track(segmentation.observe(acquisition)):
    print(f"{result.time:.3f} s  {result.status}  tip {result.backbone.tip.round(2)} mm")
    lines.append(polydata.to_centerline(result))

# One stage for the whole film, so that the eye and the colors stay where they are.
pictures = []
with render.Stage(render.survey(lines, "Time"), acquisition.rig(0), size=(640, 480)) as stage:
    for number, line in enumerate(lines):
        rig = acquisition.rig(number)
        images, past = acquisition.read(number), tuple(lines[:number])
        shot = render.Shot(line, rig, images, past, render.heading(line, rig))
        pictures.append(stage.draw(shot))
render.write_film(pictures, output / "tracking_film.mp4", fps=3)
render.write_picture(pictures[-1], output / "tracking_film.png")
