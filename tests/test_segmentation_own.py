"""Segmentations that users bring: functions by name, ONNX models, broken ones of both."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from stereosom_plugin.centerline import read_vtp
from stereosom_plugin.cli import main
from stereosom_plugin.commands.drawing import Results
from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane
from stereosom_plugin.segmentation import BiplaneSegmenter, binary, outline, segment_xray
from stereosom_plugin.segmentation.own import load_segmenter
from stereosom_plugin.segmentation.show import outlined

PICTURE = np.full((70, 90), 1000.0)
PICTURE[20:, 40:46] = 50
TRUTH = PICTURE < 500


def test_xray_is_the_default():
    assert load_segmenter("xray") is segment_xray


def test_a_function_of_a_module_in_the_current_folder(tmp_path, monkeypatch):
    (tmp_path / "my_masks.py").write_text("def dark(image):\n    return image < 500\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "my_masks", raising=False)
    assert (load_segmenter("my_masks:dark")(PICTURE) == TRUTH).all()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("nowhere:f", "cannot be imported"),
        ("numpy:nothing", "has no function"),
        ("numpy", "names no segmentation"),
        ("numpy:pi", "has no function"),
        ("absent.onnx", "no such file"),
    ],
)
def test_what_cannot_be_used_is_one_line(name, why):
    with pytest.raises(InputError, match=why) as error:
        load_segmenter(name)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("numpy.linalg:inv", "fails on a picture"),
        ("numpy:ravel", "6300 for a picture of 70×90"),
        ("numpy:str_", "a single value"),
    ],
)
def test_a_function_that_fails_on_a_picture_says_so(name, why):
    with pytest.raises(InputError, match=why):
        load_segmenter(name)(PICTURE)


def test_command_refuses_an_unknown_segmenter(sample, tmp_path, capsys):
    call = ["fluoroscopy", str(sample), "--output", str(tmp_path / "out"), "--segmenter", "x.onnx"]
    assert main(call) == 2
    error = capsys.readouterr().err
    assert error.startswith("stereosom: error: x.onnx: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_command_shows_the_masks(sample, tmp_path):
    out = tmp_path / "out"
    call = ["fluoroscopy", str(sample), "--output", str(out), "--frames", "0:1", "--show-masks"]
    assert main([*call, "--quiet"]) == 0
    assert (out / "segmentation_0000.png").stat().st_size > 10_000


@pytest.fixture
def mask_folders(sample, tmp_path):
    """Masks of the first two frames of the sample as files, empty ones of the others."""
    acquisition = read_biplane(sample)
    folders = tmp_path / "a", tmp_path / "b"
    for folder in folders:
        folder.mkdir()
    both = BiplaneSegmenter(acquisition)
    for frame in range(len(acquisition)):
        masks = both(acquisition[frame]) if frame < 2 else (np.zeros((512, 512), dtype=bool),) * 2
        for folder, mask in zip(folders, masks, strict=True):
            Image.fromarray(mask.astype(np.uint8) * 255).save(folder / f"{frame:03d}.png")
    return [str(folder) for folder in folders]


def test_command_takes_masks_that_are_files(sample, mask_folders, tmp_path):
    call = ["fluoroscopy", str(sample), "--quiet", "--frames", "0:2"]
    assert main([*call, "--output", str(tmp_path / "own"), "--masks", *mask_folders]) == 0
    assert main([*call, "--output", str(tmp_path / "xray")]) == 0
    ours, theirs = (
        read_vtp(tmp_path / which / "centerline_0001.vtp").points for which in ("own", "xray")
    )
    assert np.allclose(ours, theirs, atol=1e-6)
    found = Results(tmp_path / "own").segmenter().masks(1)[1]
    assert (found == binary(Image.open(tmp_path / "b" / "001.png"))).all()


def test_masks_that_changed_are_another_run(sample, mask_folders, tmp_path, capsys):
    call = ["fluoroscopy", str(sample), "--quiet", "--frames", "0:1"]
    call += ["--output", str(tmp_path / "out"), "--masks", *mask_folders]
    assert main(call) == 0
    assert main(call) == 0
    (tmp_path / "a" / "000.png").write_bytes((tmp_path / "a" / "001.png").read_bytes())
    assert main(call) == 2
    assert "results of another call" in capsys.readouterr().err


def test_masks_that_do_not_go_with_the_run_are_one_line(sample, mask_folders, tmp_path, capsys):
    call = ["fluoroscopy", str(sample), "--output", str(tmp_path / "out"), "--masks"]
    for more, why in (
        ([*mask_folders, "--segmenter", "numpy:isnan"], "exclude each other"),
        ([mask_folders[0], str(tmp_path / "none")], "no such file"),
        ([f"{mask_folders[0]}/000.png", f"{mask_folders[1]}/000.png"], "the run has 6 frames"),
    ):
        assert main([*call, *more]) == 2
        error = capsys.readouterr().err
        assert why in error
        assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_poor_masks_do_not_make_the_geometry_doubtful(sample, tmp_path, monkeypatch, capsys):
    (tmp_path / "my_half.py").write_text(
        "import numpy as np\ndef dark(image):\n    return image < np.percentile(image, 20)\n"
    )
    monkeypatch.chdir(tmp_path)
    call = ["fluoroscopy", str(sample), "--output", "out", "--frames", "0:2", "--quiet"]
    assert main([*call, "--segmenter", "my_half:dark"]) == 1
    error = capsys.readouterr().err
    assert error.count("failed") == 2
    assert "geometry" not in error


def write_model(path, shape, *, classes=1):
    """A network that answers 1 where the picture is below a quarter of its range."""
    onnx = pytest.importorskip("onnx")
    helper, number = onnx.helper, onnx.TensorProto.FLOAT
    given = helper.make_tensor_value_info("picture", number, list(shape))
    said = helper.make_tensor_value_info("device", number, None)
    level = helper.make_tensor("level", number, [1], [0.25])
    nodes = [helper.make_node("Sub", ["level", "picture"], ["logit"])]
    if classes == 2:
        nodes.append(helper.make_node("Neg", ["logit"], ["other"]))
        nodes.append(helper.make_node("Concat", ["other", "logit"], ["device"], axis=1))
    else:
        nodes.append(helper.make_node("Identity", ["logit"], ["device"]))
    graph = helper.make_graph(nodes, "dark", [given], [said], [level])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    path.write_bytes(model.SerializeToString())
    return str(path)


@pytest.mark.parametrize("classes", [1, 2])
@pytest.mark.parametrize("shape", [(1, 1, "rows", "columns"), (1, 1, 140, 180)])
def test_onnx_model(tmp_path, shape, classes):
    pytest.importorskip("onnxruntime")
    segment = load_segmenter(write_model(tmp_path / "dark.onnx", shape, classes=classes))
    mask = segment(PICTURE)
    edge = ndimage.binary_dilation(TRUTH) & ~ndimage.binary_erosion(TRUTH, border_value=1)
    assert (mask == TRUTH)[~edge].all()  # scaled there and back, the edge may move
    assert shape[2] != "rows" or (mask == TRUTH).all()


def test_broken_models_are_one_line(tmp_path):
    pytest.importorskip("onnxruntime")
    path = tmp_path / "bad.onnx"
    good = write_model(tmp_path / "good.onnx", (1, 1, "rows", "columns"))
    whole = (tmp_path / "good.onnx").read_bytes()
    for content in (b"", b"no model" * 50, whole[: len(whole) // 2]):
        path.write_bytes(content)
        with pytest.raises(InputError, match="no model that can be used") as error:
            load_segmenter(str(path))
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="channels"):
        load_segmenter(write_model(path, (1, 4, "rows", "columns")))
    assert load_segmenter(good)(PICTURE).any()


def test_a_model_that_dies_ends_one_picture_only(tmp_path):
    pytest.importorskip("onnxruntime")
    from stereosom_plugin.segmentation.onnx_model import ModelError, OnnxModel

    model = OnnxModel(write_model(tmp_path / "dark.onnx", (1, 1, "rows", "columns")))
    model._process.kill()
    with pytest.raises(ModelError, match="ended the process"):
        model(PICTURE)
    assert (model(PICTURE) == TRUTH).all()
    model.close()


def test_outline_goes_around_the_mask():
    mask = np.zeros((20, 30), dtype=bool)
    mask[5:9, 10:20] = True
    mask[6:8, 13:15] = False
    outer, hole = sorted(outline(mask), key=lambda line: np.ptp(line[:, 0]), reverse=True)
    assert outer.min(axis=0).tolist() == [9.5, 4.5]
    assert outer.max(axis=0).tolist() == [19.5, 8.5]
    assert (hole[0] == hole[-1]).all()
    assert outline(np.zeros((4, 4))) == []
    assert outlined(PICTURE, TRUTH).shape == (70, 90, 3)


def test_an_outline_is_drawn_with_the_segmenter_of_the_run(sample, tmp_path, monkeypatch):
    lines = "from stereosom_plugin.segmentation import segment_xray\n"
    lines += "def mine(image):\n    return segment_xray(image)\n"
    (tmp_path / "my_tube.py").write_text(lines)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "my_tube", raising=False)
    call = ["fluoroscopy", str(sample), "--output", "out", "--frames", "0:1", "--quiet"]
    assert main([*call, "--segmenter", "my_tube:mine"]) == 0
    found = Results(tmp_path / "out").segmenter()
    assert (found(PICTURE) == segment_xray(PICTURE)).all()
    (tmp_path / "my_tube.py").unlink()
    sys.modules.pop("my_tube")
    with pytest.raises(InputError, match="cannot be imported"):
        Results(tmp_path / "out").segmenter()
