"""Overlays: the line, the outline and the band lie where the device, the mask and doubt are."""

import numpy as np
import pytest
from scipy.ndimage import binary_erosion, distance_transform_edt

from stereosom.camera import Camera
from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin import render
from stereosom_plugin.lens import RadialTangentialLens
from stereosom_plugin.render.overlay import deviation_px, outlines
from stereosom_plugin.render.style import SEGMENTED, rgb

RIG, CURVE = converging_rig(60), arc()


def colored(picture, color, within=40):
    distance = np.abs(picture.astype(int) - rgb(color)).max(axis=-1)
    return np.argwhere(distance < within)[:, ::-1]


def test_the_outline_of_a_rectangle_runs_half_a_pixel_around_it():
    columns, rows = np.meshgrid(np.arange(3, 8), np.arange(10, 12))
    loops = outlines(np.column_stack([columns.ravel(), rows.ravel()]), (20, 20))
    assert len(loops) == 1
    np.testing.assert_allclose(loops[0].min(axis=0), [2.5, 9.5])
    np.testing.assert_allclose(loops[0].max(axis=0), [7.5, 11.5])
    np.testing.assert_allclose(loops[0][0], loops[0][-1])


def test_outlines_of_nothing_and_of_pixels_at_the_border():
    assert outlines(np.empty((0, 2)), (20, 20)) == []
    assert outlines(np.array([[-5.0, 3.0]]), (20, 20)) == []
    assert len(outlines(np.array([[0.0, 0.0], [19, 19]]), (20, 20))) == 2


def test_what_was_segmented_is_outlined_where_it_is():
    mask = silhouette(CURVE, 3.0, RIG.a)
    rows, columns = np.nonzero(mask)
    pixels = np.column_stack([columns, rows]).astype(float)
    gray = np.full(mask.shape, 90, dtype=np.uint8)
    over = render.Overlay(gray, RIG.a, None, segmented=pixels)
    drawn = colored(render.overlaid(over), SEGMENTED)
    assert len(drawn) > 100
    near = np.linalg.norm(drawn[:, None] - pixels[None, ::3], axis=2).min(axis=1)
    assert near.max() < 4
    # None of it inside: an outline, no filling.
    inside = binary_erosion(mask, iterations=3)
    assert not inside[drawn[:, 1], drawn[:, 0]].any()


@pytest.mark.parametrize("size", [(800, 800), (301, 517)])
def test_an_overlay_of_any_size_keeps_the_line_on_the_device(size):
    """Enlarged or reduced, in the middle of a sheet: the dark device lies under the line."""
    picture = np.where(silhouette(CURVE, 3.0, RIG.a), 0, 255).astype(np.uint8)
    bare = render.overlaid(render.Overlay(picture, RIG.a, None), size=size)
    over = render.Overlay(picture, RIG.a, CURVE.sample(200), color="#ff0000")
    both = render.overlaid(over, size=size)
    assert both.shape == (size[1], size[0], 3)
    x, y = colored(both, "#ff0000").T
    middle = (y > y.min() + 20) & (y < y.max() - 20)  # without the marks at the ends
    # How deep inside the device: everywhere nearly as deep as its axis.
    depth = distance_transform_edt(bare.sum(axis=-1) < 200)
    assert depth[y[middle], x[middle]].min() > 0.4 * depth.max()


def test_a_line_is_drawn_through_the_lens_that_took_the_picture():
    width, height = RIG.a.image_size
    focal = RIG.a.focal_length
    k = [[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]]
    lens = RadialTangentialLens(k, [0, 0, 0, 0.5])
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    at = lens.undistort_where_defined(np.column_stack([x.ravel(), y.ravel()]).astype(float))
    at = np.rint(np.nan_to_num(at, nan=-1)).astype(int)
    within = np.all((at >= 0) & (at < (width, height)), axis=1)
    device = np.zeros(width * height, dtype=bool)
    device[within] = silhouette(CURVE, 3.0, RIG.a)[at[within, 1], at[within, 0]]
    picture = np.where(device.reshape(height, width), 0, 255).astype(np.uint8)
    depth = distance_transform_edt(picture == 0)
    least = []
    for through in (lens, None):
        over = render.Overlay(picture, RIG.a, CURVE.sample(200), color="#ff0000", lens=through)
        column, row = colored(render.overlaid(over, size=(width, height)), "#ff0000").T
        middle = (row > row.min() + 20) & (row < row.max() - 20)
        least.append(depth[row[middle], column[middle]].min() / depth.max())
    assert least[0] > 0.4
    assert least[1] < 0.2  # what an ideal camera would have shown lies elsewhere


def test_what_a_lens_shows_beyond_the_ideal_picture_is_outlined():
    pixels = np.argwhere(np.ones((10, 40)))[:, ::-1] + (-20.0, 5.0)
    (whole,) = outlines(pixels)
    assert whole[:, 0].min() == -20.5
    (inside,) = outlines(pixels, (100, 100))
    assert inside[:, 0].min() == -0.5


def test_spread_across_a_projected_line_by_hand():
    """1000 px at 500 mm: 2 px a millimetre. Across the line 0.5 mm deviate, along it 9 mm."""
    camera = Camera.from_pose(np.diag([1000, 1000, 1]), np.eye(3), [0, 0, 500], (9, 9))
    points = np.linspace([-20, 0, 0], [20, 0, 0], 30)
    covariance = np.tile(np.diag([81.0, 0.25, 400.0]), (30, 1, 1))
    np.testing.assert_allclose(deviation_px(camera, points, covariance), 1.0, rtol=0.02)


def test_an_uncertain_line_shows_its_band():
    gray = np.full(RIG.a.image_size[::-1], 0, dtype=np.uint8)
    points = CURVE.sample(100)

    def blue_pixels(deviation):
        over = render.Overlay(gray, RIG.a, points, deviation=np.full(100, deviation))
        return np.count_nonzero(render.overlaid(over)[..., 2] > 30)

    length = np.linalg.norm(np.diff(RIG.a.project(points), axis=0), axis=1).sum()
    wider = blue_pixels(20.0) - blue_pixels(10.0)
    assert wider == pytest.approx(length * 2 * 2 * 10, rel=0.15)


def test_pictures_beside_each_other_and_padded():
    small, large = (np.full((h, w, 3), 9, dtype=np.uint8) for h, w in ((10, 7), (15, 20)))
    row = render.beside([small, large])
    assert row.shape == (15, 7 + render.GAP + 20, 3)
    assert render.padded(row, None, even=True).shape == (16, 36, 3)
    assert render.padded(row, None, even=False).shape == row.shape
    assert render.padded(row, (40, 20), even=True).shape == (20, 40, 3)
