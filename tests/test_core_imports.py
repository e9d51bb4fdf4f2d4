"""The core stands on numpy and scipy alone."""

import subprocess
import sys


def test_importing_the_core_brings_in_nothing_for_display_or_files():
    heavy = ("vtk", "vtkmodules", "pyvista", "skimage", "SimpleITK", "pydicom", "stereosom_plugin")
    script = f"import sys, stereosom; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stdout + done.stderr
