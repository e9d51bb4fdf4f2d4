"""Fixtures that tests share. There is no package `tests`: helpers come in through here."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

HERE = Path(__file__).parent


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
    spec = importlib.util.spec_from_file_location("dicom_files", HERE / "dicom_files.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def write_pair(dicom_files, tmp_path):
    """`dicom_files.write_pair` into this test's own folder."""

    def write(name="run", **described):
        return dicom_files.write_pair(tmp_path / name, **described)

    return write
