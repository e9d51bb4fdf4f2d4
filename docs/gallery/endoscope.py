"""A stereo endoscope: two eyes close together, a device before an even background.

The pictures are drawn by VTK, with the blur and noise of a sensor, so that the truth is known.
"""

import sys
from pathlib import Path

import numpy as np

import stereosom
from stereosom.metrics import curve_errors
from stereosom.synthetic import arc, converging_rig
from stereosom_plugin import render, segmentation
from stereosom_plugin.experiments.mockup import photograph

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# Eyes 5 mm apart, 50 mm before a device of 1.5 mm that bends by 90°, partly towards them.
turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
truth = arc(radius=18, angle_deg=90).transformed(turn, np.zeros(3))
rig = converging_rig(5.7, 50, 1100, image_size=(1280, 720), target=(5, 7, 9))
left, right = (photograph(truth, 0.75, eye, seed=i) for i, eye in enumerate((rig.a, rig.b)))

segment_left, segment_right = segmentation.endoscope.segmenter()
masks = segment_left(left), segment_right(right)
observation = stereosom.Observation.from_masks(*masks, rig)
result = stereosom.reconstruct(observation)
print(f"mean error {curve_errors(result.backbone, truth).mean:.2f} mm")
print(f"standard deviation {result.standard_deviation_at(np.array([10.0]))[0]:.2f} mm")

views = [
    render.overlaid(
        render.Overlay(picture, eye, result.backbone.sample(200), title=title), size=(448, 252)
    )
    for picture, eye, title in ((left, rig.a, "left eye"), (right, rig.b, "right eye"))
]
render.write_picture(render.beside(views), output / "endoscope.png")
