"""Hand a result to ParaView, 3D Slicer, Blender and a browser; see it as plain VTK sees it."""

import sys
from pathlib import Path

import pyvista

import stereosom
from stereosom_plugin import exports, fluoroscopy, offscreen, polydata, segmentation

output = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
study = Path(__file__).parents[2] / "data" / "biplane"

acquisition = fluoroscopy.read_biplane(study / "plane_a.dcm", study / "plane_b.dcm")
result = stereosom.reconstruct(next(segmentation.observe(acquisition)))
polydata.write_vtp(result, output / "centerline_0000.vtp")
polydata.write_pvd([(result.time, "centerline_0000.vtp")], output / "centerlines.pvd")  # ParaView
for name in ("curve.mrk.json", "run.seq.mrb", "run.glb", "run.html"):  # 3D Slicer, Blender, browser
    exports.export([polydata.to_centerline(result)], output / name)
    print(f"{name}: {exports.SUFFIXES['.' + name.partition('.')[2]]}")

# Any VTK reader takes it from here: a tube as thick as the device, and its normals.
line = pyvista.read(output / "centerline_0000.vtp")
normals = line.glyph(orient="ParallelTransportNormals", scale=False, factor=5, tolerance=0.06)
offscreen.prepare()
plotter = pyvista.Plotter(off_screen=True, window_size=(800, 600))
bar = {"title": "Curvature (1/mm)", "color": "black"}
tube = line.tube(absolute=True, scalars="Radius")
plotter.add_mesh(tube, scalars="Curvature", scalar_bar_args=bar)
plotter.add_mesh(normals, color="gray")
plotter.show_axes()
plotter.camera_position = "xz"
plotter.screenshot(output / "other_programs.png")
