"""How long a stereo endoscope's recording takes, from film to `.vtp`, by what takes it.

    python -m pytest tests/benchmark/test_endoscopy_speed.py -m benchmark -s

The film that ships, enlarged to 1920×1080, is read, segmented, freed of lens distortion, tracked
and written; processor time per pair, median and mean over the frames after the second. Films are
decoded ahead in threads: their time counts in the stage in which it passes. Asserts nothing about
time. docs/experiments/speed.md quotes such a run.
"""

from __future__ import annotations

import re
import time
from collections import defaultdict
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from stereosom import track
from stereosom_plugin.endoscopy import read_stereo
from stereosom_plugin.lens import undistorted_observation
from stereosom_plugin.polydata import write_vtp
from stereosom_plugin.segmentation.endoscope import segmenter

av = pytest.importorskip("av")
cv2 = pytest.importorskip("cv2")
pytestmark = pytest.mark.benchmark

FILM = Path(__file__).parent.parent.parent / "data" / "endoscope"
TIMES, FRAMES = 3, 20


def enlarged(folder):
    """The film and its calibration at three times the size."""
    for eye in ("left", "right"):
        with (
            av.open(str(FILM / f"{eye}.mp4")) as source,
            av.open(str(folder / f"{eye}.mp4"), "w") as made,
        ):
            stream = made.add_stream("libx264", rate=20, options={"crf": "18"})
            stream.width, stream.height, stream.pix_fmt = 640 * TIMES, 360 * TIMES, "yuv420p"
            for number, frame in enumerate(source.decode(video=0)):
                if number == FRAMES:
                    break
                large = frame.reformat(stream.width, stream.height, "yuv420p")
                large = av.VideoFrame.from_ndarray(large.to_ndarray(), format="yuv420p")
                large.pts, large.time_base = number, Fraction(1, 20)
                made.mux(stream.encode(large))
            made.mux(stream.encode())

    def larger(found):
        fx, _, cx, _, fy, cy, *_ = (TIMES * float(value) for value in found[2].split(","))
        shift = (TIMES - 1) / 2  # pixel centers are whole numbers
        values = (fx, 0, cx + shift, 0, fy, cy + shift, 0, 0, 1)
        return f"{found[1]}{', '.join(map(str, values))} ]"

    text = (FILM / "calibration.yaml").read_text()
    text = text.replace(": 640\n", f": {640 * TIMES}\n").replace(": 360\n", f": {360 * TIMES}\n")
    text = re.sub(r"(M[12]:[^\[]*\[ )([^\]]*) \]", larger, text)
    (folder / "calibration.yaml").write_text(text)


def test_full_hd_pairs(tmp_path):
    enlarged(tmp_path)
    cv2.setNumThreads(1)  # as a run segments: threads that wait count, too
    acquisition = read_stereo(
        tmp_path / "left.mp4", tmp_path / "right.mp4", tmp_path / "calibration.yaml", check=False
    )
    left, right = segmenter()
    took, clock = defaultdict(list), [time.process_time()]

    def lap(stage):
        now = time.process_time()
        took[stage].append(1e3 * (now - clock[0]))
        clock[0] = now

    def observations():
        for index in range(FRAMES):
            clock[0] = time.process_time()
            pair = acquisition[index]
            lap("read both films")
            masks = left(pair.image_a), right(pair.image_b)
            lap("segment both eyes")
            lenses, described = acquisition.lenses, {"time": pair.time, "index": index}
            seen = undistorted_observation(masks, lenses, pair.rig, **described)
            lap("take lens distortion away")
            yield seen

    done = 0
    for result in track(observations()):
        lap("track")
        assert result.ok, result.reason
        write_vtp(result, tmp_path / "curve.vtp")
        lap("write the .vtp")
        done += 1
    assert done == FRAMES
    print(f"{'ms':28s}{'median':>8s}{'mean':>8s}")
    whole = np.zeros(2)
    for stage, times in took.items():
        told = np.array([np.median(times[2:]), np.mean(times[2:])])
        whole += told
        print(f"{stage:28s}{told[0]:8.1f}{told[1]:8.1f}")
    print(f"{'one pair':28s}{whole[0]:8.1f}{whole[1]:8.1f}")
