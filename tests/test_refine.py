"""The parts of the joint fit: known answers, derivatives, and the compiled kernels."""

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from stereosom import Camera, StereoRig, reconstruct
from stereosom.refine import kernels as choice
from stereosom.refine import odd_ends, reference
from stereosom.refine.contour import Contour, mask_contour
from stereosom.refine.end_piece import EndPiece
from stereosom.refine.fit import TubeFit, fit_tube
from stereosom.refine.look import Look, Tube
from stereosom.refine.odd_ends import _ball, _bending
from stereosom.refine.reach import mirrored_in_depth, other_ends, seen_stretch
from stereosom.refine.spline import spline_basis
from stereosom.synthetic import arc, converging_rig, observe

RIG = converging_rig(60)
FLAT, OPEN, ROUND = reference.FLAT, reference.OPEN, reference.ROUND
CAPPED = np.array([FLAT, FLAT])
BASIS = spline_basis(8)


def straight(start, stop, radius=2.0, capped=(FLAT, FLAT), basis=BASIS):
    """A tube along a line."""
    return Tube.of(basis, basis.control_points(np.linspace(start, stop, 100)), radius, capped)


def outline_of(tube, camera):
    return reference.outline(
        camera.projection,
        camera.center,
        tube.curve,
        tube.tangents,
        tube.radius,
        np.array(tube.capped),
    )


def straight_mask(camera, start, stop, radius):
    """Pixels of a straight, flat-ended tube: the convex hull of its two end circles' pictures."""
    along = np.subtract(stop, start) / np.linalg.norm(np.subtract(stop, start))
    beside = np.cross(along, [0.36, 0.48, 0.8])
    beside /= np.linalg.norm(beside)
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)[:, None]
    circle = radius * (np.cos(angle) * beside + np.sin(angle) * np.cross(along, beside))
    hull = ConvexHull(camera.project(np.vstack([start + circle, stop + circle])))
    width, height = camera.image_size
    pixels = np.indices((height, width))[::-1].reshape(2, -1).T.astype(float)
    low, high = hull.points.min(axis=0), hull.points.max(axis=0)
    pixels = pixels[np.all((pixels >= low) & (pixels <= high), axis=1)]
    outside = pixels @ hull.equations[:, :2].T + hull.equations[:, 2]
    return pixels[outside.max(axis=1) < 0]


def seen(start, stop, radius=2.0):
    """Contours of a straight tube in both views of RIG."""
    return tuple(mask_contour(straight_mask(view, start, stop, radius)) for view in (RIG.a, RIG.b))


def sights(contours):
    """Both views of RIG as the kernels take them."""
    return tuple(
        (camera.projection, camera.center, camera.focal_length, edges.points, edges.directions)
        for camera, edges in zip((RIG.a, RIG.b), contours, strict=True)
    )


def looks_at(tube, contours, gate=12.0):
    return tuple(
        Look.at(tube, camera, contour, gate)
        for camera, contour in zip((RIG.a, RIG.b), contours, strict=True)
    )


# ---- the outline -----------------------------------------------------------------------


def test_the_rims_of_an_upright_tube_are_its_tangent_planes():
    # Seen across from a distance d, planes through the camera touch a tube of radius r at an
    # angle asin(r/d) from its middle: f r / √(d² − r²) in the picture, all the way up.
    tube = straight([0, 0, 20], [0, 0, 130], radius=7.0)
    picture, normals, *_ = outline_of(tube, RIG.a)
    left, right, *_ = reference.pieces(len(tube.curve))
    reach = 2400 * 7 / np.sqrt(700**2 - 7**2)
    middle = RIG.a.project(tube.curve)[:, 0]
    sides = np.stack([picture[left, 0] - middle, picture[right, 0] - middle])
    np.testing.assert_allclose(np.sort(sides, axis=0), [[-reach], [reach]] * np.ones_like(middle))
    np.testing.assert_allclose(np.abs(normals[: 2 * len(middle), 0]), 1)
    assert np.all(np.sign(normals[left, 0]) == np.sign(sides[0]))


def test_an_outline_is_as_wide_as_the_hull_of_both_end_circles():
    # A convex tube's outline, caps and all, lies on the hull of its two end circles' pictures.
    tube = straight([-20, 5, 40], [25, -10, 100], radius=4.0)
    for camera in (RIG.a, RIG.b):
        picture, *_ = outline_of(tube, camera)
        pixels = straight_mask(camera, tube.curve[0], tube.curve[-1], 4.0)
        hull = ConvexHull(np.vstack([pixels + corner for corner in np.eye(2) - 0.5]))
        outside = (picture @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1)
        assert np.abs(outside).max() < 1.0  # the hull of pixels, to a pixel
        around = ConvexHull(picture)
        assert around.volume == pytest.approx(len(pixels), rel=0.005)  # a 2D volume is an area


def test_a_rounded_end_shows_half_the_circle_of_a_ball():
    # A ball of radius r before a camera, at a distance d, is seen within an angle asin(r/d) of
    # its middle: a circle of radius f r / √(d² - r²). Of it the half beyond the tube's end shows.
    middle = RIG.a.center + 650 * RIG.a.axis
    beside = np.cross(RIG.a.axis, [0, 0, 1.0])
    tube = straight(middle - 80 * beside, middle, radius=5.0, capped=(FLAT, ROUND))
    picture, normals, _, turn, *_ = outline_of(tube, RIG.a)
    *_, tip = reference.pieces(len(tube.curve))
    at = RIG.a.project(middle[None])[0]
    away = np.linalg.norm(picture[tip] - at, axis=1)
    np.testing.assert_allclose(away, 2400 * 5 / np.sqrt(650**2 - 5**2))
    np.testing.assert_allclose(normals[tip], (picture[tip] - at) / away[:, None], atol=1e-9)
    before = RIG.a.project(tube.curve[[-2]])[0] - at
    assert np.all((picture[tip] - at) @ before < 0)
    assert not turn[tip].any()


