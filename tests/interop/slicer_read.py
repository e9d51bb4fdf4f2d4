"""Run by 3D Slicer's own Python: read our files, print what Slicer made of them, write them again.

`python slicer_read.py CENTERLINE.vtp CURVE.mrk.json [FOLDER SEQUENCE...]` prints one line of
JSON; what Slicer writes goes into FOLDER.
"""

import json
import sys


def read(scene, node_class, storage_class, path):
    """Read a file as the application does: a node, its storage node, the message list."""
    node, storage = scene.AddNewNodeByClass(node_class), scene.AddNewNodeByClass(storage_class)
    storage.SetFileName(path)
    read = storage.ReadData(node)
    messages = storage.GetUserMessages()
    told = [messages.GetNthMessageText(i) for i in range(messages.GetNumberOfMessages())]
    return node, {"read": bool(read), "messages": told}


def write(scene, node, storage_class, path):
    """Write a node as the application does."""
    storage = scene.AddNewNodeByClass(storage_class)
    storage.SetFileName(path)
    written = bool(storage.WriteData(node))
    messages = storage.GetUserMessages()
    return written, [messages.GetNthMessageText(i) for i in range(messages.GetNumberOfMessages())]


def read_sequence(scene, path, folder):
    """Read a sequence, and say what each of its times holds."""
    import slicer
    from vtk.util.numpy_support import vtk_to_numpy

    # The application has such a cache; bundles are unpacked into it.
    manager, cache = slicer.vtkDataIOManager(), slicer.vtkCacheManager()
    cache.SetRemoteCacheDirectory(folder)
    manager.SetCacheManager(cache)
    scene.SetDataIOManager(manager)
    node, seen = read(scene, "vtkMRMLSequenceNode", "vtkMRMLSequenceStorageNode", path)
    models = [node.GetNthDataNode(i) for i in range(node.GetNumberOfDataNodes())]
    return node, seen | {
        "index": [node.GetIndexName(), node.GetIndexUnit(), node.GetIndexTypeAsString()],
        "times": [node.GetNthIndexValue(i) for i in range(len(models))],
        "classes": [model.GetClassName() for model in models],
        "points": [vtk_to_numpy(m.GetPolyData().GetPoints().GetData()).tolist() for m in models],
        "arrays": [m.GetPolyData().GetPointData().GetNumberOfArrays() for m in models],
    }


def rewritten(scene, node, folder):
    """Write a sequence both ways, and read back what was written."""
    seen = []
    for name in ("again.seq.mrb", "again.seq.mrml"):
        path = f"{folder}/{name}"
        written, messages = write(scene, node, "vtkMRMLSequenceStorageNode", path)
        seen.append({"written": written, "messages": messages})
        if written:
            seen[-1] |= read_sequence(scene, path, folder)[1] | {"messages": messages}
    return seen


def main(model_path, curve_path, folder=None, *sequence_paths):
    """Print what is in memory after reading: coordinates are RAS."""
    # Here, not above: pytest imports this file too, with a Python that has no Slicer.
    import slicer
    from vtk import vtkObject, vtkOutputWindow, vtkStringOutputWindow
    from vtk.util.numpy_support import vtk_to_numpy

    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    scene = slicer.vtkMRMLScene()
    scene.RegisterNodeClass(slicer.vtkMRMLMarkupsJsonStorageNode())  # the Markups module's part

    model, seen = read(scene, "vtkMRMLModelNode", "vtkMRMLModelStorageNode", model_path)
    polydata = model.GetPolyData()
    point_data = polydata.GetPointData()
    active = {
        "scalars": point_data.GetScalars(),
        "vectors": point_data.GetVectors(),
        "normals": point_data.GetNormals(),
    }
    seen |= {
        "points": vtk_to_numpy(polydata.GetPoints().GetData()).tolist(),
        "lines": polydata.GetNumberOfLines(),
        "active": {kind: array.GetName() for kind, array in active.items()},
        "arrays": {
            point_data.GetArrayName(i): vtk_to_numpy(point_data.GetArray(i)).tolist()
            for i in range(point_data.GetNumberOfArrays())
        },
    }

    curve, seen_curve = read(
        scene, "vtkMRMLMarkupsCurveNode", "vtkMRMLMarkupsJsonStorageNode", curve_path
    )
    seen_curve |= {
        "points": [
            list(curve.GetNthControlPointPositionWorld(i))
            for i in range(curve.GetNumberOfControlPoints())
        ],
        "labels": [
            curve.GetNthControlPointLabel(i) for i in range(curve.GetNumberOfControlPoints())
        ],
        "length": curve.GetCurveLengthWorld(),
        "measurements": [
            curve.GetNthMeasurement(i).GetName() for i in range(curve.GetNumberOfMeasurements())
        ],
    }
    everything = {"model": seen, "curve": seen_curve, "vtk": window.GetOutput()}
    if folder:
        read_ones = [read_sequence(scene, path, folder) for path in sequence_paths]
        everything["sequences"] = [seen for _, seen in read_ones]
        vtkObject.GlobalWarningDisplayOff()  # this scene has no unit nodes, and editing misses them
        everything["vtk"] = window.GetOutput()  # of reading; zips are written with many words
        everything["rewritten"] = rewritten(scene, read_ones[0][0], folder) if read_ones else []
        written = [write(scene, model, "vtkMRMLModelStorageNode", f"{folder}/lps.vtp")[0]]
        storage = scene.AddNewNodeByClass("vtkMRMLModelStorageNode")
        storage.SetCoordinateSystem(slicer.vtkMRMLStorageNode.CoordinateSystemRAS)
        storage.SetFileName(f"{folder}/ras.vtp")
        written.append(bool(storage.WriteData(model)))
        curve.SetNthControlPointPositionWorld(1, 1.0, 2.0, 3.0)  # the user drags a point
        json_class = "vtkMRMLMarkupsJsonStorageNode"
        written.append(write(scene, curve, json_class, f"{folder}/moved.mrk.json")[0])
        everything["written"] = written
    print(json.dumps(everything))


if __name__ == "__main__":
    main(*sys.argv[1:])
