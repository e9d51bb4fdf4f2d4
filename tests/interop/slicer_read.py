"""Run by 3D Slicer's own Python: read a model and a curve, print what Slicer made of them.

`python slicer_read.py CENTERLINE.vtp CURVE.mrk.json` prints one line of JSON.
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


def main(model_path, curve_path):
    """Print what is in memory after reading: coordinates are RAS."""
    # Here, not above: pytest imports this file too, with a Python that has no Slicer.
    import slicer
    from vtk import vtkOutputWindow, vtkStringOutputWindow
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
    print(json.dumps({"model": seen, "curve": seen_curve, "vtk": window.GetOutput()}))


if __name__ == "__main__":
    main(*sys.argv[1:])
