"""Fixtures that tests share. There is no package `tests`: helpers come in through here."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import pytest

HERE = Path(__file__).parent
# One thread for each worker of `pytest -n auto`: more would only wait for one another. Libraries
# read these when they are first imported, which is after this.
if "PYTEST_XDIST_WORKER" in os.environ:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ.setdefault(name, "1")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The development data beside the checkout; what needs it is skipped where it is absent."""
    folder = HERE.parent.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the development data (../shared/data) is not here")
    return folder


@pytest.fixture(scope="session")
def dicom_files():
    """The module `dicom_files.py`: writes XA objects to the standard."""
    return _module("dicom_files")


@pytest.fixture(scope="session")
def enhanced_dicom():
    """The module `enhanced_dicom.py`: writes Enhanced XA objects to the standard."""
    return _module("enhanced_dicom")


@pytest.fixture(scope="session")
def stereo_films():
    """The module `stereo_films.py`: writes small stereo recordings and their calibration."""
    pytest.importorskip("av")
    return _module("stereo_films")


def _module(name):
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def calibration_files():
    """The module `calibration_files.py`: one calibration in every format, and its numbers."""
    return _module("calibration_files")


@pytest.fixture(scope="session")
def compiled_loops():
    """The fit's inner loops, compiled: what numba does at first use counts in no timed test."""
    from stereosom import reconstruct
    from stereosom.synthetic import arc, converging_rig, observe

    assert reconstruct(observe(arc(60, 90), 1.0, converging_rig(60))).ok


@pytest.fixture
def write_pair(dicom_files, tmp_path):
    """`dicom_files.write_pair` into this test's own folder."""

    def write(name="run", **described):
        return dicom_files.write_pair(tmp_path / name, **described)

    return write


@pytest.fixture(scope="session")
def sample() -> Path:
    """The biplane study that ships."""
    return HERE.parent / "data" / "biplane"


@pytest.fixture(scope="session")
def mask_case(tmp_path_factory):
    """A folder with `a.png`, `b.png`, `rig.json`, `truth.csv` of a drawn quarter circle."""
    import numpy as np
    from PIL import Image

    from stereosom.synthetic import arc, converging_rig, silhouette
    from stereosom_plugin.calibration import write_rig

    folder, curve, rig = tmp_path_factory.mktemp("masks"), arc(60, 90), converging_rig(60)
    for name, camera in (("a", rig.a), ("b", rig.b)):
        mask = silhouette(curve, 1.0, camera).astype(np.uint8) * 255
        Image.fromarray(mask).save(folder / f"{name}.png")
    write_rig([rig], folder / "rig.json")
    header = "x_mm,y_mm,z_mm"
    np.savetxt(folder / "truth.csv", curve.sample(300), delimiter=",", header=header, comments="")
    return folder
