"""Words on pictures: none over another, all of them inside, the bar as long as it says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc, converging_rig, growing_helix
from stereosom_plugin import render
from stereosom_plugin.polydata import to_centerline
from stereosom_plugin.render.lettering import Lettering
from stereosom_plugin.render.style import round_step

WHITE = np.full((300, 400, 3), 255, dtype=np.uint8)


def overlaps(boxes):
    return [
        (one, other)
        for i, one in enumerate(boxes)
        for other in boxes[i + 1 :]
        if min(one[2], other[2]) - max(one[0], other[0]) > 0.5
        and min(one[3], other[3]) - max(one[1], other[1]) > 0.5
    ]


def centerline(curve, frame=0):
    known = {"status": "ok", "residuals": (0.1, 0.1), "radius": 1.0}
    return to_centerline(
        Reconstruction(
            index=frame,
            time=frame / 7.5,
            backbone=curve,
            covariance=np.tile(4 * np.eye(3), (4, 1, 1)),
            **known,
        )
    )


@pytest.mark.parametrize("view", ["overview", "best", "a", "b"])
@pytest.mark.parametrize("size", [(1280, 720), (500, 400), (300, 600)])
def test_no_words_of_a_picture_overlap_or_leave_it(view, size):
    curve, rig = arc(60, 120), converging_rig(60)
    lines = [centerline(curve, frame) for frame in range(3)]
    with render.Stage(render.survey(lines), rig, view=view, size=size) as stage:
        shot = render.Shot(lines[2], rig, None, tuple(lines[:2]), render.heading(lines[2], rig))
        boxes = stage.lettered(shot).boxes
    assert overlaps(boxes) == []
    left, top, right, bottom = np.array(boxes).T
    assert min(left.min(), top.min()) >= 0
    assert right.max() <= size[0]
    assert bottom.max() <= size[1]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_names_never_meet_and_are_left_out_where_there_is_no_room(seed):
    rng = np.random.default_rng(seed)
    lettering = Lettering(WHITE[:150, :200])
    said = [
        lettering.name(place, "base of it", "#000000", rng.uniform(0, 200, (50, 2)))
        for place in rng.uniform(0, 150, (40, 2))
    ]
    assert overlaps(lettering.boxes) == []
    assert len(lettering.boxes) == sum(said) < 40


def test_a_scale_bar_is_as_long_as_it_says():
    lettering = Lettering(WHITE)
    lettering.scale_bar(3.0)  # a fifth of 400 px holds 26.7 mm: the bar is 20 mm, 60 px
    dark = np.all(lettering.picture[-lettering.margin - 2] < 128, axis=-1)
    assert np.count_nonzero(dark) == pytest.approx(60, abs=1)


@given(st.floats(1e-4, 1e6), st.floats(1, 6))
def test_round_steps_are_round_and_fit(span, steps):
    step = round_step(span, steps)
    assert 0.4 * span / steps <= step <= span / steps * (1 + 1e-9)
    assert round(step / 10 ** np.floor(np.log10(step) + 1e-9), 6) in (1, 2, 5)


def test_long_words_of_a_heading_end_before_the_legend():
    lettering = Lettering(WHITE)
    lettering.color_bar("Curvature", (0, 0.1))
    lettering.heading(["frame 3", "lost: " + "no device was seen in either view " * 5])
    assert overlaps(lettering.boxes) == []


def test_growing_devices_keep_their_place_in_a_film():
    """The eye is set for the whole run: what does not move in space stays where it is."""
    curve, rig = growing_helix(), converging_rig(60)
    short = curve.between(0, curve.length / 2)
    lines = [centerline(short, 0), centerline(curve, 1)]
    with render.Stage(render.survey(lines), rig, view="best", size=(320, 240)) as stage:
        one, two = (stage.draw(render.Shot(line, rig)) for line in lines)
    base = np.all(np.abs(one.astype(int) - two) < 8, axis=-1)
    row, column = np.nonzero(one.astype(int).sum(axis=-1) < 300)
    assert len(row) > 100
    assert np.mean(base[row, column]) > 0.5
