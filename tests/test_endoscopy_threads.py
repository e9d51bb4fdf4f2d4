"""Real suture threads before a stereo endoscope, from pictures to `.vtp` by the command line."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from stereosom.middle_line.reference import thin

pytest.importorskip("cv2")
pytest.importorskip("vtkmodules")
from stereosom_plugin.calibration import read_calibration
from stereosom_plugin.centerline import read_vtp
from stereosom_plugin.cli import main

# Read off the pictures by eye, px (x, y): the end that lies inside the picture, left and right,
# and places on the way to it in the left one, which the thread enters at its border.
TIPS = {
    "thread1_{}_119": ((244, 109), (217, 106)),
    "thread2_{}_116": ((451, 209), (416, 208)),
    "thread2_{}_149": ((439, 252), (410, 251)),
}
WAYS = {
    "thread1_{}_119": [(535, 266), (423, 251), (331, 197), (306, 70), (183, 35), (160, 89),
                       (201, 61), (245, 91)],
    "thread2_{}_116": [(342, 416), (299, 357), (250, 275), (297, 184), (341, 161), (427, 204)],
    "thread2_{}_149": [(283, 389), (309, 313), (391, 269), (387, 305), (402, 342), (462, 307),
                       (561, 206), (503, 218), (454, 244)],
}  # fmt: skip


@pytest.fixture(scope="module", params=list(TIPS))
def thread(request, shared_data, tmp_path_factory):
    """Name, the curve, and the camera and the thread's pixels of each eye."""
    folder, name = shared_data / "suture_thread_stereo" / "real", request.param
    pictures = [folder / f"{name.format(side)}_final.png" for side in ("left", "right")]
    rig, out = folder / "camera_calibration.yaml", tmp_path_factory.mktemp("threads") / "out"
    call = ["endoscopy", *map(str, pictures), "--rig", str(rig), "--output", str(out)]
    assert main(call) == 0
    curve = read_vtp(out / "centerline_0000.vtp").backbone
    masks = [np.asarray(Image.open(path).convert("RGB")).min(axis=2) < 245 for path in pictures]
    found = read_calibration(rig, image_size=masks[0].shape[::-1]).rigs[0]
    return name, curve, ((found.a, masks[0]), (found.b, masks[1]))


def test_all_of_it_is_followed_to_a_fraction_of_a_pixel(thread):
    _, curve, views = thread
    for camera, mask in views:
        middle = np.argwhere(thin(mask))[:, ::-1].astype(float)
        shown = camera.project(curve.sample(750))
        apart = np.linalg.norm(middle[:, None] - shown, axis=2)
        assert np.median(apart.min(axis=0)) <= 0.6
        assert np.mean(apart.min(axis=1) < 4) > 0.94


def test_it_runs_from_end_to_end_on_the_way_of_the_thread(thread):
    name, curve, views = thread
    for (camera, _), tip in zip(views, TIPS[name], strict=True):
        assert np.linalg.norm(camera.project(curve.tip[None])[0] - tip) < 9
    shown = views[0][0].project(curve.sample(2000))
    width, height = views[0][0].image_size
    assert max(shown[0] / (width, height)) > 0.98  # where it comes into the left picture
    at = [np.linalg.norm(shown - place, axis=1) for place in WAYS[name]]
    assert max(each.min() for each in at) < 4
    order = [int(each.argmin()) for each in at]
    assert order == sorted(order)
