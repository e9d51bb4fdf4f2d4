"""Run by 3D Slicer's own Python: draw results in Slicer's own views, without a window.

`python slicer_views.py PLANE_A.dcm PLANE_B.dcm PICTURE.png` makes the picture of
docs/in-slicer.md: the two slice views and the 3D view as the module Stereo SOM sets them up.
"""

import sys

WIDTH, HEIGHT = 420, 420


def main(plane_a, plane_b, picture):
    # Here, not above: pytest imports this file too, with a Python that has no Slicer.
    import numpy as np
    import slicer
    from slicer_module import browsed, sequence
    from trame_slicer.core import SlicerApp
    from trame_slicer.views import NoScheduleRendering, SliceView, ThreeDView
    from vtk.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkRenderingCore import vtkWindowToImageFilter

    from stereosom_plugin.fluoroscopy import read_biplane
    from StereoSOMLib import run, showing
    from StereoSOMLib.settings import Settings

    application = SlicerApp()
    scene = application.scene
    sequences = application.register_module_logic(slicer.vtkSlicerSequencesLogic())
    views = [
        SliceView(scene, application.app_logic, tag, NoScheduleRendering())
        for tag in showing.SLICE_VIEWS
    ]
    views.append(ThreeDView(scene, application.app_logic, "1", NoScheduleRendering()))
    acquisition = read_biplane(plane_a, plane_b)
    files = dict(zip(acquisition.source_uids, (plane_a, plane_b), strict=True))
    shown = browsed(
        scene,
        [
            sequence(
                scene,
                [acquisition.read(i)[n].astype(np.float32) for i in range(len(acquisition))],
                [f"{time:.3f}" for time in acquisition.times],
                uid,
            )
            for n, uid in enumerate(acquisition.source_uids)
        ],
    )
    settings = Settings()
    source = run.open_source(scene, *shown, "", settings, files.get)
    results, reconstructed = run.reconstruct(scene, source, settings)
    next(reconstructed)
    sequences.UpdateProxyNodesFromSequences(results.browser)
    showing.show(scene, results)
    drawn = []
    for view in views:
        view.render_window().SetSize(WIDTH, HEIGHT)
        view.fit_view_to_content()
        if isinstance(view, ThreeDView):
            view.get_view_node().SetBoxVisible(False)
            view.get_view_node().SetAxisLabelsVisible(False)
            view.renderer().ResetCamera(results.models[0].GetPolyData().GetBounds())
        view.render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(view.render_window())
        grab.ReadFrontBufferOff()
        grab.Update()
        image = grab.GetOutput()
        columns, rows, _ = image.GetDimensions()
        pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(rows, columns, -1)
        drawn.append(pixels[::-1, :, :3])
    from PIL import Image

    Image.fromarray(np.hstack(drawn)).save(picture, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