def test_nothing_is_near_a_flat_end_that_is_none():
    picture, *_ = outline_of(straight([0, 0, 20], [0, 0, 130], capped=(OPEN, FLAT)), RIG.a)
    _, _, base, tip = reference.pieces(BASIS.samples)
    assert np.all(picture[base] == reference.NOWHERE)
    assert np.all(np.abs(picture[tip]) < 2000)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.sampled_from([0.05, 0.5, 3.0, 8.0]),
    st.sampled_from(["curve", "radius", "tangents"]),
    st.sampled_from([FLAT, ROUND]),
)
def test_the_outline_moves_as_its_derivatives_say(seed, radius, moved, shape):
    capped = np.full(2, shape)
    rng = np.random.default_rng(seed)
    camera, curve, tangents = random_scene(rng, tilt=rng.uniform(0.3, np.pi / 2))
    _, normals, pull, turn, grow, _ = reference.outline(
        camera.projection, camera.center, curve, tangents, radius, capped
    )
    owner, h = reference.owners(len(curve)), 1e-5
    shift = rng.normal(size=(len(curve), 3))
    if moved == "curve":
        expected = np.sum(pull * shift[owner], axis=1)
    elif moved == "radius":
        expected = grow
    else:  # a tangent turns by its change across itself
        shift -= np.sum(shift * tangents, axis=1, keepdims=True) * tangents
        expected = np.sum(turn * shift[owner], axis=1)
    places = []
    for sign in (1, -1):
        turned = tangents + sign * h * shift * (moved == "tangents")
        places.append(
            reference.outline(
                camera.projection,
                camera.center,
                curve + sign * h * shift * (moved == "curve"),
                turned / np.linalg.norm(turned, axis=1, keepdims=True),
                radius + sign * h * (moved == "radius") * min(radius, 1.0),
                capped,
            )[0]
        )
    step = h * (min(radius, 1.0) if moved == "radius" else 1.0)
    outward = np.sum((places[0] - places[1]) * normals, axis=1) / (2 * step)
    np.testing.assert_allclose(outward, expected, rtol=1e-4, atol=1e-4)


# ---- edges, and what they belong to ----------------------------------------------------


def test_the_contour_of_one_pixel_is_its_four_sides():
    contour = mask_contour(np.array([[7.0, 3.0]]))
    assert sorted(map(tuple, contour.points)) == [(6.5, 3.0), (7.0, 2.5), (7.0, 3.5), (7.5, 3.0)]
    np.testing.assert_allclose(contour.directions, 2 * (contour.points - [7, 3]))


def test_a_contour_depends_neither_on_the_order_of_pixels_nor_on_repeats():
    pixels = straight_mask(RIG.a, np.array([0, 0, 40.0]), np.array([10, 5, 90.0]), 2.0)
    mixed = np.random.default_rng(0).permutation(np.vstack([pixels, pixels[::3]]))
    one, other = mask_contour(pixels), mask_contour(mixed)
    np.testing.assert_array_equal(one.points, other.points)
    np.testing.assert_array_equal(one.directions, other.directions)


def test_the_edges_of_a_half_plane_point_straight_out_of_it():
    x, y = np.meshgrid(np.arange(40.0), np.arange(20.0))
    contour = mask_contour(np.column_stack([x.ravel(), y.ravel()]))
    top = (contour.points[:, 1] == -0.5) & (np.abs(contour.points[:, 0] - 19.5) < 14)
    np.testing.assert_allclose(contour.directions[top], [[0, -1]] * top.sum(), atol=1e-12)


def test_edges_on_the_outline_have_no_residual_and_those_beside_it_their_distance():
    tube = straight([0, 0, 20], [0, 0, 130])
    picture, normals, *_, bend = outline_of(tube, RIG.a)
    n = len(tube.curve)
    for beside in (-1.5, 0.0, 2.0):
        nearest, residual = reference.match(
            picture, normals, bend, n, picture + beside * normals, normals, 7.0, 10.0
        )
        rims = slice(0, 2 * n)
        np.testing.assert_array_equal(nearest[rims], np.arange(2 * n))
        np.testing.assert_allclose(residual[rims], beside, atol=1e-9)


def test_edges_that_belong_nowhere_are_counted_at_the_end_they_lie_about():
    # A tube of radius 7 mm, 10 mm too short: its true flat end, a line across the picture, lies
    # within two half widths of the tip, and so do 10 - 4 mm of each rim and no edge of the base.
    contours = seen([0, 0, 20], [0, 0, 130], radius=7.0)
    for look in looks_at(straight([0, 0, 20], [0, 0, 130], radius=7.0), contours, gate=3.0):
        assert look.stray_at_ends == (0, 0)
    for look in looks_at(straight([0, 0, 20], [0, 0, 120], radius=7.0), contours, gate=3.0):
        base, tip = look.stray_at_ends
        assert base == 0
        assert 2 * look.half_width < tip < 2 * look.half_width + 2 * 10 / 7 * look.half_width


def test_an_end_with_edges_beside_it_that_belong_nowhere_is_odd():
    # What a flat end leaves that is tilted the wrong way: all else fits.
    start, stop = np.array([-15.0, 3, 20]), np.array([28.0, -14, 120])
    contours, tube = seen(start, stop, radius=7.0), straight(start, stop, radius=7.0)

    def odd_ends(contours):
        looks = looks_at(tube, contours, gate=3.0)
        return TubeFit(BASIS.backbone(BASIS.through(tube.curve)), 7.0, tube, looks, False).odd_ends

    assert odd_ends(contours) == (False, False)
    half_width = looks_at(tube, contours)[0].half_width
    inward, tip = RIG.a.project(tube.curve[-2:])
    outward = (tip - inward) / np.linalg.norm(tip - inward)
    beside = np.linspace(-0.8, 0.8, int(1.5 * half_width) + 6)[:, None] * half_width
    points = tip + 1.5 * half_width * outward + beside * [-outward[1], outward[0]]
    lost = Contour(
        np.vstack([contours[0].points, points]),
        np.vstack([contours[0].directions, np.tile(outward, (len(points), 1))]),
    )
    assert odd_ends((lost, contours[1])) == (False, True)


