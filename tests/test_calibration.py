import json

import numpy as np
import pytest

from stereosom import StereoRig
from stereosom.synthetic import converging_rig
from stereosom_plugin.calibration import read_rig, write_rig
from stereosom_plugin.errors import InputError


def test_what_is_written_is_read(tmp_path):
    write_rig([converging_rig(50)], tmp_path / "rig.json")
    (rig,) = read_rig(tmp_path / "rig.json")
    assert rig.b.projection == pytest.approx(converging_rig(50).b.projection)
    assert rig.a.image_size == (1024, 768)


def test_a_moving_geometry_has_a_rig_per_frame(tmp_path):
    rigs = [converging_rig(angle) for angle in (40, 50, 60)]
    write_rig(rigs, tmp_path / "rig.json")
    again = read_rig(tmp_path / "rig.json")
    assert [round(rig.convergence_deg) for rig in again] == [40, 50, 60]


def described(**camera_b):
    pose = {"image_size": [640, 480], "intrinsics": [[1000, 0, 320], [0, 1000, 240], [0, 0, 1]],
            "rotation": np.eye(3).tolist(), "translation": [0, 0, 0]}  # fmt: skip
    return {"units": "mm", "frame": "camera_a",
            "cameras": [pose, pose | {"translation": [-5, 0, 0]} | camera_b]}  # fmt: skip


def read(content, tmp_path) -> StereoRig:
    path = tmp_path / "rig.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_rig(path)[0]


def test_a_camera_may_be_given_by_its_pose(tmp_path):
    rig = read(described(), tmp_path)
    assert rig.baseline == pytest.approx(5)
    assert rig.frame == "camera_a"
    assert rig.b.project([[0, 0, 100]]) == pytest.approx(np.array([[270, 240]]))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("{", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
        ("[]", "no object"),
        ("{}", "list of two"),
        (described() | {"units": "cm"}, "not mm"),
        (described() | {"frame": "sky"}, "none of"),
        (described(image_size=[640]), "camera b: .*width, height"),
        (described(translation=[0, 0]), "camera b: translation: must be 3"),
        (described(rotation="x"), "camera b: rotation: not an array"),
        (described(projection=[[1, 2], [3]]), "camera b"),
        (described(distortion=[0.1, 0, 0]), "distortion: must be 4, 5, 8, 12 or 14 numbers"),
        (described(translation=[0, 0, 0]), "same place"),
        (described(intrinsics=[[0, 0, 0]] * 3), "camera b: .*singular"),
    ],
)
def test_what_is_no_rig_is_refused_in_one_line(tmp_path, content, says):
    with pytest.raises(InputError, match=says) as refused:
        read(content, tmp_path)
    assert "\n" not in str(refused.value)


def test_a_missing_camera_entry_is_named(tmp_path):
    content = described()
    del content["cameras"][0]["image_size"]
    with pytest.raises(InputError, match="camera a: image_size is missing"):
        read(content, tmp_path)
