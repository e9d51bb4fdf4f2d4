"""A few small pictures are compared with stored ones, in `tests/pictures`.

A difference means that what is drawn has changed: something is missing, in another place or of
another color. Look at the picture that the failing test names, beside the stored one. If the
new one is as it should be, store it:

    STEREOSOM_STORE_PICTURES=1 python -m pytest tests/test_render_pictures.py

and commit it with the change. Edges may differ by a pixel and shades a little, between versions
of VTK, of its OpenGL and of the typeface: pictures are compared as means over 4 by 4 pixels,
and only a patch that is far off counts.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from stereosom.camera import Camera, StereoRig
from stereosom.reconstruction import Reconstruction
from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin import render
from stereosom_plugin.polydata import to_centerline

STORED = Path(__file__).parent / "pictures"
SIZE = (480, 360)
# Of 255: how far the mean of a patch may be off, and how many patches of 10800 may be farther.
# Of the changes in `test_the_comparison_sees`, below, the weakest moves 30 of them.
OFF_BY, PATCHES = 32.0, 12


def patches(picture):
    rows, columns = (side // 4 * 4 for side in picture.shape[:2])
    blocks = picture[:rows, :columns].reshape(rows // 4, 4, columns // 4, 4, 3)
    return blocks.astype(float).mean(axis=(1, 3))


def patches_off(one, other):
    """How many patches of two pictures of one size are not alike."""
    return int(np.count_nonzero(np.abs(patches(one) - patches(other)).max(axis=-1) > OFF_BY))


def bent(angle_deg=120):
    """An arc of 125 mm length that stands askew, so that no view is along its plane."""
    turn = np.radians(35)
    askew = [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    return arc(125 / np.radians(angle_deg), angle_deg).transformed(np.array(askew), [-20, -15, -30])


def centerline(angle_deg=120, frame=0, doubt=5.0):
    """A curve whose middle the views hardly determine."""
    along = np.linspace(0, 1, 30)
    sigma = 0.1 + doubt * np.exp(-(((along - 0.5) / 0.15) ** 2))
    covariance = np.zeros((30, 3, 3))
    covariance[:, [0, 1], [0, 1]] = 0.01
    covariance[:, 2, 2] = sigma**2
    return to_centerline(
        Reconstruction(
            index=frame,
            time=frame / 7.5,
            status="ok",
            backbone=bent(angle_deg),
            covariance=covariance,
            residuals=(0.4, 0.5),
            radius=1.5,
        )
    )


def converging():
    rig = converging_rig(60)
    images = tuple(shaded(camera, light) for camera, light in ((rig.a, 60), (rig.b, 130)))
    return rig, images


def shaded(camera, light):
    """A view's picture: lighter to the right, a dark disk, the device."""
    rows, columns = np.indices(camera.image_size[::-1])
    picture = light + 120 * columns / columns.max()
    picture[np.hypot(rows - 0.3 * len(rows), columns - 0.6 * len(rows)) < 0.15 * len(rows)] *= 0.6
    picture[silhouette(bent(), 1.5, camera)] = 10
    return picture.astype(np.uint8)


def side_by_side():
    k = [[200, 0, 119.5], [0, 200, 89.5], [0, 0, 1]]
    eyes = (Camera.from_pose(k, np.eye(3), [x, 30, 130], (240, 180)) for x in (-30.0, -35.0))
    return StereoRig(*eyes, frame="camera_a")


def overview(lines, **changes):
    rig, images = converging()
    return drawn(lines, rig, images, **{"view": "overview", **changes})


def drawn(lines, rig, images=None, *, view, color_by=None, turn_deg=0.0):
    spanned = render.survey(lines, color_by)
    with render.Stage(spanned, rig, view=view, size=SIZE) as stage:
        words = render.heading(lines[-1], rig)
        shot = render.Shot(lines[-1], rig, images, tuple(lines[:-1]), words)
        return stage.draw(shot, turn_deg)


def over_time(**changes):
    lines = [centerline(60 + 40 * k, k, **changes) for k in range(3)]
    return drawn(lines, converging_rig(60), view="best", color_by="Time")


def overlaid(outline=True):
    rig, images = converging()
    rows, columns = np.nonzero(images[0] < 20)
    pixels = np.column_stack([columns, rows]).astype(float)
    over = render.Overlay.of(
        centerline(), images[0], rig.a, "a", "view a", pixels if outline else None
    )
    return render.overlaid(over, size=SIZE, scale_bar=True)


PICTURES = {
    "overview": lambda: overview([centerline()]),
    "view_b": lambda: overview([centerline()], view="b", color_by="StandardDeviation"),
    "best_side_over_time": lambda: over_time(),
    "eyes_side_by_side": lambda: drawn([centerline(90)], side_by_side(), view="overview"),
    "overlay": overlaid,
}


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_as_stored(name, tmp_path):
    picture, stored = PICTURES[name](), STORED / f"{name}.png"
    if os.environ.get("STEREOSOM_STORE_PICTURES"):
        render.write_picture(picture, stored)
    with Image.open(stored) as image:
        known = np.asarray(image.convert("RGB"))
    fresh = tmp_path / f"{name}.png"
    render.write_picture(picture, fresh)
    assert known.shape == picture.shape
    off = patches_off(known, picture)
    assert off <= PATCHES, f"{off} patches are off: look at {fresh} beside {stored}"


CHANGES = {
    "no device": ("overview", lambda: without_device()),
    "no pictures": ("overview", lambda: drawn([centerline()], converging()[0], view="overview")),
    "pictures exchanged": (
        "overview",
        lambda: drawn([centerline()], converging()[0], converging()[1][::-1], view="overview"),
    ),
    "other colors": ("overview", lambda: overview([centerline()], color_by="StandardDeviation")),
    "eye a little aside": ("overview", lambda: overview([centerline()], turn_deg=2)),
    "no doubt": ("best_side_over_time", lambda: over_time(doubt=0.0)),
    "no outline": ("overlay", lambda: overlaid(outline=False)),
}


def without_device():
    rig, images = converging()
    with render.Stage(render.survey([centerline()]), rig, size=SIZE) as stage:
        return stage.draw(render.Shot(None, rig, images, (), render.heading(centerline(), rig)))


@pytest.mark.parametrize("change", CHANGES)
def test_the_comparison_sees(change):
    """A comparison that lets anything pass would guard nothing: each change must be found."""
    name, changed = CHANGES[change]
    with Image.open(STORED / f"{name}.png") as image:
        known = np.asarray(image.convert("RGB"))
    assert patches_off(known, changed()) > 2 * PATCHES


def test_the_comparison_forgives_a_pixel_and_a_shade():
    """What another OpenGL or typeface does: an edge half a pixel aside, shades a little off."""
    picture = PICTURES["overview"]()
    aside = (picture.astype(float) + np.roll(picture, 1, axis=1)) / 2
    darker = np.clip(aside * 0.97 + 2, 0, 255)
    assert patches_off(picture, darker) <= PATCHES
