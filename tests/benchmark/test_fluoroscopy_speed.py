"""How many frame pairs a second go from DICOM to `.vtp`, reading and writing included.

    python -m pytest tests/benchmark/test_fluoroscopy_speed.py -m benchmark -s

asserts nothing about time; docs/experiments/speed.md quotes such a run. The study that ships is
played to and fro: 512×512 as it is, 1024×1024 with every pixel doubled.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from stereosom_plugin.cli import main

pydicom = pytest.importorskip("pydicom")
pytestmark = pytest.mark.benchmark


def played(source, target, frames, factor):
    """Write a plane with so many frames, to and fro, every pixel `factor` times as wide."""
    dataset = pydicom.dcmread(source)
    pictures = dataset.pixel_array
    there = np.arange(len(pictures))
    order = np.resize(np.concatenate([there, there[-2:0:-1]]), frames)
    if dataset.file_meta.TransferSyntaxUID.is_compressed:
        dataset.decompress(generate_instance_uid=False)
    dataset.NumberOfFrames = frames
    dataset.Rows, dataset.Columns = factor * dataset.Rows, factor * dataset.Columns
    spacing = [float(one) / factor for one in dataset.ImagerPixelSpacing]
    dataset.ImagerPixelSpacing = [f"{one:.10g}" for one in spacing]
    large = [np.kron(one, np.ones((factor, factor), one.dtype)).tobytes() for one in pictures]
    dataset.PixelData = b"".join(large[number] for number in order)
    dataset.save_as(target, enforce_file_format=True)


def studies():
    shared = Path(__file__).parents[3] / "shared" / "data" / "biplane_xa"
    return [shared / "guidewire", shared / "cannula", Path(__file__).parents[2] / "data/biplane"]


@pytest.mark.parametrize(("factor", "frames"), [(1, 96), (2, 48)], ids=["512", "1024"])
@pytest.mark.parametrize("study", studies(), ids=lambda folder: folder.name)
def test_from_dicom_to_vtp(study, factor, frames, tmp_path):
    if not study.is_dir():
        pytest.skip(f"{study.name} is not here")
    for plane in ("plane_a.dcm", "plane_b.dcm"):
        played(study / plane, tmp_path / plane, frames, factor)
    words = [str(tmp_path / "plane_a.dcm"), str(tmp_path / "plane_b.dcm"), "--quiet"]

    def run(name, *more):
        out = tmp_path / name
        assert main(["fluoroscopy", *words, "--output", str(out), *more]) in (0, 1)
        return out

    run("warm", "--frames", "0:3")  # what is compiled and imported once
    spent, wall = sum(os.times()[:4]), time.perf_counter()
    out = run("out")
    spent, wall = sum(os.times()[:4]) - spent, time.perf_counter() - wall
    done = len(list(out.glob("centerline_*.vtp")))
    print(
        f"\n{study.name} {512 * factor}²: {frames / wall:.1f} frame pairs/s, "
        f"{1000 * spent / frames:.0f} ms of processor time each; {done} of {frames} have a curve"
    )
    assert done == frames
