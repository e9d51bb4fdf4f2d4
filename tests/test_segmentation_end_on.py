"""Ends that point at a source: pictures of points that fill a tube, and known answers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree

from stereosom.camera import Camera, StereoRig
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.segmentation import BiplaneSegmenter
from stereosom_plugin.segmentation.end_on import EndFinder, EndView
from stereosom_plugin.segmentation.end_pictures import Additive, Axis, Covering, Window
from stereosom_plugin.segmentation.tube import Tube
from stereosom_plugin.segmentation.xray import candidates, fit, prepare

SIZE, RADIUS, ABSORPTION = 256, 1.0, 1.5


def camera(primary_deg):
    """Plane at an angle about the patient's axis, as `docs/conventions.md` has it."""
    a, middle = np.radians(primary_deg), (SIZE - 1) / 2
    turn = [[np.cos(a), np.sin(a), 0], [0, 0, -1], [np.sin(a), -np.cos(a), 0]]
    scale = [[2750, 0, middle], [0, 2750, middle], [0, 0, 1]]
    return Camera(scale @ np.column_stack([turn, [0, 0, 750]]), (SIZE, SIZE))


RIG = StereoRig(camera(-10), camera(80))


def curve(past_deg):
    """Enters from the foot side and bends until its tip points so far past the source of a."""
    source = RIG.a.center / np.linalg.norm(RIG.a.center)
    angle = np.radians(90 + past_deg) * np.clip(np.linspace(-1.2, 1, 1000), 0, 1)
    heading = np.cos(angle)[:, None] * [0, 0, 1.0] + np.sin(angle)[:, None] * source
    return np.array([2.0, 3, -38]) + np.cumsum(heading, axis=0) * 0.05


def additive(points, view):
    """Share of light that passes: the way through metal of points that fill a tube evenly."""
    rng = np.random.default_rng(0)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(tangent, [0.3, 1.0, 0.2])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    also = np.cross(tangent, across)
    place = rng.uniform(-1, 1, (2, len(points), 400)) * RADIUS
    inside = np.hypot(*place) < RADIUS
    filled = (
        points[:, None]
        + place[0][..., None] * across[:, None]
        + place[1][..., None] * also[:, None]
    )
    filled = filled[inside]
    step = np.linalg.norm(points[1] - points[0])
    each = len(points) * step * np.pi * RADIUS**2 / len(filled)
    column, row = np.rint(view.project(filled)).astype(int).T
    seen = (column >= 0) & (column < SIZE) & (row >= 0) & (row < SIZE)
    area = view.pixel_size(filled) ** 2
    through = np.zeros((SIZE, SIZE))
    np.add.at(through, (row[seen], column[seen]), (each / area)[seen])
    return np.exp(-ABSORPTION * through / (2 * RADIUS))


def flat(points, view):
    """Share of light that passes as it is often drawn: the chord about the nearest point."""
    axis = view.project(points)
    radius = RADIUS / view.pixel_size(points).mean()
    row, column = np.indices((SIZE, SIZE))
    pixels = np.stack([column, row], axis=-1).reshape(-1, 2)
    distance, nearest = cKDTree(axis).query(pixels, distance_upper_bound=radius + 1)
    chord = np.sqrt(np.clip(1 - (distance / radius) ** 2, 0, None))
    beyond = (pixels - axis[-1]) @ (axis[-1] - axis[-3]) > 0
    chord[beyond & (nearest >= len(axis) - 1)] = 0
    return np.exp(-ABSORPTION * chord).reshape(SIZE, SIZE)


def pictures(points, draw):
    rng = np.random.default_rng(1)
    light = [ndimage.gaussian_filter(draw(points, view), 0.7) for view in (RIG.a, RIG.b)]
    return tuple(rng.poisson(2000 * one).astype(float) for one in light)


@pytest.mark.parametrize("draw", [additive, flat], ids=lambda draw: draw.__name__)
@pytest.mark.parametrize("past_deg", [-25, 0, 25])
def test_the_end_is_found_and_how_light_is_absorbed(draw, past_deg):
    points = curve(past_deg)
    images = pictures(points, draw)
    views = [prepare(image) for image in images]
    tubes = [fit(view, candidates(view)[0]) for view in views]
    ends = [0 if tube.enters[1] else -1 for tube in tubes]
    along, beside = (EndView(*one) for one in zip((RIG.a, RIG.b), tubes, ends, strict=True))
    finder = EndFinder()
    found = finder.find(RIG, along, beside, views[0].picture, images[0] < 1000)
    assert np.linalg.norm(found.place - points[-1]) < 0.35
    heading = points[-1] - points[-9]
    assert found.heading @ heading / np.linalg.norm(heading) > 0.9
    assert cKDTree(points).query(found.tail)[0].max() < 0.4
    assert (finder.costs["additive"] < finder.costs["flat"]) == (draw is additive)


def test_masks_hold_the_fold_and_follow_it():
    frames = [pictures(curve(past), additive) for past in (-20, -10, 0, 10)]
    run = Acquisition(lambda index: frames[index], (RIG,), np.arange(4) / 15)
    both = BiplaneSegmenter(run)
    for index, past in enumerate((-20, -10, 0, 10)):
        masks = both(run[index])
        for mask, view in zip(masks, (RIG.a, RIG.b), strict=True):
            truth = additive(curve(past), view) < np.exp(-0.1 * ABSORPTION)
            assert (mask & truth).sum() / (mask | truth).sum() > 0.85


def window():
    """About the end of a tube that lies across a picture, from the left to its middle."""
    row, column = np.indices((80, 80))
    share = np.sqrt(np.clip(1 - ((row - 40) / 3.5) ** 2, 0, None)) * (column <= 40)
    picture = (1000 * np.exp(-ABSORPTION * share)).astype(np.float32)
    line = np.column_stack([np.arange(41.0), np.full(41, 40.0)])
    tube = Tube(line, np.full(41, 3.5), ABSORPTION, 0.5, (True, False))
    return Window(picture, share > 0, tube, -1, 24.0)


@pytest.mark.parametrize("name", ["additive", "covering", "flat"])
def test_seen_from_the_side_all_accounts_are_the_chord(name):
    seen = window()
    body = Axis(seen.inside(np.array([[0.0, 40], [20, 40]])), np.array([0.0, 20]))
    tail = Axis(seen.inside(np.array([[20.0, 40], [40, 40]])), np.array([0.0, 20]))
    if name == "additive":
        model = Additive(seen, body, 0.5)
    else:
        model = Covering(seen, body, 0.5, face=name == "covering")
    off = model(tail, ABSORPTION) - seen.root[seen.compared]
    assert np.sqrt(np.mean(off**2)) < 0.06


def test_lengthwise_it_is_darker_where_light_is_absorbed_all_the_way():
    seen = window()
    body = Axis(seen.inside(np.array([[0.0, 40], [20, 40]])), np.array([0.0, 20]))
    point = seen.inside(np.array([[30.0, 40], [30.01, 40]]))
    tail = Axis(point, np.array([0.0, 21.0]))  # three diameters towards the source
    row, column = np.nonzero(seen.compared)
    x, y = point[0]
    middle = int(np.argmin(np.hypot(row - y, column - x)))
    through = Additive(seen, body, 0.5)(tail, ABSORPTION)[middle] ** 2
    assert -np.log(through) / ABSORPTION == pytest.approx(3, rel=0.2)
    covered = Covering(seen, body, 0.5, face=True)(tail, ABSORPTION)[middle] ** 2
    assert -np.log(covered) / ABSORPTION == pytest.approx(1, rel=0.2)
