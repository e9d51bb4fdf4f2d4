"""Run by 3D Slicer's own Python: the module's logic on real MRML nodes, step by step.

`python slicer_module.py JOB FOLDER [FILES]` prints one line of JSON. There is no Qt and no
application here; the scene, its nodes and the logic of sequences are Slicer's.
"""

import json
import sys
from pathlib import Path


def new_scene():
    """Make a scene in which sequence browsers drive what they show."""
    import slicer

    scene, logic = slicer.vtkMRMLScene(), slicer.vtkSlicerSequencesLogic()
    logic.SetMRMLScene(scene)
    scene.RegisterNodeClass(slicer.vtkMRMLMarkupsJsonStorageNode())  # the Markups module's part
    for tag in ("Red", "Yellow"):
        for kind in (slicer.vtkMRMLSliceNode, slicer.vtkMRMLSliceCompositeNode):
            node = kind()
            node.SetSingletonTag(tag)
            if hasattr(node, "SetLayoutName"):
                node.SetLayoutName(tag)
            scene.AddNode(node)
    return scene, logic


def sequence(scene, pictures, times, uid=""):
    """Make a sequence of pictures as the DICOM module makes it, without its browser."""
    import slicer

    from StereoSOMLib.example import image_data

    node = scene.AddNewNodeByClass("vtkMRMLSequenceNode", "pictures")
    node.SetIndexName("time")
    node.SetIndexUnit("s")
    volume = slicer.vtkMRMLScalarVolumeNode()
    volume.SetIJKToRASDirections(-1, 0, 0, 0, -1, 0, 0, 0, 1)
    volume.SetSpacing(0.3, 0.25, 1)
    volume.SetOrigin(10, 20, 30)
    if uid:
        volume.SetAttribute("DICOM.instanceUIDs", uid)
    for picture, time in zip(pictures, times, strict=True):
        volume.SetAndObserveImageData(image_data(picture))
        node.SetDataNodeAtValue(volume, time)
    return node


def browsed(scene, sequences):
    """What slice views show of sequences: the volumes that a user sees and chooses."""
    browser = scene.AddNewNodeByClass("vtkMRMLSequenceBrowserNode", "loader")
    for node in sequences:
        browser.AddSynchronizedSequenceNode(node)
    return [browser.GetProxyNode(node) for node in sequences]


def points_of(model):
    from vtk.util.numpy_support import vtk_to_numpy

    points = model.GetPolyData().GetPoints()
    return vtk_to_numpy(points.GetData()).tolist() if points else []


def arrays_of(polydata):
    from vtk.util.numpy_support import vtk_to_numpy

    data = polydata.GetPointData()
    return {
        data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)).tolist()
        for i in range(data.GetNumberOfArrays())
    }


def table_of(node):
    table = node.GetTable()
    return [
        [table.GetValue(row, column).ToString() for column in range(table.GetNumberOfColumns())]
        for row in range(table.GetNumberOfRows())
    ]


def sum_of(volume):
    from vtk.util.numpy_support import vtk_to_numpy

    return int(vtk_to_numpy(volume.GetImageData().GetPointData().GetScalars()).astype(int).sum())


def masks(folder):
    """Three frames of masks: an empty picture, a quarter circle, a larger quarter circle."""
    import numpy as np

    from stereosom.synthetic import arc, converging_rig, silhouette
    from stereosom_plugin.calibration import write_rig
    from StereoSOMLib import run, showing
    from StereoSOMLib.settings import Settings

    scene, logic = new_scene()
    rig = converging_rig(60, focal_length=1200, image_size=(512, 384))
    write_rig([rig], folder / "rig.json")
    curves = [None, arc(60, 90), arc(66, 90)]
    pictures = [
        [
            np.zeros(camera.image_size[::-1], bool) if c is None else silhouette(c, 1.0, camera)
            for c in curves
        ]
        for camera in (rig.a, rig.b)
    ]
    # The clock of view b is off: its pictures are paired by number.
    times = ["0.000", "0.067", "0.133"], ["0.010", "0.060", "0.120"]
    shown = browsed(
        scene, [sequence(scene, *of_view) for of_view in zip(pictures, times, strict=True)]
    )
    settings = Settings(segmenter="mask", samples=50)
    rig_file = str(folder / "rig.json")
    source = run.open_source(scene, *shown, rig_file, settings, lambda uid: None)
    results, frames = run.reconstruct(scene, source, settings)
    lines = [run.line_of(result) for result in frames]
    showing.show(scene, results)
    logic.UpdateProxyNodesFromSequences(results.browser)
    seen = {"lines": lines, "table": table_of(results.table), "frames": []}
    for number in range(3):  # the user scrubs
        results.browser.SetSelectedItemNumber(number)
        seen["frames"].append(
            {
                "points": [points_of(model) for model in results.models],
                "pictures": [sum_of(volume) for volume in results.shown],
            }
        )
    seen["wanted_pictures"] = [[int(p[n].sum()) for p in pictures] for n in range(3)]
    seen["times"] = [results.curve.GetNthIndexValue(i) for i in range(3)]
    seen["own"] = [a.GetID() == b.GetID() for a, b in zip(shown, results.shown, strict=True)]
    seen["unit"] = [results.curve.GetIndexName(), results.curve.GetIndexUnit()]
    seen["fps"] = results.browser.GetPlaybackRateFps()
    seen["displays"] = [
        {
            "3d": bool(model.GetDisplayNode().GetVisibility3D()),
            "2d": bool(model.GetDisplayNode().GetVisibility2D()),
            "mode": model.GetDisplayNode().GetSliceDisplayModeAsString(
                model.GetDisplayNode().GetSliceDisplayMode()
            ),
            "views": [scene.GetNodeByID(i).GetSingletonTag() for i in views_of(model)],
        }
        for model in results.models
    ]
    seen["backgrounds"] = [
        scene.GetSingletonNode(tag, "vtkMRMLSliceCompositeNode").GetBackgroundVolumeID()
        == v.GetID()
        for tag, v in zip(("Red", "Yellow"), results.shown, strict=True)
    ]
    # The model in the scene, and what Slicer's own reader makes of our file of the same frame.
    run.export(results, settings, folder / "out")
    storage = scene.AddNewNodeByClass("vtkMRMLModelStorageNode")
    storage.SetFileName(str(folder / "out" / "centerline_0002.vtp"))
    read = scene.AddNewNodeByClass("vtkMRMLModelNode")
    assert storage.ReadData(read)
    results.browser.SetSelectedItemNumber(2)
    seen["arrays"] = arrays_of(results.models[0].GetPolyData())
    seen["arrays_read"] = arrays_of(read.GetPolyData())
    seen["points_read"] = points_of(read)

    def load(path):
        curve = scene.AddNewNodeByClass("vtkMRMLMarkupsCurveNode")
        storage = scene.AddNewNodeByClass("vtkMRMLMarkupsJsonStorageNode")
        storage.SetFileName(path)
        assert storage.ReadData(curve)
        return curve

    curve = run.load_editable(results, load)
    last = curve.GetNumberOfControlPoints() - 1
    seen["edited"] = [
        list(curve.GetNthControlPointPositionWorld(0)),
        list(curve.GetNthControlPointPositionWorld(last)),
    ]
    results.browser.SetSelectedItemNumber(0)
    try:
        run.load_editable(results, load)
    except ValueError as error:
        seen["edit_refused"] = str(error)
    return seen


