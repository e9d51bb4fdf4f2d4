"""The device's surface and the hull around it: known radii, known spreads."""

import dataclasses

import numpy as np
import pytest

from stereosom import Backbone
from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import growing_helix
from stereosom_plugin import render
from stereosom_plugin.polydata import to_centerline
from stereosom_plugin.render.device import envelope, shape_of, tube
from stereosom_plugin.render.style import UNDETERMINED, colors_of, rgb

CERTAIN = 0.01 * np.eye(3)
ALONG_X = Backbone.through(np.linspace([0, 0, 0], [50, 0, 0], 20))


def centerline(backbone=ALONG_X, covariance=CERTAIN, radius=1.5, **changes):
    known = {"index": 3, "time": 0.25, "status": "ok", "residuals": (0.1, 0.1)}
    covariance = np.tile(covariance, (4, 1, 1))
    return to_centerline(
        Reconstruction(
            **{**known, **changes}, backbone=backbone, covariance=covariance, radius=radius
        )
    )


def test_a_tube_has_its_radius_everywhere():
    curve = growing_helix()
    surface = np.asarray(tube(shape_of(centerline(curve, radius=2.0), None)).points)
    dense = curve.sample(4000)
    distance = np.array([np.linalg.norm(dense - point, axis=1).min() for point in surface[::11]])
    np.testing.assert_allclose(distance, 2.0, rtol=2e-3)


def test_a_tube_is_closed():
    import pyvista

    mesh = tube(shape_of(centerline(), None))
    assert mesh.n_open_edges == 0
    prism = 24 / 2 * np.sin(2 * np.pi / 24) * 1.5**2 * 50  # a tube of 24 sides
    assert mesh.triangulate().volume == pytest.approx(prism, rel=1e-6)
    assert isinstance(mesh, pyvista.PolyData)


@pytest.mark.parametrize(("sigma_y", "sigma_z"), [(0.5, 0.5), (0.2, 3.0), (0.0, 1.0)])
def test_the_hull_reaches_radius_and_two_standard_deviations(sigma_y, sigma_z):
    """Along an axis of the covariance: exactly the radius and twice the deviation there."""
    covariance = np.diag([7.0, sigma_y**2, sigma_z**2])  # along the curve it does not matter
    hull = np.asarray(envelope(shape_of(centerline(covariance=covariance), None)).points)
    np.testing.assert_allclose(np.abs(hull[:, 1]).max(), 1.5 + 2 * sigma_y, atol=0.03)
    np.testing.assert_allclose(np.abs(hull[:, 2]).max(), 1.5 + 2 * sigma_z, atol=0.03)
    assert np.ptp(hull[:, 0]) == pytest.approx(50)


def test_a_file_with_a_standard_deviation_only_gets_a_round_hull():
    line = centerline(covariance=np.diag([0.0, 4.0, 4.0]))
    arrays = {k: v for k, v in line.arrays.items() if k != "Covariance"}
    hull = envelope(shape_of(dataclasses.replace(line, arrays=arrays), None))
    middle = np.asarray(hull.points).reshape(-1, 24, 3)[5:-5]
    np.testing.assert_allclose(np.linalg.norm(middle[..., 1:], axis=-1), 1.5 + 2 * 2.0, rtol=1e-6)
    assert envelope(shape_of(dataclasses.replace(line, arrays={}), None)) is None


def test_a_file_of_others_with_uneven_steps_keeps_its_arrays_in_place():
    """As VMTK writes: points crowd where they like, a radius stands at each."""
    x = 50 * np.linspace(0, 1, 60) ** 3
    line = dataclasses.replace(
        centerline(),
        points=np.outer(x, [1, 0, 0]),
        backbone=ALONG_X,
        arrays={"MaximumInscribedSphereRadius": 1 + x / 25},
    )
    shape = shape_of(line, None)
    assert shape.radius_known
    np.testing.assert_allclose(shape.radius, 1 + shape.points[:, 0] / 25, atol=1e-3)


@pytest.mark.parametrize("radius", [np.nan, 0.0, -1.0])
def test_a_radius_that_is_none_is_not_known(radius):
    line = centerline()
    arrays = {"Radius": np.full(len(line.points), radius)}
    shape = shape_of(dataclasses.replace(line, arrays=arrays), None)
    assert not shape.radius_known
    assert np.all(shape.radius > 0)


def test_colors_run_from_one_end_of_the_bar_to_the_other():
    from matplotlib import colormaps

    colors = colors_of([-1.0, 0.0, 2.0, 9.0, np.nan], (0.0, 2.0), "Curvature")
    first, last = (np.round(255 * np.array(colormaps["viridis"](end)[:3])) for end in (0.0, 1.0))
    np.testing.assert_array_equal(colors, [first, first, last, last, rgb(UNDETERMINED)])


def test_what_the_views_do_not_determine_has_no_color():
    shape = shape_of(centerline(covariance=np.diag([0.0, 0.1, 900.0])), "Curvature")
    assert not shape.determined.any()
    assert np.isnan(tube(shape)["values"]).all()


def test_a_survey_spans_the_whole_run():
    lines = [centerline(index=k, time=k / 10) for k in range(3)]
    spanned = render.survey(iter(lines), "Time")
    assert spanned.limits == (0.0, 0.2)
    np.testing.assert_allclose([spanned.points.min(), spanned.points.max()], [0, 50], atol=1e-6)
    assert render.survey(lines[:1], "Time").limits == (-0.5, 0.5)
    assert render.survey(lines, "Curvature").limits[0] == 0.0
    assert render.survey(lines).color_by == "Curvature"