def test_an_end_that_points_at_a_view_need_not_be_seen_in_it():
    start, stop = np.array([-15.0, 3, 20]), np.array([28.0, -14, 120])
    tube = straight(start, stop, radius=7.0)
    looks = looks_at(tube, seen(start, stop, radius=7.0), gate=3.0)
    for look, camera in zip(looks, (RIG.a, RIG.b), strict=True):
        for end, place in enumerate((start, stop)):
            ray = (place - camera.center) / np.linalg.norm(place - camera.center)
            along = (stop - start) / np.linalg.norm(stop - start)
            assert look.slant[end] == pytest.approx(abs(ray @ along), abs=0.02)
    hidden = replace(looks[0], sums=tuple([*sums[:3], 0.0] for sums in looks[0].sums))

    def fitted(slant, other=looks[1]):
        shown = (replace(hidden, slant=(0.1, slant)), other)
        return TubeFit(BASIS.backbone(BASIS.through(tube.curve)), 7.0, tube, shown, False)

    assert not fitted(0.5).ends_seen
    assert fitted(0.5).odd_ends == (False, True)
    assert fitted(0.95).ends_seen
    assert fitted(0.95).odd_ends == (False, False)
    # Where the other view does not show it either, it is missed.
    assert not fitted(0.95, replace(looks[1], sums=hidden.sums)).ends_seen


def test_a_fit_misses_what_its_outline_shows_no_edges_for_or_what_has_none():
    start, stop = np.array([-15.0, 3, 20]), np.array([28.0, -14, 120])
    contours, tube = seen(start, stop), straight(start, stop)

    def misses(*contours):
        looks = looks_at(tube, contours, gate=3.0)
        return TubeFit(BASIS.backbone(BASIS.through(tube.curve)), 2.0, tube, looks, False).misses

    assert not misses(*contours)
    # Without edges for a quarter of it in one view: 120 px of either rim, and six half widths
    # are 48 px; next to edges, five samples of the curve count as seen.
    away = np.linalg.norm(contours[0].points - RIG.a.project(tube.curve[[24]]), axis=1)
    assert misses(contours[0].where(away > 60), contours[1])
    # With as many again as a tenth of the edges, elsewhere.
    beside = contours[1].where(slice(None, None, 10))
    more = Contour(
        np.vstack([contours[1].points, beside.points + 40]),
        np.vstack([contours[1].directions, beside.directions]),
    )
    assert misses(contours[0], more)


def test_a_fit_does_not_miss_what_it_covers_itself():
    def misses(unseen, bare):
        look = SimpleNamespace(unseen_px=lambda _: (unseen, bare), half_width=5.0, stray=0.0)
        tube = SimpleNamespace(capped=(FLAT, FLAT))
        return TubeFit(None, 1.0, tube, (look, look), False).misses

    assert not misses(unseen=100.0, bare=10.0)
    assert misses(unseen=100.0, bare=20.0)


def test_what_a_tube_covers_of_itself_shows_no_edge_that_could_be_missed():
    # 50 px to the right, 10 px to either side, and 40 px back again, 3 px to either side.
    x = np.concatenate([np.arange(0.0, 51), np.arange(50.0, 9, -1)])
    half = np.repeat([10.0, 3.0], [51, 41])
    rims = [np.column_stack([x, half]), np.column_stack([x, -half])]
    picture = np.vstack([*rims, np.full((2 * reference.CAP_POINTS, 2), -1e9)])
    nothing = np.zeros((2, 92), dtype=bool)
    ends = np.array([FLAT, FLAT])
    length, bare = reference.unseen(picture, nothing, ends)
    assert length == pytest.approx(2 * 90, abs=16)
    assert bare == pytest.approx(2 * 50, abs=8)


def test_close_eyes_follow_outlines_far_in_depth():
    # 1 px in depth moves a point 0.05 px in the pictures of eyes so close.
    k = [[700, 0, 320], [0, 700, 240], [0, 0, 1]]
    rig = StereoRig(*(Camera.from_pose(k, np.eye(3), [x, 0, 0], (640, 480)) for x in (1.5, -1.5)))
    edges = tuple(mask_contour(straight_mask(camera, [-10, -6, 60], [10, 8, 60], 1.0))
                  for camera in (rig.a, rig.b))  # fmt: skip
    start = np.linspace([-10.5, -6.3, 63], [10.5, 8.4, 63], 60)

    def depth(free_in_depth):
        fit = fit_tube(rig, edges, start, 1.0, gates=(7.0,), passes=4, free_in_depth=free_in_depth)
        return fit.tube.curve[:, 2].mean()

    assert depth(True) == pytest.approx(60, abs=0.4)
    assert depth(False) > 61


def test_bends_count_by_their_squared_curvature():
    # A quarter of a circle of radius 40, radius of the tube 2: 2 / 40² over 20 π.
    curve = arc(40, 90).polyline(60)
    control = BASIS.control_points(curve, np.linspace(0, 1, 60))
    assert _bending(Tube.of(BASIS, control, 2.0, (FLAT, FLAT))) == pytest.approx(
        2 / 40**2 * 20 * np.pi, rel=0.02
    )


@pytest.mark.parametrize(("bent", "better", "rounded"), [
    (0.0, 0.0, False), (0.0, 6.0, True), (0.8, 0.0, True), (0.8, -20.0, False),
])  # fmt: skip
def test_of_two_ends_that_fit_alike_the_one_that_need_not_bend_is_likelier(bent, better, rounded):
    # The flat one turns by so much, rad, over its last eighth; noise of 1 px².
    z = np.linspace(0, 80, 100)
    turn = bent * np.clip((z - 70) / 10, 0, 1) ** 2 / 2
    line = np.column_stack([np.cumsum(np.sin(turn)) * 0.8, 0 * z, z])

    def fit(start, shape, **_):
        flat = shape == FLAT
        control = BASIS.control_points(line if flat else line * [0, 0, 1])
        tube = Tube.of(BASIS, control, 3.0, (FLAT, shape))
        cost = 100.0 if flat else 100.0 - 2 * better
        return SimpleNamespace(tube=tube, cost=cost, odd_ends=(False, False))

    looks = [SimpleNamespace(noise_variance=1.0)] * 2
    piece = SimpleNamespace(end=1, curve=line, fit=fit, whole=SimpleNamespace(looks=looks))
    assert (_ball(piece, None) is not None) == rounded


