"""Run by a Python that has VMTK: measure a centerline with VMTK's own filters, print what it found.

`python vmtk_run.py CENTERLINE.vtp` prints one line of JSON.
"""

import json
import sys


def main(path):
    """Print VMTK's geometry and attributes of the line."""
    from vmtk import vmtkscripts
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    reader = vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    line = reader.GetOutput()
    # So that nothing which is found is what we wrote.
    for name in ("Curvature", "Torsion", "FrenetTangent", "Abscissas", "ParallelTransportNormals"):
        line.GetPointData().RemoveArray(name)
    for name in ("Length", "Tortuosity"):
        line.GetCellData().RemoveArray(name)

    geometry = vmtkscripts.vmtkCenterlineGeometry()
    geometry.PrintLog = lambda *_: None
    geometry.Centerlines = line
    geometry.Execute()
    attributes = vmtkscripts.vmtkCenterlineAttributes()
    attributes.PrintLog = lambda *_: None
    attributes.Centerlines = geometry.Centerlines
    attributes.Execute()
    found = attributes.Centerlines
    both = {
        **_arrays(found.GetPointData(), vtk_to_numpy),
        **_arrays(found.GetCellData(), vtk_to_numpy),
    }
    print(json.dumps(both))


def _arrays(data, to_numpy):
    arrays = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]
    return {array.GetName(): to_numpy(array).tolist() for array in arrays if array}


if __name__ == "__main__":
    main(sys.argv[1])
