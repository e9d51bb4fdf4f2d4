"""Where a picture is taken from: its own projection is VTK's, and a view's is the view's own."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereosom.camera import Camera
from stereosom.synthetic import arc, converging_rig, growing_helix
from stereosom_plugin.render import look as looks

SIZE = (400, 300)
RNG = np.random.default_rng(0)


def xray(primary_deg):
    """The projection of conventions for secondary angle 0: its matrix mirrors (det < 0)."""
    a = np.radians(primary_deg)
    axes = np.array([[np.cos(a), np.sin(a), 0], [0, 0, -1], [np.sin(a), -np.cos(a), 0]])
    k = np.array([[300, 0, 25], [0, 310, 14], [0, 0, 1]])
    return Camera.from_pose(k, axes, [0, 0, 750], (60, 40))


def eye():
    return Camera.from_pose([[60, 0, 21], [0, 60, 17], [0, 0, 1]], np.eye(3), [3, 2, 90], (48, 36))


def vtk_pixels(look, points, size=SIZE):
    """Where VTK itself draws points: ParaView's and pyvista's projection, not ours."""
    import pyvista

    from stereosom_plugin import offscreen

    offscreen.prepare()
    plotter = pyvista.Plotter(off_screen=True, window_size=list(size))
    plotter.add_mesh(pyvista.PolyData(points))
    look.aim(plotter)
    plotter.render()
    pixels = []
    for point in points:
        plotter.renderer.SetWorldPoint(*point, 1.0)
        plotter.renderer.WorldToDisplay()
        x, y, _ = plotter.renderer.GetDisplayPoint()
        pixels.append((x - 0.5, size[1] - 0.5 - y))  # VTK counts from the lower left corner
    plotter.close()
    return np.array(pixels)


@pytest.mark.parametrize(
    "look",
    [
        looks.between_views(converging_rig(60), growing_helix().sample(40)),
        looks.between_views(None, growing_helix().sample(40)),
        looks.best_side(converging_rig(60), growing_helix().sample(40)),
        looks.from_view(converging_rig(60).a),
    ],
    ids=["overview", "without rig", "best side", "view"],
)
def test_a_look_projects_as_vtk_draws(look):
    points = growing_helix().sample(40)
    look = look.fitted(points, SIZE).turned(25, points.mean(axis=0))
    np.testing.assert_allclose(look.project(points, SIZE), vtk_pixels(look, points), atol=0.02)


@pytest.mark.parametrize("camera", [xray(30), xray(-75), eye()], ids=["LAO", "RAO", "eye"])
def test_from_a_view_one_sees_what_it_sees(camera):
    """One scale and one shift take all of the view's pixels to ours, mirroring camera or not."""
    points = RNG.normal(size=(50, 3)) * 10
    corners = looks.picture_corners(camera, 800.0 if camera.center[1] else 100.0)
    look = looks.from_view(camera).fitted(corners, SIZE)
    theirs, ours = camera.project(points), look.project(points, SIZE)
    ones = np.ones((50, 1))
    for k in range(2):
        (scale, _), rest, *_ = np.linalg.lstsq(
            np.hstack([theirs[:, [k]], ones]), ours[:, k], rcond=None
        )
        assert scale > 0  # not mirrored, not upside down
        np.testing.assert_allclose(rest, 0, atol=1e-12)


def test_the_best_side_of_a_flat_curve_is_square_to_it():
    """A quarter circle of 60 mm in a tilted plane: its true shape, its plane's normal."""
    turn = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    curve = arc(60, 90).transformed(turn * np.sign(np.linalg.det(turn)), [5, -3, 20])
    points = curve.sample(50)
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    look = looks.best_side(converging_rig(60), points)
    assert look.parallel
    assert abs(look.towards @ normal) == pytest.approx(1, abs=1e-9)
    # Without perspective every length in that plane is shown in one scale: that of the bar.
    flat = look.fitted(points, SIZE).project(points, SIZE)
    seen = np.linalg.norm(np.diff(flat, axis=0), axis=1).sum()
    scale = look.fitted(points, SIZE).pixels_per_mm(points[0], SIZE[1])
    assert seen / scale == pytest.approx(curve.length, rel=1e-3)


def test_a_straight_device_has_a_best_side_too():
    points = np.linspace([0, 0, 0], [30, 40, 0], 20)
    for rig in (None, converging_rig(60)):
        look = looks.best_side(rig, points)
        assert abs(look.towards @ [0.6, 0.8, 0]) < 1e-9
        np.testing.assert_allclose(look.axes.T @ look.axes, np.eye(3), atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(0.5, 3), st.booleans())
@settings(max_examples=50, deadline=None)
def test_what_is_fitted_fills_the_free_part(seed, aspect, from_a_view):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(30, 3)) * rng.uniform(1, 40, 3)
    size = (round(600 * aspect), 600)
    look = looks.from_view(xray(30)) if from_a_view else looks.between_views(None, points)
    x, y = look.fitted(points, size).project(points, size).T
    left, top, right, bottom = np.array(looks.free_part(size)) * np.tile(size, 2)
    np.testing.assert_array_less([left - 1, top - 1], [x.min(), y.min()])
    np.testing.assert_array_less([x.max(), y.max()], [right + 1, bottom + 1])
    touches = [abs(np.ptp(x) - (right - left)) < 1, abs(np.ptp(y) - (bottom - top)) < 1]
    assert any(touches)


def test_led_around_once_the_eye_is_back_and_saw_all():
    points = growing_helix().sample(60)
    pivot = (points.min(axis=0) + points.max(axis=0)) / 2
    look = looks.between_views(converging_rig(60), points)
    look = look.fitted(look.all_around(points, pivot), SIZE)
    start = look.project(points, SIZE)
    np.testing.assert_allclose(look.turned(360, pivot).project(points, SIZE), start, atol=1e-6)
    for angle in range(0, 360, 45):
        pixels = look.turned(angle, pivot).project(points, SIZE)
        assert np.all((pixels > 0) & (pixels < SIZE))
        # What is upright stays upright.
        post = look.turned(angle, pivot).project(pivot + np.outer([0, 1], look.upright), SIZE)
        assert abs(post[1, 0] - post[0, 0]) < 1e-6


def test_scale_bar_of_a_view_holds_at_the_device():
    """SOD 750 mm, focal length 300 px: a millimetre at the isocentre is 0.4 px of the view's."""
    camera = xray(0)
    corners = looks.picture_corners(camera, 800.0)
    look = looks.from_view(camera).fitted(corners, SIZE)
    enlarged = np.ptp(look.project(corners, SIZE)[:, 0]) / camera.image_size[0]
    assert look.pixels_per_mm(np.zeros(3), SIZE[1]) / enlarged == pytest.approx(0.4, rel=1e-6)