def test_an_end_is_tried_nearer_to_the_cameras_and_farther_first():
    tube = straight([0, 0, 20], [0, 0, 130])
    others = other_ends(RIG, tube, looks_at(tube, seen([0, 0, 20], [0, 0, 130])), 1)
    away = np.linalg.norm(tube.curve[-1] - (RIG.a.center + RIG.b.center) / 2)
    for other, farther in zip(others[-5:], (-1, 1), strict=False):  # before them, where cut off
        depth = np.linalg.norm(other[-1] - (RIG.a.center + RIG.b.center) / 2)
        assert depth - away == pytest.approx(farther * tube.radius, rel=0.1)
        np.testing.assert_array_equal(other[0], tube.curve[0])


def test_an_end_that_costs_much_more_than_another_after_some_passes_is_given_up(monkeypatch):
    # What each start costs after few passes, and after more.
    costs = {0: (100, 95), 1: (130, 40), 2: (900, 10), 3: (110, 105)}
    fitted = []

    def fit(start, shape, passes, settled_px=0.0):
        fitted.append((start, passes))
        cost = 1000.0 if passes == 0 else costs[start][passes > 4]
        return SimpleNamespace(
            cost=cost,
            odd_ends=(cost > 50, False),
            end_is_odd=lambda *_: cost > 50,
            tube=SimpleNamespace(curve=start, capped=(FLAT, FLAT)),
            looks=[SimpleNamespace(half_width=1.0)] * 2,
        )

    whole = SimpleNamespace(tube=SimpleNamespace(capped=(FLAT, FLAT)))
    piece = SimpleNamespace(end=0, curve=-1, rig=None, whole=whole, fit=fit)
    monkeypatch.setattr(odd_ends, "other_ends", lambda *_: [0, 1, 2, 3])
    assert odd_ends._other_end(piece).cost == 40
    soon, late = [[start for start, passes in fitted if passes == n] for n in (4, 12)]
    assert soon == [0, 1, 2, 3]
    assert late == [0, 3, 1]  # the best first, up to what is clear, and none of start 2


def test_a_fit_says_whether_it_has_settled():
    device = arc(60, 60)
    views = observe(device, 1.0, RIG)
    edges = (mask_contour(views.pixels_a), mask_contour(views.pixels_b))
    start = device.polyline(100) + np.array([1.0, 0, 0])
    for passes, settled in ((2, False), (15, True)):
        details = {"capped": (ROUND, ROUND), "gates": (7.0,), "passes": passes}
        assert fit_tube(RIG, edges, start, 1.0, **details).settled == settled


def test_edges_that_face_the_other_way_belong_nowhere():
    picture, normals, *_, bend = outline_of(straight([0, 0, 20], [0, 0, 130]), RIG.a)
    nearest, residual = reference.match(
        picture[:5], normals[:5], bend[:5], 5, picture[:5], -normals[:5], 2.0, 30.0
    )
    assert np.all(nearest == -1)
    assert np.all(residual == 0)


def test_the_normal_equations_bring_a_shifted_tube_back_in_one_step():
    """Edges straight from the outline of the true tube; the step is a shift of the whole."""
    true = straight([-5, 3, 30], [8, -4, 120])
    shift = np.array([0.15, -0.1, 0.2])
    placed = replace(true, curve=true.curve + shift)
    together = np.vstack([np.tile(np.eye(3), (BASIS.count, 1)), np.zeros((1, 3))])
    matrix, side = np.zeros((3, 3)), np.zeros(3)
    for camera in (RIG.a, RIG.b):
        picture, normals, *_ = outline_of(true, camera)
        look = Look.at(placed, camera, Contour(picture, normals), 5.0)
        parts = reference.assemble(BASIS.values, BASIS.slopes, placed.speed, *look.equations)
        matrix += together.T @ parts[0] @ together
        side += together.T @ parts[1]
    np.testing.assert_allclose(np.linalg.solve(matrix, side), -shift, atol=0.02)


def test_the_covariance_of_a_tube_seen_along_three_axes_is_that_of_its_points():
    """Points of a rim pull along x, y and z in turn, each with the same weight.

    Held evenly all along, a spline's samples are as sure as σ² over the weight that the basis
    gathers there; and no direction is surer than another.
    """
    n, k = BASIS.samples, 2 * BASIS.samples + 2 * reference.CAP_POINTS
    pull = np.zeros((k, 3))
    pull[:n, 0], pull[n : 2 * n, 1] = 1.0, 1.0
    other = np.zeros((k, 3))
    other[:n, 2] = 1.0
    weight = np.zeros(k)
    weight[: 2 * n] = 1.0
    turn, grow = np.zeros((k, 3)), np.zeros(k)
    # Far apart and slanting, so that no rounding is shared.
    picture = np.linspace(0.0, 1000.0, k)[:, None] * [1.0, 1.37]
    outline = picture, np.tile([1.0, 0.0], (k, 1))
    noise = 0.25
    found = reference.covariance(
        BASIS.values, BASIS.slopes, BASIS.first, np.full(n, 100.0), outline, outline,
        (pull, turn, grow, weight, weight), (other, turn, grow, weight, weight),
        1, noise, 1e6, False,
    )  # fmt: skip
    gathered = noise * np.linalg.inv(BASIS.values.T @ BASIS.values)
    expected = np.einsum("nj,jk,nk->n", BASIS.values, gathered, BASIS.values)
    for axis in range(3):
        np.testing.assert_allclose(found[:, axis, axis], expected, rtol=0.05)
    np.testing.assert_allclose(found[:, [0, 0, 1], [1, 2, 2]], 0.0, atol=1e-12)


