"""Every script of the gallery runs as it stands, and draws the picture that is shown."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

GALLERY = Path(__file__).parent.parent / "docs" / "gallery"
SCRIPTS = sorted(script.stem for script in GALLERY.glob("*.py"))
# Programs that start anew take seconds each: one is tried each time, CI tries all.
QUICK = "masks"


@pytest.mark.parametrize(
    "name", [pytest.param(s, marks=() if s == QUICK else pytest.mark.slow) for s in SCRIPTS]
)
def test_script_draws_the_picture_that_is_shown(name, tmp_path):
    call = [sys.executable, "-W", "error", GALLERY / f"{name}.py", tmp_path]
    done = subprocess.run(call, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout
    drawn, shown = (Image.open(f / f"{name}.png").convert("L") for f in (tmp_path, GALLERY))
    assert drawn.size == shown.size
    # The shown one has 256 colors, and letters differ between machines: the rest is alike.
    difference = np.asarray(drawn, dtype=float) - np.asarray(shown, dtype=float)
    assert np.abs(difference).mean() < 6
    assert np.std(np.asarray(drawn)) > 5, "an empty picture"


def test_the_page_shows_every_script():
    page = (GALLERY / "README.md").read_text("utf-8")
    assert len(SCRIPTS) == 9
    for name in SCRIPTS:
        assert f"]({name}.py)" in page
        assert f"]({name}.png)" in page
        assert len((GALLERY / f"{name}.py").read_text("utf-8").splitlines()) < 40
        assert (GALLERY / f"{name}.png").stat().st_size <= 150_000
