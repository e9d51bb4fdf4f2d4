"""The exported page in a real browser that has no network (`apt-get install chromium`).

The browser is cut off twice: by the page's own policy, and by rules that resolve no name.
"""

import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc
from stereosom_plugin import polydata
from stereosom_plugin.exports import export

pytestmark = pytest.mark.interop
WIDTH, HEIGHT = 1280, 800


@pytest.fixture(scope="module")
def browse(tmp_path_factory):
    """Open the page of a run at a frame: what stands in it, its picture, what was complained."""
    names = ("chromium", "chromium-browser", "google-chrome")
    browser = next(filter(None, map(shutil.which, names)), None)
    if browser is None:
        pytest.skip("there is no chromium (apt-get install chromium)")
    folder = tmp_path_factory.mktemp("page")
    covariance = np.tile(0.04 * np.eye(3), (5, 1, 1))
    lines = [
        polydata.to_centerline(
            Reconstruction(i, i / 15, "ok", backbone=arc(50 + 5 * i, 90), covariance=covariance,
                           residuals=(0.5, 0.5), radius=2.0)
        )
        for i in range(3)
    ]  # fmt: skip
    export(lines, folder / "run.html")

    def open_at(hash_, *, edit=lambda text: text):
        page, picture = folder / "page.html", folder / "page.png"
        page.write_text(edit((folder / "run.html").read_text("utf-8")), "utf-8")
        call = [browser, "--headless=new", "--disable-gpu", "--hide-scrollbars",
                f"--window-size={WIDTH},{HEIGHT}", f"--user-data-dir={folder / 'profile'}",
                "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr",
                "--virtual-time-budget=1500"]  # fmt: skip
        call += ["--no-sandbox"] if os.geteuid() == 0 else []
        done = [
            subprocess.run([*call, what, f"file://{page}#{hash_}"], capture_output=True, text=True,
                           timeout=120, check=True)
            for what in ("--dump-dom", f"--screenshot={picture}")
        ]  # fmt: skip
        told = re.findall(r"CONSOLE\S* (.*)", "".join(each.stderr for each in done))
        with Image.open(picture) as image:
            return done[0].stdout, np.asarray(image.convert("RGB")).astype(int), told

    return open_at


def colorful(picture):
    """Pixels that are neither white nor gray, left of the legend and right of the panel."""
    stage = picture[:700, 370:1080]
    return np.ptp(stage, axis=2) > 40


def test_page_opens_at_a_frame_and_says_its_numbers(browse):
    dom, _, told = browse("frame=2")
    assert told == []  # neither an error nor a refused request
    cells = re.findall(r"<td>(.*?)</td>", dom)
    values = dict(zip(cells[::2], cells[1::2], strict=True))
    assert values["frame"] == "2"
    assert values["time"] == "0.133 s"
    assert float(values["length"].split()[0]) == pytest.approx(30 * np.pi, abs=0.02)
    assert values["radius"] == "2 mm"
    assert values["tip, standard deviation"] == "0.2 mm"


def test_page_draws_the_tube_at_its_size(browse):
    """The scale bar gives px per mm; the tube's area is its length times its width."""
    picture = browse("frame=0")[1]
    shown = colorful(picture)
    assert shown.sum() > 5000
    bar = np.all(picture[HEIGHT - 26, -320:] < 60, axis=1)
    px_per_mm = bar.sum() / 20
    # Seen slantwise the curve is shorter than it is, never longer.
    assert shown.sum() < 1.15 * 25 * np.pi * 4 * px_per_mm**2
    assert shown.sum() > 0.3 * 25 * np.pi * 4 * px_per_mm**2


def test_another_frame_is_another_picture(browse):
    first, last = (browse(f"frame={i}")[1] for i in (0, 2))
    assert np.any(first != last, axis=2).sum() > 2000


def test_the_page_forbids_itself_every_connection(browse):
    """The control: a request that is put into the page is refused, and that would be heard."""
    _, _, told = browse(
        "", edit=lambda text: text.replace("<canvas", '<img src="http://127.0.0.1:9/a"><canvas', 1)
    )
    assert any("Content Security Policy" in line for line in told)


USER = """<script>
canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -400 }));
window.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight" }));
get("color").value = "StandardDeviation"; get("color").dispatchEvent(new Event("change"));
const [x, y] = project(run.frames[now].points[40]);
canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: x, clientY: y }));
</script></body>"""


def test_what_the_user_does_has_its_effect(browse):
    """Enlarge, step to the next frame, color otherwise, point at the curve."""
    before = browse("frame=0")[1]
    dom, after, told = browse("frame=0", edit=lambda text: text.replace("</body>", USER))
    assert told == []
    assert "<td>frame</td><td>1</td>" in dom
    tip = re.search(r'<div id="tip"[^>]*>(.*?)</div>', dom, re.S)[1]
    assert f"s = {40 / 79 * 55 * np.pi / 2:.1f} mm" in tip
    assert "standard deviation = 0.2 mm" in tip
    assert colorful(after).sum() > 1.5 * colorful(before).sum()


def test_play_runs_through_the_frames(browse):
    """In a browser whose clock is told to run on: the last frame has been, and all go on."""
    seen = """<script>const shown = new Set(), then = show;
    show = i => { shown.add(i); then(i); document.title = [...shown].sort().join(); };
    get("play").click();</script></body>"""
    dom, _, told = browse("frame=0", edit=lambda text: text.replace("</body>", seen))
    assert told == []
    assert ">pause</button>" in dom
    assert re.search("<title>(.*?)</title>", dom)[1] == "0,1,2"
