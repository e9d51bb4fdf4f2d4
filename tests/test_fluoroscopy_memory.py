"""Memory does not grow with the number of frames: 1 GiB a plane, read frame by frame."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pydicom
import pytest

FRAMES = 500
# Peak of the reader and of its decoding child, MB, after reading some of the frames.
# VmHWM, not ru_maxrss: the latter starts from the peak of the process that forked.
MEASURE = """
import re, sys
from pathlib import Path
from stereosom_plugin.fluoroscopy import codec, read_biplane
acquisition = read_biplane(sys.argv[1], sys.argv[2])
for index in range(0, len(acquisition), int(sys.argv[3])):
    assert acquisition[index].image_a.shape == (1024, 1024)
for process in ("self", codec._child.process.pid if codec._child else "self"):
    status = Path(f"/proc/{process}/status").read_text()
    print(int(re.search(r"VmHWM:\\s*(\\d+)", status)[1]) / 1024)
"""


def growth(paths, step):
    """MB that reading every `step`-th frame takes beyond reading two, reader and child."""
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell a process's peak memory (no /proc)")
    peaks = []
    for every in (FRAMES // 2, step):
        command = [sys.executable, "-c", MEASURE, *map(str, paths), str(every)]
        found = subprocess.run(command, capture_output=True, text=True, check=True)
        peaks.append([float(line) for line in found.stdout.split()])
    (few, few_child), (many, many_child) = peaks
    print(f"reader {few:.0f} -> {many:.0f} MB, child {few_child:.0f} -> {many_child:.0f} MB")
    return max(many - few, many_child - few_child)


@pytest.mark.slow
def test_uncompressed(write_pair, dicom_files):
    paths = write_pair()
    for path in paths:
        dicom_files.write_sparse(path, FRAMES, 1024, 1024)
        assert path.stat().st_size > FRAMES * 1024 * 1024 * 2
    assert growth(paths, 1) < 200


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "syntax", "step"),
    [("JLSL", "1.2.840.10008.1.2.4.80", 5), ("RLE", "1.2.840.10008.1.2.5", 5)],
)
def test_compressed(write_pair, dicom_files, shared_data, name, syntax, step):
    dataset = pydicom.dcmread(shared_data / "xa_transfer_syntaxes" / f"XA1_{name}.dcm")
    fragment = next(pydicom.encaps.generate_frames(dataset.PixelData, number_of_frames=1))
    size = {"Rows": 1024, "Columns": 1024, "BitsStored": 10, "HighBit": 9}
    paths = write_pair()
    for path in paths:
        dicom_files.compress(path, syntax, [fragment] * FRAMES, NumberOfFrames=FRAMES, **size)
    assert growth(paths, step) < 200
