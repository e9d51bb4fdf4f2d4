"""How sure a result is: a stretch along an epipolar plane has no depth, and says so."""

import sys
from pathlib import Path

import numpy as np

import stereosom
from stereosom.synthetic import observe
from stereosom_plugin import render
from stereosom_plugin.experiments.mockup import overhead_rig
from stereosom_plugin.experiments.table1_figures import epipolar_curve

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")

# In its middle the curve runs from one camera towards the other: both see the same direction.
rig = overhead_rig()
result = stereosom.reconstruct(observe(epipolar_curve(), 1.5, rig))
s = result.backbone.arc_lengths(9)
for at, deviation in zip(s, result.standard_deviation_at(s), strict=True):
    print(f"at {at:5.1f} mm: ±{deviation:.2f} mm")
print(f"{np.mean(~result.determined_at(result.backbone.arc_lengths(200))):.0%} undetermined")

# Gray is what the views leave open: along that stretch the depth is anyone's guess.
picture = output / "uncertainty.png"
render.scene(result, rig, picture, color_by="StandardDeviation", view="best", size=(800, 600))
