"""VMTK measures our centerline by its own filters, and finds what we wrote into it.

Needs an environment of its own (VMTK 1.5 wants Python 3.12 or newer), whose Python
STEREOSOM_VMTK_PYTHON names: `python3.12 -m venv ENV && ENV/bin/pip install vmtk`.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc, growing_helix
from stereosom_plugin import polydata

pytestmark = pytest.mark.interop
CURVES = {"arc": arc(50, 90), "helix": growing_helix()}


@pytest.fixture(scope="module", params=CURVES)
def both(request, tmp_path_factory):
    """What a file of ours says, and what VMTK finds in its points."""
    python = os.environ.get("STEREOSOM_VMTK_PYTHON")
    if not python:
        pytest.skip("STEREOSOM_VMTK_PYTHON names no Python with vmtk (it needs Python 3.12)")
    curve, path = CURVES[request.param], tmp_path_factory.mktemp("vmtk") / "c.vtp"
    result = Reconstruction(
        0, 0.0, "ok", backbone=curve, covariance=np.tile(0.01 * np.eye(3), (5, 1, 1)),
        residuals=(0.5, 0.5), radius=1.0,
    )  # fmt: skip
    polydata.write_vtp(result, path)
    script = Path(__file__).with_name("vmtk_run.py")
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    done = subprocess.run(
        [python, str(script), str(path)], env=environment, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = {name: np.array(v) for name, v in json.loads(done.stdout.splitlines()[-1]).items()}
    return polydata.read_vtp(path), found


INNER = slice(5, -5)  # VMTK's differences are one-sided at the ends


def test_curvature(both):
    ours, found = both
    np.testing.assert_allclose(
        ours.arrays["Curvature"][INNER], found["Curvature"][INNER], rtol=0.01
    )


def test_torsion(both):
    """VMTK's third differences are rough: their median is compared, and their spread bounded."""
    ours, found = both
    apart = np.abs(ours.arrays["Torsion"] - found["Torsion"])[INNER]
    scale = max(np.abs(found["Torsion"][INNER]).max(), 1e-3)
    assert np.median(apart) < 0.01 * scale
    assert np.percentile(apart, 95) < 0.05 * scale


def test_tangents(both):
    ours, found = both
    cosine = np.sum(ours.arrays["FrenetTangent"] * found["FrenetTangent"], axis=1)
    assert cosine[INNER].min() > 0.9999


def test_abscissas_length_and_tortuosity(both):
    """VMTK adds up chords, which are shorter than their arcs by (curvature × step)²/24 at most."""
    ours, found = both
    s, step = ours.arrays["Abscissas"], ours.arrays["Abscissas"][1]
    short = s * (ours.arrays["Curvature"].max() * step) ** 2 / 24
    missing = s - found["Abscissas"]
    assert np.all((missing > -1e-4) & (missing < short + 1e-4))
    np.testing.assert_allclose(ours.field["Length"], found["Length"].ravel(), rtol=1e-4)
    np.testing.assert_allclose(ours.field["Tortuosity"], found["Tortuosity"].ravel(), rtol=1e-3)


def test_parallel_transport_normals_turn_alike(both):
    """The first normal is arbitrary: both turn by one angle about the tangent."""
    ours, found = both
    tangent, mine = ours.arrays["FrenetTangent"], ours.arrays["ParallelTransportNormals"]
    theirs = found["ParallelTransportNormals"]
    angle = np.unwrap(np.arctan2(
        np.sum(np.cross(mine, theirs) * tangent, axis=1), np.sum(mine * theirs, axis=1)
    ))[INNER]  # fmt: skip
    assert np.ptp(angle) < 0.02
