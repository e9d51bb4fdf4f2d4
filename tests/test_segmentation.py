"""Known answers on drawn pictures, and the true tubes of the biplane studies."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree

from stereosom.synthetic import converging_rig
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.errors import InputError
from stereosom_plugin.segmentation import BiplaneSegmenter, binary, observe, segment_xray

SIZE = 256


def drawn(distance, width, *, opacity=1.6, seed=0):
    """Picture of a round tube over a gradient, blurred, with photon noise; and its true mask.

    `distance` holds each pixel's distance from the axis.
    """
    rng = np.random.default_rng(seed)
    light = np.linspace(600, 3000, SIZE)[None, :].repeat(SIZE, 0)
    depth = np.sqrt(np.clip(1 - (2 * distance / width) ** 2, 0, None))
    picture = ndimage.gaussian_filter(light * np.exp(-opacity * depth), 0.7)
    return picture + rng.normal(size=picture.shape) * np.sqrt(3 * picture), distance <= width / 2


def distances(axis):
    row, column = np.indices((SIZE, SIZE))
    distance, _ = cKDTree(axis).query(np.stack([column, row], axis=-1).reshape(-1, 2))
    return distance.reshape(SIZE, SIZE)


def straight(angle_deg=30.0):
    along = np.linspace(-200, 110, 3000)[:, None]
    direction = np.array([np.sin(np.radians(angle_deg)), -np.cos(np.radians(angle_deg))])
    return np.array([110, 128]) + along * direction


def curved():
    angle = np.linspace(-0.2, 2.2, 4000)
    return np.column_stack([150 - 100 * np.cos(angle), 250 - 130 * np.sin(angle)])


def overlap(mask, truth):
    return (mask & truth).sum() / (mask | truth).sum()


@pytest.mark.parametrize("width", [3.5, 5.0, 7.5, 11.0])
@pytest.mark.parametrize("axis", [straight(0), straight(30), curved()], ids=["0", "30", "curved"])
def test_tube_is_filled_to_its_edges(axis, width):
    picture, truth = drawn(distances(axis), width)
    mask = segment_xray(picture, width_px=12)
    assert ndimage.label(mask, np.ones((3, 3)))[1] == 1
    length = np.linalg.norm(
        np.diff(axis[np.all((axis >= 0) & (axis < SIZE), axis=1)], axis=0), 2, 1
    )
    assert abs((mask.sum() - truth.sum()) / length.sum()) < 1  # px of width
    assert overlap(mask, truth) > (0.75 if width < 5 else 0.9)


def test_flat_end_is_where_it_is():
    row, column = np.indices((SIZE, SIZE))
    distance = np.where(row >= 100, abs(column - 128.0), 99)
    mask = segment_xray(drawn(distance, 7)[0], width_px=12)
    assert abs(mask.nonzero()[0].min() - 100) <= 1
    assert mask[-1].any()


def test_crossing_of_itself_is_kept():
    along = np.linspace(-1, 1, 4000)
    turn = np.pi * (1 + np.tanh(4 * along)) * 0.85  # a loop, entered straight and left straight
    heading = np.column_stack([np.sin(turn), -np.cos(turn)])
    axis = np.cumsum(heading, axis=0) * 0.115
    axis += [90, 262] - axis[0]
    picture, truth = drawn(distances(axis), 6)
    mask = segment_xray(picture, width_px=12)
    assert overlap(mask, truth) > 0.9


def test_fainter_wires_are_left_out():
    device, truth = drawn(distances(straight()), 7)
    row, column = np.indices((SIZE, SIZE))
    wire = np.exp(-0.4 * (abs(row - 128 - 0.3 * (column - 128)) < 2))
    assert overlap(segment_xray(device * wire, width_px=12), truth) > 0.9


def test_dark_corners_are_no_device():
    row, column = np.indices((SIZE, SIZE))
    picture, truth = drawn(distances(straight(0)), 7)
    light = np.hypot(row - 127.5, column - 127.5) < 135
    mask = segment_xray(np.where(light, picture, 20), width_px=12)
    assert overlap(mask, truth & light) > 0.9


def test_only_the_field_of_view_is_searched():
    picture, truth = drawn(distances(straight(0)), 7)
    field = [[20, 10], [230, 10], [230, 200], [20, 200]]
    mask = segment_xray(picture, field_of_view=field, width_px=12)
    assert not mask[202:].any()
    assert overlap(mask[:199], truth[:199]) > 0.9


@pytest.mark.parametrize("mean", [3, 30, 1000])
@pytest.mark.parametrize("spread", [0.05, 0.3, 1.0])
def test_noise_is_no_device(mean, spread):
    rng = np.random.default_rng(1)
    assert not segment_xray(mean * np.exp(spread * rng.normal(size=(SIZE, SIZE)))).any()


@pytest.mark.parametrize(
    "picture", [np.zeros((64, 64)), np.full((64, 64), 7), np.ones((3, 5), int)]
)
def test_constant_picture_has_no_device(picture):
    assert not segment_xray(picture).any()
    assert not binary(picture).any()


@pytest.mark.parametrize("segment", [segment_xray, binary])
@pytest.mark.parametrize(
    ("image", "why"),
    [
        (np.full((9, 9), np.nan), "not finite"),
        (np.full((9, 9), np.inf), "not finite"),
        (np.zeros((9, 9, 3)), "9×9×3"),
        (np.zeros(9), "rows × columns"),
        (np.zeros((0, 9)), "0×9"),
        ([["a", "b"]], "numbers"),
    ],
)
def test_bad_image_is_refused(segment, image, why):
    with pytest.raises(ValueError, match=why):
        segment(image)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int16, float])
def test_binary_takes_what_is_above_half_of_the_range(dtype):
    image = np.array([[0, 1], [1, 0]], dtype=dtype)
    assert (binary(image) == [[False, True], [True, False]]).all()


def test_binary_does_not_overflow():
    image = np.array([[200, 255], [227, 228]], dtype=np.uint8)  # half of the range: 227.5
    assert (binary(image) == [[False, True], [False, True]]).all()


class Frames:
    """Reads blank frames with one pixel set, counts how many, and fails at those it is told."""

    def __init__(self, *broken):
        self.broken, self.read = broken, []

    def __call__(self, index):
        self.read.append(index)
        if index in self.broken:
            raise InputError("a.dcm", f"frame {index} is cut short", "export it again")
        image = np.zeros((768, 1024))
        image[10 + index, 20] = 1
        return image, image


def acquisition(frames, **described):
    return Acquisition(frames, (converging_rig(45),), np.arange(4) / 15, **described)


def test_observe_reads_one_frame_at_a_time():
    frames = Frames()
    seen = observe(acquisition(frames), binary)
    assert frames.read == []
    first = next(seen)
    assert frames.read == [0]
    assert (first.pixels_a == [[20, 10]]).all()
    assert [(one.index, one.time) for one in seen] == [(1, 1 / 15), (2, 2 / 15), (3, 3 / 15)]


def test_observe_takes_the_frames_that_are_wanted():
    frames = Frames()
    assert [one.index for one in observe(acquisition(frames), binary, frames=[3, 1])] == [3, 1]
    assert frames.read == [3, 1]


def test_a_broken_frame_ends_nothing_and_says_why():
    seen = list(observe(acquisition(Frames(1)), binary))
    assert [len(one.pixels_a) for one in seen] == [1, 0, 1, 1]
    assert "frame 1 is cut short" in seen[1].defect
    assert not seen[2].defect


def test_observe_sees_nothing_in_blank_pictures_and_keeps_the_field():
    field = (np.array([[0, 0], [900, 0], [900, 700.0]]), np.array([[9, 9], [800, 9], [800, 600.0]]))
    for one in observe(acquisition(Frames(), field_of_view=field), frames=[0]):
        assert len(one.pixels_a) == len(one.pixels_b) == 0
        assert (one.field_of_view[1] == field[1]).all()


# Share of the axis that is covered; pixels farther than 2 px from the tube; px by which the
# edges are off in the mean; px by which the tip's end is off along the axis.
LIMITS = {
    "cannula": (0.98, 5, 0.5, 2.0),
    "guidewire": (0.98, 5, 0.5, 2.0),
    "cluttered": (0.98, 5, 0.5, 2.0),
}
FEW = [(study, plane, frame) for study in LIMITS for plane in "ab" for frame in (0, 5)]
REST = [
    (study, plane, frame)
    for study, count in (("cannula", 12), ("guidewire", 8), ("cluttered", 12))
    for plane in "ab"
    for frame in range(count)
    if frame not in (0, 5)
]


@pytest.fixture(scope="module")
def pictures(shared_data):
    """Frames of a plane of a study, read once."""
    pydicom = pytest.importorskip("pydicom")
    files = {}

    def read(study, plane):
        path = shared_data / "biplane_xa" / study / f"plane_{plane}.dcm"
        if path not in files:
            files[path] = pydicom.dcmread(path).pixel_array
        return files[path]

    return read


def true_tube(folder, plane, frame):
    """Axis in the picture, four points per px, base to tip, the radius there, px, and how far
    the flat end reaches beyond the axis' end, px, because it is seen obliquely.
    """
    truth = json.loads((folder / "truth.json").read_text())
    points = np.loadtxt(folder / f"truth_{frame:03d}.csv", delimiter=",", skiprows=1)
    projection = np.array(truth["planes"][plane][frame])
    x, y, depth = projection @ np.column_stack([points, np.ones(len(points))]).T
    axis = np.column_stack([x / depth, y / depth])
    along = np.append(0, np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1)))
    steps = np.arange(0, along[-1], 0.25)
    scale = np.linalg.norm(np.cross(projection[0, :3], projection[2, :3]))
    scale /= np.linalg.norm(projection[2, :3])
    pixel = np.linalg.norm(axis[-1] - axis[-2])  # of what the last step would be seen from aside
    share = pixel / (np.linalg.norm(points[-1] - points[-2]) * scale / depth[-1])
    columns = [axis[:, 0], axis[:, 1], truth["radius_mm"] * scale / depth]
    x, y, radius = (np.interp(steps, along, column) for column in columns)
    return np.column_stack([x, y]), radius, radius[-1] * np.sqrt(max(0, 1 - share**2))


@pytest.mark.parametrize(
    ("study", "plane", "frame"),
    [*FEW, *(pytest.param(*one, marks=pytest.mark.slow) for one in REST)],
)
def test_device_of_the_biplane_studies(shared_data, pictures, study, plane, frame):
    covered, stray, edge, tip = LIMITS[study]
    mask = segment_xray(pictures(study, plane)[frame])
    axis, radius, reach = true_tube(shared_data / "biplane_xa" / study, plane, frame)
    height, width = mask.shape
    inside = np.all((axis >= 0) & (axis <= [width - 1, height - 1]), axis=1)
    column, row = np.rint(axis[inside]).astype(int).T
    on_device = mask[row, column]
    assert on_device.mean() >= covered

    pixels = np.argwhere(mask)[:, ::-1]
    tree = cKDTree(axis)
    distance, nearest = tree.query(pixels)
    assert (distance > radius[nearest] + 2).sum() <= stray

    ahead = axis[-1] - axis[-5]
    beyond = (pixels - axis[-1]) @ ahead / np.linalg.norm(ahead)
    at_end = beyond[nearest == len(axis) - 1]
    short = 0.25 * np.argmax(on_device[::-1])
    assert short <= tip
    assert at_end.max(initial=0) - reach <= tip

    everywhere = np.argwhere(np.ones_like(mask))[:, ::-1]
    distance, nearest = tree.query(everywhere, distance_upper_bound=radius.max())
    truth = distance <= radius[np.minimum(nearest, len(axis) - 1)]
    truth &= (everywhere - axis[-1]) @ ahead * (nearest == len(axis) - 1) <= 0  # a flat end
    outline = 2 * 0.25 * inside.sum()
    assert abs(mask.sum() - truth.sum()) / outline <= edge


@pytest.mark.benchmark
def test_speed(shared_data):
    fluoroscopy = pytest.importorskip("stereosom_plugin.fluoroscopy")
    run = fluoroscopy.read_biplane(shared_data / "biplane_xa" / "cluttered")
    pairs, both = list(run), BiplaneSegmenter(run)
    for name, some in (("searched whole", pairs[:1]), ("followed", pairs[1:])):
        start = time.process_time()
        for pair in some:
            masks = both(pair)
        spent = 1e3 * (time.process_time() - start) / len(some)
        print(f"{name}: {spent:.0f} ms of one core per pair of 512² pictures")
    assert all(mask.any() for mask in masks)
