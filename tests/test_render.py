"""Pictures: where the views stand in space, and that every picture is drawn without a screen."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from vtkmodules.util.numpy_support import vtk_to_numpy

from stereosom.camera import Camera, StereoRig
from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin import offscreen, polydata, render
from stereosom_plugin.errors import InputError

WIDTH, HEIGHT = 40, 30


def xray_camera(primary_deg):
    """The projection of conventions for secondary angle 0: its matrix mirrors (det < 0)."""
    a = np.radians(primary_deg)
    axes = np.array([[np.cos(a), np.sin(a), 0], [0, 0, -1], [np.sin(a), -np.cos(a), 0]])
    k = np.array([[300, 0, (WIDTH - 1) / 2], [0, 300, (HEIGHT - 1) / 2], [0, 0, 1]])
    return Camera.from_pose(k, axes, [0, 0, 750], (WIDTH, HEIGHT))


def endoscope_eye(shift=0.0):
    k = [[30, 0, 19.5], [0, 30, 14.5], [0, 0, 1]]
    return Camera.from_pose(k, np.eye(3), [-shift, 0, 0], (WIDTH, HEIGHT))


def result(**changes):
    known = {
        "index": 0,
        "time": 0.0,
        "status": "ok",
        "method": "truth",
        "backbone": arc(),
        "covariance": np.tile(0.2 * np.eye(3), (5, 1, 1)),
        "residuals": (0.5, 0.5),
        "radius": 1.0,
    }
    return Reconstruction(**{**known, **changes})


@pytest.fixture(scope="module")
def views():
    rig = converging_rig(60)
    pictures = [
        np.where(silhouette(arc(), 1.0, camera), 40, 200).astype(np.uint8)
        for camera in (rig.a, rig.b)
    ]
    return rig, tuple(pictures)


def picture_of(path):
    pyplot_free = pytest.importorskip("matplotlib.image")
    return pyplot_free.imread(path)


# ---- where pictures stand in space ---------------------------------------------------


@pytest.mark.parametrize("camera", [xray_camera(30), xray_camera(-60), endoscope_eye()])
def test_a_bright_pixel_stands_on_its_own_ray(camera):
    """From the texture's memory, through its coordinates, into space, and back to the pixel."""
    import pyvista

    column, row = 31, 4
    image = np.zeros((HEIGHT, WIDTH))
    image[row, column] = 255
    texels = pyvista.Texture(render.stretched(image)).GetInput()
    assert texels.GetDimensions() == (WIDTH, HEIGHT, 1)
    bright = int(np.argmax(vtk_to_numpy(texels.GetPointData().GetScalars())[:, 0]))
    # VTK's texel (i, j), counted from the lower left, fills the middle of coordinates (u, v).
    u, v = (bright % WIDTH + 0.5) / WIDTH, (bright // WIDTH + 0.5) / HEIGHT

    quad = render.picture_quad(camera, 800.0)
    along_u, along_v, one = (np.column_stack([quad.active_texture_coordinates, np.ones(4)])).T
    # The quad is a parallelogram: space is linear in (u, v).
    to_space, rest, *_ = np.linalg.lstsq(
        np.column_stack([along_u, along_v, one]), np.asarray(quad.points, dtype=float), rcond=None
    )
    np.testing.assert_allclose(rest, 0, atol=1e-6)
    spot = np.array([u, v, 1.0]) @ to_space
    np.testing.assert_allclose(camera.project(spot[None]), [[column, row]], atol=1e-3)
    np.testing.assert_allclose(camera.depth(quad.points), 800.0, atol=1e-3)


@pytest.mark.parametrize("angle", [30, 60, 90, 120])
def test_pictures_stand_behind_the_device_and_do_not_cut_each_other(angle):
    rig, points = converging_rig(angle), arc().sample(50)
    depths = render.views.picture_depths(points, rig)
    quad_a, quad_b = map(render.picture_quad, (rig.a, rig.b), depths)
    for camera, quad in ((rig.a, quad_a), (rig.b, quad_b)):
        assert camera.depth(points).max() < camera.depth(quad.points).min()
    a_before_b = rig.b.depth(quad_a.points).max() < rig.b.depth(quad_b.points).min()
    b_before_a = rig.a.depth(quad_b.points).max() < rig.a.depth(quad_a.points).min()
    assert a_before_b or b_before_a


def test_stretching_of_contrast():
    ramp = np.linspace(0, 4000, 100 * 100).reshape(100, 100)
    ramp[0, 0] = 60000  # one hot pixel must not darken the picture
    grey = render.stretched(ramp)
    assert grey.shape == (100, 100, 3)
    assert (grey.min(), grey.max()) == (0, 255)
    assert grey[50, 50].tolist() == pytest.approx([128] * 3, abs=2)
    thin = np.zeros((100, 100), dtype=bool)
    thin[50, :50] = True
    np.testing.assert_array_equal(render.stretched(thin)[50, [0, 99], 0], [255, 0])
    assert render.stretched(np.full((4, 4), 7)).max() == 0


# ---- what is drawn -------------------------------------------------------------------


def test_scene_shows_device_and_both_views(tmp_path, views, capfd):
    rig, images = views
    render.scene(result(), rig, tmp_path / "scene.png", images, size=(400, 300))
    picture = picture_of(tmp_path / "scene.png")
    assert picture.shape[:2] == (300, 400)
    for color in render.VIEW_COLORS.values():
        wanted = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        assert np.any(np.linalg.norm(picture[..., :3] - wanted, axis=-1) < 0.2), color
    assert [file.name for file in tmp_path.iterdir()] == ["scene.png"]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("color_by", ["Curvature", "StandardDeviation", "Time", None])
def test_scene_of_a_file_without_pictures_or_radius(tmp_path, color_by):
    polydata.write_vtp(result(radius=None), tmp_path / "c.vtp")
    line = polydata.read_vtp(tmp_path / "c.vtp")
    rig = converging_rig(60)
    render.scene(line, rig, tmp_path / "s.png", color_by=color_by, size=(200, 150))
    assert picture_of(tmp_path / "s.png").shape[:2] == (150, 200)


def test_what_a_file_does_not_hold_cannot_color_it(tmp_path):
    line = polydata.to_centerline(result())
    line = dataclasses.replace(line, arrays={})
    with pytest.raises(InputError, match=r"no array StandardDeviation.*--color-by one of Time"):
        render.scene(line, None, tmp_path / "s.png", color_by="StandardDeviation", size=(80, 60))
    render.scene(line, None, tmp_path / "plain.png", size=(80, 60))
    assert [file.name for file in tmp_path.iterdir()] == ["plain.png"]


@pytest.mark.parametrize("view", ["a", "b"])
def test_a_view_is_not_known_without_a_rig(tmp_path, view):
    with pytest.raises(InputError, match=f"view {view}: is not known without a rig"):
        render.scene(result(), None, tmp_path / "s.png", view=view, size=(80, 60))


@pytest.mark.parametrize(
    "rig",
    [
        StereoRig(endoscope_eye(), endoscope_eye(5.0)),
        StereoRig(xray_camera(0), xray_camera(180)),
        None,
    ],
)
def test_scene_of_views_side_by_side_and_face_to_face_and_of_none(tmp_path, rig):
    backbone = arc(20, 90).transformed(np.eye(3), [-5, -5, 60])
    render.scene(result(backbone=backbone), rig, tmp_path / "s.png", size=(200, 150))
    assert np.ptp(picture_of(tmp_path / "s.png")) > 0


def test_overlay_draws_the_line_where_the_device_is(tmp_path, views):
    rig, images = views
    color = "#00ff00"
    render.overlay(images[0], arc(), rig.a, tmp_path / "overlay_a.png", color=color)
    picture = picture_of(tmp_path / "overlay_a.png")
    height, width = images[0].shape
    assert picture.shape[:2] == (height, width)
    row, column = np.nonzero(np.all(np.abs(picture[..., :3] - [0, 1, 0]) < 0.2, axis=-1))
    line = rig.a.project(arc().sample(2000))
    drawn = np.column_stack([column, row])
    gaps = np.linalg.norm(line[::40, None] - drawn, axis=2).min(axis=1)
    assert gaps[2:-2].max() < 2.0
    assert np.linalg.norm(drawn[:, None] - line[::10], axis=2).min(axis=1).max() < 14  # the diamond


def test_small_color_picture_is_enlarged(tmp_path):
    image = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    backbone = arc(20, 90).transformed(np.eye(3), [-5, -5, 60])
    render.overlay(image, backbone, endoscope_eye(), tmp_path / "o.png")
    assert picture_of(tmp_path / "o.png").shape[:2] == (25 * HEIGHT, 25 * WIDTH)


def test_pictures_that_cannot_be_written_are_told(tmp_path, views):
    rig, images = views
    with pytest.raises(InputError, match="cannot be written"):
        render.scene(result(), rig, tmp_path / "no" / "s.png", size=(80, 60))
    with pytest.raises(InputError, match="cannot be written"):
        render.overlay(images[0], arc(), rig.a, tmp_path / "no" / "o.png")
    assert not list(tmp_path.iterdir())


# ---- without a screen ----------------------------------------------------------------


@pytest.fixture
def untried(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("VTK_DEFAULT_OPENGL_WINDOW", raising=False)
    offscreen.prepare.cache_clear()
    yield
    offscreen.prepare.cache_clear()


@pytest.mark.usefixtures("untried")
def test_without_any_opengl_library_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(offscreen, "_loads", lambda library: False)
    with pytest.raises(InputError, match="apt-get install libegl1 libgl1-mesa-dri"):
        offscreen.prepare()


@pytest.mark.usefixtures("untried")
def test_a_library_that_crashes_is_tried_elsewhere_first(monkeypatch):
    monkeypatch.setattr(offscreen, "_loads", lambda library: True)
    monkeypatch.setattr(offscreen, "_TRIAL", "import os; os.abort()")
    with pytest.raises(InputError, match="no OpenGL"):
        offscreen.prepare()


@pytest.mark.usefixtures("untried")
def test_the_first_that_works_is_taken(monkeypatch):
    monkeypatch.setattr(offscreen, "_loads", lambda library: True)
    monkeypatch.setattr(offscreen, "_works", lambda window: window == "vtkOSOpenGLRenderWindow")
    offscreen.prepare()
    assert offscreen.os.environ["VTK_DEFAULT_OPENGL_WINDOW"] == "vtkOSOpenGLRenderWindow"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has the choice")
def test_an_opengl_without_driver_ends_in_one_line_not_in_a_crash():
    """The real thing: libEGL loads, but finds no vendor, and VTK itself would crash."""
    code = """
from stereosom_plugin import offscreen
from stereosom_plugin.errors import InputError
try:
    offscreen.prepare()
except InputError as error:
    print("refused:", error)
"""
    environment = {
        **offscreen.os.environ,
        "PYTHONPATH": ":".join(sys.path),
        "VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow",
        "__EGL_VENDOR_LIBRARY_DIRS": "/nowhere",
        "__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere",
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("refused: rendering: no OpenGL")