def views_of(model):
    display = model.GetDisplayNode()
    return [display.GetNthViewNodeID(i) for i in range(display.GetNumberOfViewNodeIDs())]


def dicom(folder, plane_a, plane_b):
    """The study that ships, its planes chosen in the wrong order, two frames dropped from b."""
    from stereosom_plugin.fluoroscopy import read_biplane
    from StereoSOMLib import run
    from StereoSOMLib.settings import Settings

    acquisition = read_biplane(plane_a, plane_b)
    files = dict(zip(acquisition.source_uids, (plane_a, plane_b), strict=True))
    times = [f"{time:.3f}" for time in acquisition.times]
    scene, logic = new_scene()
    sequences = [
        sequence(scene, [acquisition.read(i)[n] for i in range(len(times))], times, uid)
        for n, uid in enumerate(acquisition.source_uids)
    ]
    a, b = browsed(scene, sequences)
    settings = Settings(samples=100)
    source = run.open_source(scene, b, a, "", settings, files.get)
    results, frames = run.reconstruct(scene, source, settings)
    seen = {"views": [view.shown.GetID() for view in source.views], "ids": [a.GetID(), b.GetID()]}
    first = next(frames)
    logic.UpdateProxyNodesFromSequences(results.browser)
    seen["points"] = [points_of(model) for model in results.models]
    seen["status"] = first.status
    run.export(results, settings, folder / "out")
    return seen


def refusals(folder):
    """What cannot be used is refused in one line: what, why, how to mend it."""
    import numpy as np
    import slicer

    from StereoSOMLib import run
    from StereoSOMLib.example import quarter_circle, volume
    from StereoSOMLib.settings import Settings

    scene, _ = new_scene()
    a, b = quarter_circle(scene, folder / "rig.json")
    rig = str(folder / "rig.json")
    empty = scene.AddNewNodeByClass("vtkMRMLSequenceNode", "empty")
    bare = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "bare")
    of_models = scene.AddNewNodeByClass("vtkMRMLSequenceNode", "models")
    of_models.SetDataNodeAtValue(slicer.vtkMRMLModelNode(), "0")
    small = volume(scene, np.zeros((20, 30), bool), "small")
    two = sequence(scene, [np.zeros((768, 1024), bool)] * 2, ["0", "1"])
    unknown = sequence(scene, [np.zeros((8, 8), bool)], ["0"], "1.2.3")
    said = {}
    for name, nodes, file in (
        ("nothing", (None, b), rig),
        ("no frames", (empty, b), rig),
        ("no pixels", (a, bare), rig),
        ("models", (a, of_models), rig),
        ("size", (small, b), rig),
        ("count", (a, two), rig),
        ("no rig", (a, b), ""),
        ("no such rig", (a, b), str(folder / "missing.json")),
        ("not in the database", (unknown, unknown), ""),
    ):
        try:
            run.open_source(scene, *nodes, file, Settings(), lambda uid: None)
        except ValueError as error:
            said[name] = str(error)
    return said


def main(job, folder, *files):
    jobs = {"masks": masks, "dicom": dicom, "refusals": refusals}
    print(json.dumps(jobs[job](Path(folder), *files)))


if __name__ == "__main__":
    main(*sys.argv[1:])
