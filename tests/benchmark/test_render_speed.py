"""How many pictures of a film are drawn and written in a second, in software OpenGL.

    python -m pytest tests/benchmark/test_render_speed.py -m benchmark -s

asserts nothing about time; docs/rendering.md quotes such a run. What is measured is all that
`stereosom render OUT --output film.mp4` does for a run of 100 frames of 512 by 512 pixels:
reading curves and pictures, drawing, encoding.
"""

import time

import numpy as np
import pytest
from PIL import Image

from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin.calibration import write_rig
from stereosom_plugin.cli import main
from stereosom_plugin.output import OutputFolder

pytestmark = pytest.mark.benchmark

FRAMES = 100


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """An output folder of a run of 100 frames: the truth, as if it had been reconstructed."""
    folder, rig = tmp_path_factory.mktemp("run"), converging_rig(60)
    rng = np.random.default_rng(0)
    inputs = []
    for view, camera in (("a", rig.a), ("b", rig.b)):
        (folder / view).mkdir()
        # Of masks, what is brighter than half is device: the noise must stay below.
        noise = rng.normal(50, 15, camera.image_size[::-1])
        for frame in range(FRAMES):
            if frame % 10 == 0:  # drawing it takes longer than all else here
                device = silhouette(curve(frame), 1.0, camera)
            path = folder / view / f"{frame:03d}.png"
            picture = np.where(device, 225, noise).clip(0, 255).astype(np.uint8)
            Image.fromarray(picture).save(path, compress_level=1)
            inputs.append({"path": str(path), "sha256": ""})
    write_rig([rig], folder / "rig.json")
    inputs.append({"path": str(folder / "rig.json"), "sha256": ""})
    out = OutputFolder(folder / "out", {"command": "masks", "inputs": inputs, "options": {}})
    out.begin([rig])
    for frame in range(FRAMES):
        out.commit(
            Reconstruction(
                index=frame,
                time=frame / 15,
                status="ok",
                backbone=curve(frame),
                covariance=np.tile(0.04 * np.eye(3), (20, 1, 1)),
                residuals=(0.3, 0.3),
                radius=1.0,
            )
        )
    out.finish()
    return out.path


def curve(frame):
    return arc(60, 60 + frame / 2)


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("--ghosts", "5"),
        ("--size", "1920x1080"),
        ("--view", "best"),
        ("--overlay", "both"),
        ("--overlay", "both", "--outline"),
    ],
    ids=lambda words: " ".join(words) or "as it comes",
)
def test_film_of_100_frames(run, tmp_path, benchmark, words):
    film = tmp_path / "film.mp4"

    def render():
        assert main(["render", str(run), "--output", str(film), "--quiet", *words]) == 0

    wall, processor = time.perf_counter(), time.process_time()
    benchmark.pedantic(render, rounds=1)
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(
        f"\n{' '.join(words) or 'as it comes'}: {FRAMES / wall:.1f} pictures/s, "
        f"{1000 * processor / FRAMES:.0f} ms of processor time each"
    )
    assert film.stat().st_size > 10_000
