"""Run by ParaView's own Python: read our files, run our filter, print what ParaView made of them.

`pvpython paraview_run.py RUN_FOLDER MASK_FOLDER PLUGIN.py` prints one line of JSON.
"""

import inspect
import json
import sys
from pathlib import Path


def main(run, masks, plugin):
    """Print arrays of one file, the times of the series, and the filter's results."""
    # ParaView 5.11.0 asks for a function that Python 3.11 has dropped, and loads no plugin else.
    inspect.getargspec = getattr(inspect, "getargspec", inspect.getfullargspec)
    from paraview import servermanager, simple  # here: pytest imports this file without ParaView
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    def fetched(source, time=None):
        source.UpdatePipeline() if time is None else source.UpdatePipeline(time)
        return servermanager.Fetch(source)

    def length(data):
        array = data.GetCellData().GetArray("Length")
        return array.GetValue(0) if array else None

    def field(data, name):
        array = data.GetFieldData().GetAbstractArray(name)
        return array.GetVariantValue(0).ToString()

    seen = {}
    file = simple.XMLPolyDataReader(FileName=[f"{run}/centerline_0000.vtp"])
    data = fetched(file)
    points = data.GetPointData()
    seen["vtp"] = {
        "points": data.GetNumberOfPoints(),
        "arrays": {
            points.GetArrayName(i): points.GetArray(i).GetNumberOfComponents()
            for i in range(points.GetNumberOfArrays())
        },
        "active": [
            points.GetScalars().GetName(),
            points.GetVectors().GetName(),
            points.GetNormals().GetName(),
        ],
        "length": length(data),
        "SPACE": field(data, "SPACE"),
    }
    series = simple.PVDReader(FileName=f"{run}/centerlines.pvd")
    scene = simple.GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    times = list(series.TimestepValues)
    seen["pvd"] = {
        "times": times,
        "animation": [scene.StartTime, scene.EndTime],
        "lengths": [length(fetched(series, time)) for time in times],
    }

    simple.LoadPlugin(plugin, remote=False, ns=globals())
    views = []
    for name in "ab":
        files = sorted(str(path) for path in Path(masks).glob(f"{name}_*.png"))
        reader = simple.PNGSeriesReader(FileNames=files)
        if hasattr(reader, "ReadAsImageStack"):
            reader.ReadAsImageStack = 0
        views.append(reader)
    som = globals()["StereoSOM"](ViewA=views[0], ViewB=views[1], RigFile=f"{masks}/rig.json")
    som.UpdatePipelineInformation()
    information = som.GetClientSideObject().GetOutputInformation(0)
    times = list(information.Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()))
    seen["filter"] = {
        "times": times,
        "lengths": [length(fetched(som, time)) for time in times],
        "frames": [field(fetched(som, time), "Frame") for time in times],
    }
    som.Samples = 30
    seen["filter"]["samples"] = fetched(som, times[0]).GetNumberOfPoints()
    som.RigFile = "missing.json"
    seen["filter"]["refused"] = fetched(som, times[0]).GetNumberOfPoints()
    print(json.dumps(seen))


if __name__ == "__main__":
    main(*sys.argv[1:])