def test_likeness_of_residuals():
    """Independent residuals are like nobody; four equal ones in a row count as one."""
    n, k = 4000, 2 * 4000 + 2 * reference.CAP_POINTS
    rng = np.random.default_rng(0)
    weight = np.ones(k)
    alone, together = rng.normal(size=k), np.repeat(rng.normal(size=k // 4), 4)
    for residual, expected in ((alone, 1.0), (together, 4.0)):
        likeness = reference.likeness(weight, residual, float(np.mean(residual**2)), n)
        assert likeness == pytest.approx(expected, rel=0.1)


def test_far_residuals_that_count_less_change_no_likeness():
    """Weighted as `Look` weights them: independent ones are like nobody, two equal ones are one."""
    n, k = 4000, 2 * 4000 + 2 * reference.CAP_POINTS
    normal = np.random.default_rng(1).normal(size=k)
    for residual, expected in ((normal, 1.0), (np.repeat(normal[: k // 2], 2), 2.0)):
        weight = 1 / (1 + (residual / 2) ** 2)
        alone = float(np.sum((weight * residual) ** 2) / weight.sum())
        likeness = reference.likeness(weight, weight * residual, alone, n)
        assert likeness == pytest.approx(expected, rel=0.1)


def rounded(picture, together=12):
    """Variance that an even edge shares, per edge point, in the middle of a rim."""
    n = len(picture)
    caps = np.zeros((2 * reference.CAP_POINTS, 2))
    everything = np.vstack([picture, picture, caps])
    normals = np.tile([0.6, 0.8], (len(everything), 1))
    shared = reference.rounding(everything, normals, np.ones(len(everything)), n, together)
    return shared[n // 2] / together


def test_an_edge_along_a_row_of_pixels_is_rounded_as_a_whole():
    x = np.arange(100.0)
    found = rounded(np.column_stack([x * 0.9, 0 * x + 7.3]))
    # 1/12 = Σ 1/(2π²h²), of which the first terms are taken.
    h = np.arange(1, reference.HARMONICS + 1)
    assert found == pytest.approx(np.sum(1 / (2 * np.pi**2 * h**2)), rel=1e-6)
    assert found == pytest.approx(1 / 12, rel=0.2)


def test_the_rounding_of_an_edge_across_the_pixels_averages_out():
    x = np.arange(100.0) * 0.64
    assert rounded(np.column_stack([x, x])) < 1e-6  # 45°
    slow = rounded(np.column_stack([x, 0.02 * x]))  # a pixel's step in 78 points
    assert 0.01 < slow < 1 / 12


# ---- how far the device reaches --------------------------------------------------------


BASE, TIP = np.array([-5.0, 3, 30]), np.array([8.0, -4, 120])
LONG = float(np.linalg.norm(TIP - BASE))


def reached(start, stop):
    """Where a curve from `start` to `stop`, shares of the device, is cut or lengthened to, mm."""
    along = TIP - BASE
    contours = seen(BASE, TIP)
    tube = straight(BASE + start * along, BASE + stop * along, basis=spline_basis(24))
    curve = seen_stretch(RIG, contours, tube, 12.0)
    return (curve[[0, -1]] - BASE) @ along / LONG


def test_a_curve_that_is_too_long_is_cut_to_what_is_seen():
    base, tip = reached(-0.2, 1.25)
    assert abs(base) < 4.0  # a width: the flat ends tell the rest
    assert abs(tip - LONG) < 4.0


def test_a_curve_that_is_too_short_is_lengthened_to_what_is_seen():
    base, tip = reached(0.1, 0.9)
    assert abs(base) < 4.0
    assert abs(tip - LONG) < 4.0


def test_a_curve_that_fits_stays_as_it_is():
    base, tip = reached(0.0, 1.0)
    assert abs(base) < 0.1
    assert abs(tip - LONG) < 0.1


def test_where_one_view_sees_the_device_go_on_the_others_end_is_a_hole():
    contour_a, contour_b = seen(BASE, TIP)
    tube = straight(BASE, TIP - 2.0 * (TIP - BASE) / LONG)  # between both views' ends
    pixels = straight_mask(RIG.a, BASE, TIP, 2.0)
    hidden = np.linalg.norm(pixels - RIG.a.project(TIP[None]), axis=1) < 13
    cut_short = mask_contour(pixels[~hidden])

    def shown(*contours):
        views = sights(contours)
        looked = [
            reference.look(*view[:2], tube.curve, tube.tangents, 2.0, CAPPED, *view[3:], 12.0)
            for view in views
        ]
        return reference.ends_shown(views, tube.curve, tube.tangents, *looked, CAPPED).tolist()

    assert shown(contour_a, contour_b) == [[FLAT, FLAT], [FLAT, FLAT]]
    assert shown(cut_short, contour_b) == [[FLAT, OPEN], [FLAT, FLAT]]


# ---- the compiled kernels --------------------------------------------------------------


@pytest.fixture(scope="module")
def compiled():
    pytest.importorskip("numba", reason="numba, which is optional, is not installed")
    from stereosom.refine import compiled

    return compiled


def random_scene(rng, tilt):
    """A camera, and a curve that leaves its axis at an angle `tilt` and bends at random."""
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    size = (1024, 768)
    focal, depth = rng.uniform(500, 4000), rng.uniform(200, 1000)
    place = rng.normal(0, 20, 3) + np.array([0, 0, depth])
    intrinsics = np.array([[focal, 0, 511.5], [0, focal, 383.5], [0, 0, 1]])
    camera = Camera.from_pose(intrinsics, rotation, place, size)
    s = np.linspace(0, 1, BASIS.samples)[:, None]
    way = np.array([np.sin(tilt), 0, np.cos(tilt)])
    seen_from = 60 * s * way + rng.normal(0, 4) * s**2 * [0, 1, 0] * np.sin(tilt)
    points = (seen_from + rng.normal(0, 5, 3) * (tilt > 0.01)) @ rotation
    velocity = np.gradient(points, axis=0, edge_order=2)
    return camera, points, velocity / np.linalg.norm(velocity, axis=1, keepdims=True)


# From across to a thousandth of a radian beside end-on; from a hair to as thick as a finger.
SEEDS = st.integers(0, 10**6)
TILTS = st.one_of(st.floats(0.2, np.pi / 2), st.floats(1e-3, 0.2))
RADII = st.sampled_from([1e-6, 1e-3, 0.5, 3.0, 10.0])
ENDS = st.tuples(*[st.sampled_from([OPEN, FLAT, ROUND])] * 2)
often = settings(max_examples=40, deadline=None)


def edges_near(rng, picture, normals):
    """Edges about an outline: some on it, some beside, some turned, some anywhere."""
    kept = np.abs(picture).max(axis=1) < 1e6
    at = rng.choice(np.flatnonzero(kept), 300)
    points = picture[at] + rng.normal(size=(300, 2)) * rng.choice([0.3, 3, 30], 300)[:, None]
    turned = normals[at] + rng.normal(size=(300, 2)) * rng.choice([0.05, 2], 300)[:, None]
    return points, turned / np.linalg.norm(turned, axis=1, keepdims=True)


def assert_same(one, other, tolerance=1e-9):
    for ours, theirs in zip(one, other, strict=True):
        theirs = np.asarray(theirs)
        scale = max(1.0, float(np.abs(theirs[np.abs(theirs) < 1e8]).max(initial=0.0)))
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=tolerance * scale)


@often
@given(SEEDS, TILTS, RADII, ENDS)
def test_compiled_outline(compiled, seed, tilt, radius, capped):
    camera, curve, tangents = random_scene(np.random.default_rng(seed), tilt)
    given_to = (camera.projection, camera.center, curve, tangents, radius, np.array(capped))
    assert_same(compiled.outline(*given_to), reference.outline(*given_to))


@often
@given(SEEDS, st.sampled_from([0.01, 0.3, 0.6, 0.99]), st.integers(1, 40), st.integers(1, 40))
def test_compiled_contour(compiled, seed, filled, width, height):
    rng = np.random.default_rng(seed)
    row, column = np.nonzero(rng.random((height, width)) < filled)
    if len(row) == 0:
        row, column = np.array([0]), np.array([0])
    pixels = np.column_stack([column, row]) + rng.integers(-50, 1000, 2).astype(float)
    pixels = rng.permutation(pixels)
    found, expected = compiled.contour(pixels), reference.contour(pixels)
    np.testing.assert_array_equal(found[0], expected[0])
    np.testing.assert_allclose(found[1], expected[1], atol=1e-12)


@often
@given(SEEDS, TILTS, RADII, st.sampled_from([2.0, 7.0, 40.0]), st.sampled_from([1.0, 8.0, 60.0]))
def test_compiled_match(compiled, seed, tilt, radius, turning, reach):
    rng = np.random.default_rng(seed)
    camera, curve, tangents = random_scene(rng, tilt)
    picture, normals, *_, bend = reference.outline(
        camera.projection, camera.center, curve, tangents, radius, CAPPED
    )
    points, directions = edges_near(rng, picture, normals)
    given_to = (picture, normals, bend, len(curve), points, directions, turning, reach)
    found, expected = compiled.match(*given_to), reference.match(*given_to)
    same = found[0] == expected[0]
    # Of two that are as near, to rounding, either may be the nearest.
    for i in np.flatnonzero(~same):
        away = [
            np.hypot(
                np.linalg.norm(points[i] - picture[k]),
                turning * np.linalg.norm(directions[i] - normals[k]),
            )
            for k in (found[0][i], expected[0][i])
        ]
        assert away[0] == pytest.approx(away[1], rel=1e-9)
    np.testing.assert_allclose(found[1][same], expected[1][same], atol=1e-9)


@often
@given(
    SEEDS,
    st.floats(0.05, np.pi / 2),
    st.sampled_from([0.5, 3.0]),
    ENDS,
    st.sampled_from([0.0, 4.0, 40.0]),
)
def test_compiled_look(compiled, seed, tilt, radius, capped, gate):
    rng = np.random.default_rng(seed)
    camera, curve, tangents = random_scene(rng, tilt)
    view = (camera.projection, camera.center, curve, tangents, radius, np.array(capped))
    edges = edges_near(rng, *reference.outline(*view)[:2])
    assert_same(compiled.look(*view, *edges, gate), reference.look(*view, *edges, gate), 1e-7)


def random_equations(rng, n):
    """Pull, turn, grow, weight and total of an outline that never was."""
    k = 2 * n + 2 * reference.CAP_POINTS
    turn = np.vstack([np.zeros((2 * n, 3)), rng.normal(size=(k - 2 * n, 3))])
    weight = rng.random(k) * (rng.random(k) < 0.7)
    return rng.normal(size=(k, 3)), turn, rng.normal(size=k), weight, weight * rng.normal(size=k)


@often
@given(SEEDS, st.integers(4, 30), st.sampled_from([0.0, 0.3]), st.booleans(), st.booleans())
def test_compiled_step(compiled, seed, segments, noise, radius_known, turning):
    rng, basis = np.random.default_rng(seed), spline_basis(segments)
    control = rng.normal(0, 30, (basis.count, 3))
    swept = reference.sweep(basis.values, basis.slopes, basis.first, control)
    assert_same(compiled.sweep(basis.values, basis.slopes, basis.first, control), swept)
    _, speed, tangents = swept
    given_to = (
        basis.values, basis.slopes, basis.first, basis.roughness, control, speed, tangents,
        random_equations(rng, basis.samples), random_equations(rng, basis.samples),
        turning, 10.0 ** rng.uniform(-4, 2), noise, radius_known,
    )  # fmt: skip
    stepped = reference.step(*given_to)
    assert_same(compiled.step(*given_to), stepped, 1e-7)
    given_to = (basis.values, basis.slopes, basis.first, speed, given_to[7], *stepped[:2])
    assert_same([compiled.crossed(*given_to)], [reference.crossed(*given_to)], 1e-7)


@settings(max_examples=20, deadline=None)
@given(
    SEEDS,
    st.sampled_from([(0.0,), (7.0, 0.0, 0.0, 0.0), (8.0, 4.0, 0.0), (14.0, 8.0, 4.0, 0.0, 0.0)]),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_compiled_descent(compiled, seed, gates, hidden, radius_known, free_in_depth):
    rng = np.random.default_rng(seed)
    contours = list(seen(BASE, TIP))
    if hidden:  # in one view, so that the other one's end must win
        pixels = straight_mask(RIG.a, BASE, TIP, 2.0)
        away = np.linalg.norm(pixels - RIG.a.project(TIP[None]), axis=1)
        contours[0] = mask_contour(pixels[away > 10])
    between = straight(BASE, TIP - 1.2 * (TIP - BASE) / LONG)
    control = BASIS.through(between.curve) + rng.normal(0, 0.2, (BASIS.count, 3))
    given_to = (
        (BASIS.values, BASIS.slopes, BASIS.first), BASIS.roughness, control,
        rng.uniform(1.5, 2.5), 10.0 ** rng.uniform(-3, 0), sights(contours), CAPPED,
        np.stack([CAPPED, CAPPED]), np.array(gates), np.arange(len(gates)) % 2 == 1, 0.25, 0.1,
        radius_known, free_in_depth,
    )  # fmt: skip
    found, expected = compiled.descend(*given_to), reference.descend(*given_to)
    assert_same([*found[:3], found[7]], [*expected[:3], expected[7]], 1e-6)
    for one, other in zip(found[3:6], expected[3:6], strict=True):
        assert_same(one, other, 1e-6)
    np.testing.assert_array_equal(found[6], expected[6])
    assert (expected[6][0, 1] == OPEN) == (hidden and 8.0 in gates)


def test_a_fit_that_leaves_the_device_says_so(compiled):
    edges = seen(BASE, TIP)[0]
    far = Contour(edges.points + 400, edges.directions)
    control = BASIS.through(straight(BASE, TIP).curve)
    given_to = (
        (BASIS.values, BASIS.slopes, BASIS.first), BASIS.roughness, control, 2.0, 1.0,
        sights((far, far)), CAPPED, np.stack([CAPPED, CAPPED]), np.array([7.0]),
        np.array([False]), 0.25, 0.1, False, False,
    )  # fmt: skip
    for kernels in (compiled, reference):
        with pytest.raises(ValueError, match="too little of the device's outline"):
            kernels.descend(*given_to)


@often
@given(SEEDS, TILTS, st.booleans(), st.integers(1, 12))
def test_compiled_covariance(compiled, seed, tilt, radius_known, together):
    rng = np.random.default_rng(seed)
    outlines = []
    for _ in range(2):
        camera, curve, tangents = random_scene(rng, tilt)
        view = (camera.projection, camera.center, curve, tangents, 1.0, CAPPED)
        outlines.append(reference.outline(*view)[:2])
    n = BASIS.samples
    given_to = (
        BASIS.values, BASIS.slopes, BASIS.first, rng.uniform(1, 100, n), *outlines,
        random_equations(rng, n), random_equations(rng, n), together, 0.2, 100.0, radius_known,
    )  # fmt: skip
    assert_same([compiled.covariance(*given_to)], [reference.covariance(*given_to)], 1e-7)


@often
@given(SEEDS, ENDS, st.tuples(st.floats(0, 0.4), st.floats(0.6, 1)))
def test_compiled_covariance_by_length(compiled, seed, opened, shares):
    rng = np.random.default_rng(seed)
    _, curve, tangents = random_scene(rng, 0.7)
    root = rng.normal(size=(len(curve), 3, 3))
    given_to = (
        curve, tangents, root @ root.transpose(0, 2, 1), np.array([1.0, 2.25]),
        np.where(opened, 0.04, np.nan), *shares, 100,
    )  # fmt: skip
    assert_same([compiled.by_length(*given_to)], [reference.by_length(*given_to)])


def test_along_a_curve_its_covariance_is_that_of_its_ends():
    # Across a line along z the covariance stays; along it, it goes from one end's to the other's.
    curve = np.linspace([0.0, 0, 0], [0, 0, 10], 41)
    sure = np.tile(np.diag([0.3, 0.2, 9.0]), (41, 1, 1))
    found = reference.by_length(
        curve, np.tile([0.0, 0, 1], (41, 1)), sure, np.ones(2), np.array([1.0, 4.0]), 0.0, 1.0, 3
    )
    np.testing.assert_allclose(found, [np.diag([0.3, 0.2, a]) for a in (1.0, 2.5, 4.0)])


@often
@given(SEEDS, st.integers(3, 130), ENDS, st.floats(0, 1))
def test_compiled_account_of_the_rims(compiled, seed, n, capped, shown):
    rng = np.random.default_rng(seed)
    k = 2 * n + 2 * reference.CAP_POINTS
    weight = rng.random(k) * (rng.random(k) < shown)
    total, squares = weight * rng.normal(size=k), weight * rng.random(k)
    given_to = (weight, squares, n, 0.8)
    seen = reference.rims_seen(*given_to)
    np.testing.assert_array_equal(compiled.rims_seen(*given_to), seen)
    picture = rng.normal(0, 100, (k, 2))
    given_to = (picture, seen, np.array(capped))
    assert compiled.unseen(*given_to) == pytest.approx(reference.unseen(*given_to), abs=1e-9)
    given_to = (weight, total, n)
    assert compiled.middle_offset(*given_to) == pytest.approx(reference.middle_offset(*given_to))
    given_to = (weight, total, 0.3, n)
    assert compiled.likeness(*given_to) == pytest.approx(reference.likeness(*given_to))


@often
@given(SEEDS, TILTS, RADII, st.integers(1, 20))
def test_compiled_rounding(compiled, seed, tilt, radius, together):
    rng = np.random.default_rng(seed)
    camera, curve, tangents = random_scene(rng, tilt)
    picture, normals, *_ = reference.outline(
        camera.projection, camera.center, curve, tangents, radius, CAPPED
    )
    weight = rng.random(len(picture)) * (rng.random(len(picture)) < 0.7)
    given_to = (picture, normals, weight, len(curve), together)
    assert_same([compiled.rounding(*given_to)], [reference.rounding(*given_to)])


@often
@given(SEEDS, st.integers(1, 40), st.integers(1, 40), st.sampled_from([0.45, 25.0]))
def test_compiled_pairing(compiled, seed, n, m, left_out):
    rng = np.random.default_rng(seed)
    a, b = np.cumsum(rng.normal(1, 2, n)), np.cumsum(rng.normal(1, 2, m))
    given_to = (a, b, 0.5, (25.0, left_out), (left_out, 25.0))
    found, expected = compiled.pair_in_order(*given_to), reference.pair_in_order(*given_to)
    assert_same(found, expected)


@often
@given(SEEDS, st.integers(4, 60), st.booleans())
def test_compiled_roughness(compiled, seed, segments, straight):
    basis = spline_basis(segments)
    control = np.random.default_rng(seed).normal(0, 30, (basis.count, 3))
    if straight:
        control = np.linspace([0.0, 0, 0], [4, 8, 16], basis.count).round()
    around = np.eye(basis.count - 2)
    given_to = (control, around, 0.12)
    assert_same([compiled.roughness_like(*given_to)], [reference.roughness_like(*given_to)])


@often
@given(SEEDS, st.integers(1, 60), st.integers(2, 90), st.booleans())
def test_compiled_lengths(compiled, seed, n, count, halts):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 30, (n, 3))
    if halts:
        points = np.repeat(points, 2, axis=0)
    reach = reference.reach_along(points)
    assert_same([compiled.reach_along(points)], [reach])
    given_to = (points, reach, count)
    assert_same([compiled.evenly(*given_to)], [reference.evenly(*given_to)])
    given_to = (RIG.a.projection, points)
    found, expected = compiled.steps_in_picture(*given_to), reference.steps_in_picture(*given_to)
    assert_same([found[0], [found[1]]], [expected[0], [expected[1]]])
    given_to = (RIG.a.projection, 2400.0, RIG.b.projection, 1200.0, points)
    assert_same([compiled.reach_in_pictures(*given_to)], [reference.reach_in_pictures(*given_to)])


def test_steps_in_a_picture_and_points_at_even_steps():
    corner = np.array([[0.0, 0, 0], [0, 0, 30], [40, 0, 30]])
    reach = reference.reach_along(corner)
    np.testing.assert_allclose(reach, [0, 30, 70])
    even = reference.evenly(corner, reach, 8)
    np.testing.assert_allclose(
        even[[0, 2, 4, 7]], [[0, 0, 0], [0, 0, 20], [10, 0, 30], [40, 0, 30]]
    )
    # A camera at (0, 0, -100) of focal length 500: 500 * 40 / 130 px across, nothing along.
    projection = np.array([[500.0, 0, 0, 0], [0, 500, 0, 0], [0, 0, 1, 100]])
    steps, depth = reference.steps_in_picture(projection, corner)
    np.testing.assert_allclose(steps, [0, 500 * 40 / 130])
    assert depth == 120
    # Another one, of focal length 100, at (-50, 0, 30), sees what that one does not: 30 mm along
    # z from 50 and 90 mm away, and 40 along its own axis. Depths are 50, 50 and 90 mm.
    beside = np.array([[0.0, 0, 100, -3000], [0, 100, 0, 0], [1, 0, 0, 50]])
    reach = reference.reach_in_pictures(projection, 500.0, beside, 100.0, corner)
    mean = (50 + 50 + 90) / 3
    np.testing.assert_allclose(reach, [0, 60 * mean / 100, 60 * mean / 100 + 40 / 130 * 120])


# ---- numba is a choice -----------------------------------------------------------------


@pytest.fixture
def without_numba(monkeypatch):
    choice.kernels.cache_clear()
    monkeypatch.setattr("stereosom.loops.find_spec", lambda name: None)
    yield
    monkeypatch.undo()
    choice.kernels.cache_clear()


def test_all_works_alike_without_numba(without_numba, monkeypatch):
    shown = observe(arc(60, 90), 1.0, RIG)
    assert choice.kernels() is reference
    plain = reconstruct(shown)
    assert plain.ok, plain.reason
    monkeypatch.undo()
    choice.kernels.cache_clear()
    again = reconstruct(shown)
    np.testing.assert_allclose(plain.backbone.sample(50), again.backbone.sample(50), atol=1e-6)
    np.testing.assert_allclose(plain.covariance, again.covariance, rtol=1e-3, atol=1e-9)


def test_importing_the_core_does_not_import_numba():
    script = "import sys, stereosom; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "False", done.stdout + done.stderr


# ---- an end on its own ---------------------------------------------------------------


def fitted(tube, contours):
    """The tube as a fit, without a fit."""
    return TubeFit(
        BASIS.backbone(BASIS.through(tube.curve)),
        tube.radius,
        tube,
        looks_at(tube, contours),
        False,
    )


@pytest.mark.parametrize("end", [0, 1])
def test_an_end_is_fitted_to_its_own_edges_only(end):
    # 14 radii of 2 mm are 28 of the device's 110 mm.
    start, stop = np.array([-15.0, 3, 20]), np.array([28.0, -14, 120])
    contours, tube = seen(start, stop, radius=2.0), straight(start, stop)
    piece = EndPiece.of(RIG, fitted(tube, contours), contours, end)
    length = np.linalg.norm(stop - start)
    assert np.linalg.norm(piece.curve[0] - piece.curve[-1]) == pytest.approx(28, abs=length / 40)
    for camera, contour, whole in zip((RIG.a, RIG.b), piece.edges, contours, strict=True):
        assert 0.15 < len(contour) / len(whole) < 0.35
        to_end = np.linalg.norm(contour.points - camera.project(tube.curve[[-end]]), axis=1)
        assert to_end.max() < 33 / camera.pixel_size(tube.curve).min()
    found = piece.fit(piece.curve, FLAT)
    assert found.tube.capped == ((FLAT, OPEN) if end == 0 else (OPEN, FLAT))
    np.testing.assert_allclose(found.tube.curve[-end], tube.curve[-end], atol=0.1)
    np.testing.assert_array_equal(piece.joined_to(tube.curve, piece.curve), tube.curve)


def test_an_end_that_is_most_of_a_device_is_all_of_it():
    contours, tube = seen([0, 0, 20], [0, 0, 80], radius=2.0), straight([0, 0, 20], [0, 0, 80])
    piece = EndPiece.of(RIG, fitted(tube, contours), contours, 1)
    assert piece.is_whole
    assert piece.edges == contours
    assert piece.fit(piece.curve, FLAT).tube.capped == (FLAT, FLAT)


@pytest.mark.parametrize("end", [0, 1])
def test_a_mirrored_end_is_tilted_as_much_the_other_way(end):
    tube = straight([-15.0, 3, 20], [28.0, -14, 120], basis=spline_basis(40))
    mirrored = mirrored_in_depth(RIG, tube, end)
    away = [tube.curve[-end] - camera.center for camera in (RIG.a, RIG.b)]
    sight = sum(one / np.linalg.norm(one) for one in away)
    sight /= np.linalg.norm(sight)

    def slope(curve):
        step = curve[-1] - curve[-2] if end else curve[0] - curve[1]
        return step @ sight / np.linalg.norm(step - (step @ sight) * sight)

    assert slope(mirrored) == pytest.approx(-slope(tube.curve), rel=0.1)
    np.testing.assert_array_equal(mirrored[30:-30], tube.curve[30:-30])
