"""The geometry of a biplane run: matrices, planes, what is assumed, what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from stereosom_plugin.errors import InputError
from stereosom_plugin.fluoroscopy import read_biplane
from stereosom_plugin.fluoroscopy.geometry import positioner_camera


def c_arm(primary_deg, secondary_deg=0.0):
    """SID 1100 mm, SOD 750 mm, pixels of 1 mm."""
    primary, secondary = np.radians([primary_deg, secondary_deg])
    return positioner_camera(primary, secondary, 1100, 750, (1, 1), (201, 101))


def test_isocenter_projects_to_the_center_of_the_picture():
    for angles in ((0, 0), (30, -20), (-100, 15)):
        np.testing.assert_allclose(c_arm(*angles).project([[0, 0, 0]]), [[100, 50]], atol=1e-12)


def test_ten_millimeters_to_the_left_lie_right_in_the_frontal_picture():
    shift = c_arm(0).project([[10, 0, 0]])[0] - [100, 50]
    np.testing.assert_allclose(shift, [10 * 1100 / 750, 0], atol=1e-9)  # 14.67 mm


def test_toward_the_head_is_up_at_every_angle():
    for primary in (-90, -30, 0, 45, 90):
        shift = c_arm(primary).project([[0, 0, 10]])[0] - [100, 50]
        np.testing.assert_allclose(shift, [0, -10 * 1100 / 750], atol=1e-9)


def test_spine_lies_right_in_left_anterior_oblique_and_left_in_right_anterior_oblique():
    spine = [[0, 50, 0]]  # 50 mm behind the isocenter
    assert c_arm(30).project(spine)[0, 0] > 101
    assert c_arm(-30).project(spine)[0, 0] < 99


def test_source_stands_opposite_to_the_detector():
    # LAO 90: detector at the patient's left, source at the right; cranial: source at the feet
    np.testing.assert_allclose(c_arm(90).center, [-750, 0, 0], atol=1e-9)
    assert c_arm(0, 30).center[2] < 0


@pytest.mark.parametrize("case", ["cannula", "guidewire", "cluttered"])
def test_matrices_of_the_development_data(shared_data, case):
    folder = shared_data / "biplane_xa" / case
    truth = json.loads((folder / "truth.json").read_text())
    acquisition = read_biplane(folder)
    assert len(acquisition) == truth["frames"]
    grid = np.stack(np.meshgrid(*[[-80.0, 0, 80]] * 3), axis=-1).reshape(-1, 3)
    homogeneous = np.column_stack([grid, np.ones(len(grid))])
    for index in range(len(acquisition)):
        rig = acquisition.rig(index)
        for camera, plane in ((rig.a, "a"), (rig.b, "b")):
            pixels = homogeneous @ np.transpose(truth["planes"][plane][index])
            expected = pixels[:, :2] / pixels[:, 2:]
            np.testing.assert_allclose(camera.project(grid), expected, atol=1e-6)


def test_rectangular_pixels(write_pair):
    paths = write_pair(both={"ImagerPixelSpacing": ["0.5", "0.25"]})  # between rows, columns
    camera = read_biplane(*paths).rigs[0].b
    intrinsics = camera.projection[:, :3]
    lengths = np.linalg.norm(np.cross(intrinsics[:2], intrinsics[2]), axis=1)
    np.testing.assert_allclose(lengths, [1100 / 0.25, 1100 / 0.5])


def test_swapped_arguments_folder_and_pair_give_the_same(write_pair, tmp_path):
    a, b = write_pair()
    (tmp_path / "run" / "notes.txt").write_text("no DICOM")
    expected = read_biplane(a, b)
    assert expected.sources == (a, b)
    assert expected.rigs[0].frame == "isocenter_lps"
    for given in ((b, a), (tmp_path / "run",), (str(tmp_path),), ([str(a), b],)):
        acquisition = read_biplane(*given)
        assert acquisition.sources == expected.sources
        assert acquisition.source_uids == expected.source_uids
        assert acquisition.notes == ()
        np.testing.assert_array_equal(
            acquisition.rigs[0].a.projection, expected.rigs[0].a.projection
        )


def test_references_alone_keep_the_given_order_and_say_so(write_pair):
    a, b = write_pair(both={"ImageType": ["ORIGINAL", "PRIMARY"]})
    acquisition = read_biplane(b, a)
    assert acquisition.sources == (b, a)
    assert "taken as A" in acquisition.notes[0]


def test_image_type_alone_is_enough(write_pair):
    a, b = write_pair(both={"ReferencedImageSequence": None})
    assert read_biplane(b, a).sources == (a, b)


def test_folder_with_a_further_plane_still_holds_one_pair(write_pair, dicom_files):
    a, _ = write_pair()
    other, spare = dicom_files.write_pair(a.parent / "other")
    spare.unlink()
    dicom_files.rewrite(other, StudyInstanceUID="1.2.3.4")
    assert read_biplane(a.parent).sources[0] == a


def test_magnification_stands_in_for_the_source_to_isocenter_distance(write_pair):
    changes = {
        "DistanceSourceToPatient": None,
        "EstimatedRadiographicMagnificationFactor": "1.375",
    }
    acquisition = read_biplane(*write_pair(both=changes))
    np.testing.assert_allclose(np.linalg.norm(acquisition.rigs[0].a.center), 800)
    assert "800.0 mm follows" in acquisition.notes[0]


def test_moving_positioner_gives_a_rig_per_frame(write_pair):
    moving = {
        "PositionerMotion": "DYNAMIC",
        "PositionerPrimaryAngleIncrement": ["0", "5", "10"],
    }
    acquisition = read_biplane(*write_pair(a=moving))
    assert len(acquisition.rigs) == 3
    for index, angle in enumerate((-30, -25, -20)):
        axis = acquisition.rig(index).a.axis
        np.testing.assert_allclose(np.degrees(np.arctan2(axis[0], -axis[1])), angle)
        assert acquisition.rig(index).b.axis[0] == acquisition.rig(0).b.axis[0]
    assert any("that angle is taken not to move" in note for note in acquisition.notes)
    assert any("not checked against a real scanner" in note for note in acquisition.notes)


@pytest.mark.parametrize("position", ["HFP", "FFS", "FFP", None])
def test_positions_that_were_not_checked_are_noted(write_pair, position):
    acquisition = read_biplane(*write_pair(b={"PatientPosition": position}))
    assert len(acquisition.notes) == 1
    assert acquisition.notes[0].startswith("plane B: ")


@pytest.mark.parametrize(
    "changes",
    [
        {"TableMotion": "DYNAMIC"},
        {"TableAngle": "12"},
    ],
)
def test_moved_or_tilted_table_is_noted(write_pair, changes):
    assert "table" in read_biplane(*write_pair(a=changes)).notes[0]


@pytest.mark.parametrize(
    ("orientation", "fits"),
    [(["L", "F"], True), (["LP", "FA"], True), (["R", "F"], False), (["L", "H"], False)],
)
def test_a_flipped_picture_is_recognized_by_its_orientation(write_pair, orientation, fits):
    paths = write_pair(a={"PatientOrientation": orientation})
    if fits:
        read_biplane(*paths)
        return
    with pytest.raises(InputError, match="flipped or turned"):
        read_biplane(*paths)


@pytest.mark.parametrize("turn", [0, 90, 180, 270])
@pytest.mark.parametrize("flip", ["NO", "YES"])
def test_turned_and_flipped_pictures(write_pair, dicom_files, turn, flip):
    """A picture with one bright pixel is turned by numpy: the point must fall onto it still."""
    column, row = 21, 5
    straight = read_biplane(*write_pair("straight")).rigs[0].a
    # The point of the isocenter's plane that falls onto the middle of that pixel.
    direction = np.linalg.solve(straight.projection[:, :3], [column, row, 1])
    point = straight.center + direction * (750 / (straight.axis @ direction))
    np.testing.assert_allclose(straight.project([point])[0], [column, row], atol=1e-9)
    picture = np.zeros((24, 32), dtype=np.uint16)
    picture[row, column] = 4000
    picture = np.rot90(picture, -turn // 90)  # numpy turns the other way
    picture = np.fliplr(picture) if flip == "YES" else picture
    frames = np.repeat(np.ascontiguousarray(picture)[None], 3, axis=0)
    turned = {"FieldOfViewRotation": str(turn), "FieldOfViewHorizontalFlip": flip}
    acquisition = read_biplane(*write_pair("turned", a=turned, frames_a=frames))
    row, column = np.unravel_index(acquisition[0].image_a.argmax(), picture.shape)
    seen = acquisition.rigs[0].a.project([point])[0]
    np.testing.assert_allclose(seen, [column, row], atol=1e-9)
    assert any("against the detector" in note for note in acquisition.notes) == (
        (turn, flip) != (0, "NO")
    )


@pytest.mark.parametrize(
    ("changes", "distances", "note"),
    [
        ({"DistanceSourceToDetector": None}, (1050, 750), "1050.0 mm is assumed"),
        ({"DistanceSourceToPatient": None}, (1100, 750), "750.0 mm is assumed"),
        (
            {"DistanceSourceToDetector": "", "EstimatedRadiographicMagnificationFactor": "1.5"},
            (1125, 750),
            "1125.0 mm follows",
        ),
    ],
)
def test_distances_that_are_absent_are_filled_in_aloud(write_pair, changes, distances, note):
    acquisition = read_biplane(*write_pair(a=changes))
    camera = acquisition.rigs[0].a
    np.testing.assert_allclose(np.linalg.norm(camera.center), distances[1])
    np.testing.assert_allclose(camera.focal_length, distances[0] / 0.4)
    assert note in acquisition.notes[0]
    assert acquisition.notes[0].startswith("plane A: ")


@pytest.mark.parametrize(
    ("keyword", "value"), [("FieldOfViewDimensions", ["12", "16"]), ("IntensifierSize", "12")]
)
def test_the_field_of_view_stands_in_for_the_pixel_spacing(write_pair, keyword, value):
    acquisition = read_biplane(*write_pair(b={"ImagerPixelSpacing": None, keyword: value}))
    camera = acquisition.rigs[0].b
    assert keyword in acquisition.notes[0]
    rows = np.linalg.norm(np.cross(camera.projection[:2, :3], camera.projection[2, :3]), axis=1)
    np.testing.assert_allclose(rows[1], 1100 / 0.5)  # 12 mm over 24 rows
    np.testing.assert_allclose(rows[0], 1100 / (0.5 if keyword[0] == "F" else 0.375))


def test_increments_are_followed_whatever_the_motion_is_said_to_be(write_pair):
    still = {"PositionerMotion": "STATIC", "PositionerPrimaryAngleIncrement": ["0", "5", "10"]}
    acquisition = read_biplane(*write_pair(a=still))
    assert len(acquisition.rigs) == 3
    assert any("'STATIC', but angle increments" in note for note in acquisition.notes)


def test_a_beam_that_meets_the_detector_aslant_is_noted(write_pair):
    acquisition = read_biplane(*write_pair(a={"DetectorPrimaryAngle": "3"}))
    assert any("aslant" in note for note in acquisition.notes)


def test_no_shutter_no_field_of_view(write_pair):
    assert read_biplane(*write_pair()).field_of_view is None


def test_shutters_bound_the_field_of_view(write_pair):
    rectangle = {
        "ShutterShape": "RECTANGULAR",
        "ShutterLeftVerticalEdge": "5",
        "ShutterRightVerticalEdge": "29",
        "ShutterUpperHorizontalEdge": "-3",
        "ShutterLowerHorizontalEdge": "21",
    }
    acquisition = read_biplane(*write_pair(a=rectangle))
    view_a, view_b = acquisition.field_of_view
    np.testing.assert_allclose(view_a.min(axis=0), [4, -0.5])  # cut by the picture's border
    np.testing.assert_allclose(view_a.max(axis=0), [28, 20])
    np.testing.assert_allclose(view_b.max(axis=0), [31.5, 23.5])


def test_circular_and_polygonal_shutter(write_pair):
    circle = {
        "ShutterShape": "CIRCULAR",
        "CenterOfCircularShutter": ["13", "17"],  # row, column
        "RadiusOfCircularShutter": "8",
    }
    polygon = {
        "ShutterShape": "POLYGONAL",
        "VerticesOfThePolygonalShutter": ["1", "1", "1", "21", "21", "1"],  # row, column, ...
    }
    view_a, view_b = read_biplane(*write_pair(a=circle, b=polygon)).field_of_view
    assert len(view_a) == 64
    np.testing.assert_allclose(np.linalg.norm(view_a - [16, 12], axis=1), 8)
    np.testing.assert_allclose(sorted(view_b.tolist()), [[0, 0], [0, 20], [20, 0]])


def test_a_collimator_bounds_it_too_and_an_absent_edge_is_open(write_pair):
    edges = {
        "CollimatorShape": "RECTANGULAR",
        "CollimatorLeftVerticalEdge": "5",
        "CollimatorRightVerticalEdge": "29",
        "CollimatorUpperHorizontalEdge": "3",
    }
    view = read_biplane(*write_pair(a=edges)).field_of_view[0]
    np.testing.assert_allclose(view.min(axis=0), [4, 2])
    np.testing.assert_allclose(view.max(axis=0), [28, 23.5])


def test_a_shutter_outside_of_the_picture_shuts_nothing(write_pair):
    edges = dict.fromkeys(("ShutterLeftVerticalEdge", "ShutterUpperHorizontalEdge"), "-9")
    acquisition = read_biplane(*write_pair(a={"ShutterShape": "RECTANGULAR"} | edges))
    assert acquisition.field_of_view is None


def test_a_shutter_without_edges_is_noted(write_pair):
    acquisition = read_biplane(*write_pair(a={"ShutterShape": "RECTANGULAR"}))
    assert "the whole picture is searched" in acquisition.notes[0]


MISSING = ["PositionerPrimaryAngle", "PositionerSecondaryAngle", "ImagerPixelSpacing"]


@pytest.mark.parametrize("keyword", MISSING)
def test_each_missing_geometry_element_is_named(write_pair, keyword):
    with pytest.raises(InputError, match=f"plane_b.dcm: has no {keyword}") as raised:
        read_biplane(*write_pair(b={keyword: None}))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"DistanceSourceToDetector": "0"},
        {"DistanceSourceToDetector": "-1100"},
        {"DistanceSourceToPatient": "1100"},
        {"DistanceSourceToPatient": "0"},
        {"DistanceSourceToPatient": None, "EstimatedRadiographicMagnificationFactor": "0.5"},
        {"ImagerPixelSpacing": ["0.4", "0"]},
        {"ImagerPixelSpacing": ["0.4"]},
        {"PositionerPrimaryAngle": "181"},
        {"PositionerPrimaryAngle": ["10", "20"]},
        {"PositionerSecondaryAngle": "-91"},
        {"PositionerMotion": "DYNAMIC"},
        {"PositionerMotion": "DYNAMIC", "PositionerPrimaryAngleIncrement": ["0", "1"]},
        {"PositionerMotion": "DYNAMIC", "PositionerPrimaryAngleIncrement": ["0", "0", "400"]},
        {"FieldOfViewRotation": "45"},
        {"FieldOfViewHorizontalFlip": "PERHAPS"},
        {"DistanceSourceToDetector": "110", "DistanceSourceToPatient": "75"},
        {"ImagerPixelSpacing": ["0.4", "2"]},
        {"PatientPosition": "HFDL"},
        {"ShutterLeftVerticalEdge": "900", "ShutterRightVerticalEdge": "990"}
        | {"ShutterUpperHorizontalEdge": "1", "ShutterLowerHorizontalEdge": "20"},
    ],
)
def test_absurd_geometry_is_refused_in_one_line(write_pair, changes):
    with pytest.raises(InputError, match=r"plane_a\.dcm") as raised:
        read_biplane(*write_pair(a=changes))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("value", [b"one", b"nan ", b"1e999 "])
def test_words_in_place_of_numbers_are_refused(write_pair, value):
    a, b = write_pair(a={"DistanceSourceToDetector": "123456"})
    a.write_bytes(a.read_bytes().replace(b"123456", value.ljust(6)))
    with pytest.raises(InputError, match="DistanceSourceToDetector"):
        read_biplane(a, b)


def test_two_planes_in_one_place_are_refused(write_pair):
    with pytest.raises(InputError, match="same place"):
        read_biplane(*write_pair(both={"PositionerPrimaryAngle": "0"}))
