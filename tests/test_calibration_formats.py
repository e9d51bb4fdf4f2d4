"""Every calibration format, against one point whose pixels were worked out by hand.

The files, and the arithmetic, are in `calibration_files.py`.
"""

import json

import numpy as np
import pytest
from scipy import io

from stereosom_plugin.calibration import read_calibration, write_rig
from stereosom_plugin.calibration.plausibility import measure
from stereosom_plugin.errors import InputError


@pytest.fixture
def read(tmp_path):
    """Write texts (or a dict as MATLAB variables) to files, and read them as a calibration."""

    def write_and_read(*contents, **said):
        paths = []
        for number, content in enumerate(contents):
            paths.append(tmp_path / f"calibration_{number}")
            if isinstance(content, dict):
                io.savemat(paths[-1], content, appendmat=False)
            else:
                paths[-1].write_text(content, encoding="utf-8")
        return read_calibration(paths, **said)

    return write_and_read


@pytest.fixture
def check(calibration_files):
    """The point of `calibration_files.py` is seen where it was worked out to be."""

    def sees(found, bent=True):
        rig = found.rigs[0]
        seen_a = rig.a.project(calibration_files.POINT)
        assert seen_a[0] == pytest.approx(calibration_files.SEEN_A, abs=1e-6)
        seen_b = rig.b.project(calibration_files.POINT)[0]
        assert seen_b == pytest.approx(calibration_files.SEEN_B, abs=1e-3)
        assert rig.a.image_size == rig.b.image_size == (640, 480)
        if bent:
            assert found.lenses[0].distort(seen_a)[0] == pytest.approx(
                calibration_files.BENT_A, abs=1e-6
            )
        else:
            assert found.lenses is None

    return sees


SCHEMES = [
    "M1 D1 M2 D2 R T",
    "K1 D1 K2 D2 R T",
    "cameraMatrix1 distCoeffs1 cameraMatrix2 distCoeffs2 R T",
    "camera_matrix_1 distortion_coefficients_1 camera_matrix_2 distortion_coefficients_2 R T",
    "left_camera_matrix left_distortion right_camera_matrix right_distortion R T",
    "cameraMatrixL distCoeffsL cameraMatrixR distCoeffsR rotation translation",
]


@pytest.mark.parametrize("names", SCHEMES)
@pytest.mark.parametrize("header", ["%YAML:1.0\n---\n", "%YAML 1.2\n---\n", "%YAML:1.0\n"])
def test_opencv_yaml(read, check, calibration_files, names, header):
    found = read(calibration_files.opencv_yaml(names, header))
    check(found)
    assert found.source == "OpenCV FileStorage, YAML"
    assert found.rigs[0].baseline == pytest.approx(np.sqrt(26))


def test_opencv_writes_what_is_read(read, check, calibration_files, tmp_path):
    """The real writer, in all three syntaxes."""
    cv2 = pytest.importorskip("cv2")
    files = calibration_files
    values = (files.K_A, [files.D_A], files.K_B, [files.D_B], files.R, [[t] for t in files.T])
    for suffix in ("yml", "xml", "json"):
        path = tmp_path / f"stereo.{suffix}"
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
        storage.write("imageSize", np.array([640.0, 480.0]))
        for name, value in zip(SCHEMES[0].split(), values, strict=True):
            storage.write(name, np.array(value, dtype=float))
        storage.release()
        check(read_calibration(path))


@pytest.mark.parametrize("names", SCHEMES[:3])
def test_opencv_xml(read, check, calibration_files, names):
    found = read(calibration_files.opencv_xml(names))
    check(found)
    assert found.source == "OpenCV FileStorage, XML"


def test_opencv_json(read, check, calibration_files):
    check(read(calibration_files.opencv_json()))


def test_opencv_sample_programs_write_intrinsics_and_extrinsics_apart(read, calibration_files):
    both = calibration_files.opencv_yaml(size="two")
    cut = both.index("R: !!opencv-matrix")
    assert read(both[:cut], "%YAML:1.0\n---\n" + both[cut:]).rigs[0].baseline == pytest.approx(
        np.sqrt(26)
    )


def test_the_size_may_come_from_the_caller_but_not_contradict(read, check, calibration_files):
    silent = calibration_files.opencv_yaml(size="none")
    check(read(silent, image_size=(640, 480)))
    with pytest.raises(InputError, match="says no picture size; give it with --image-size"):
        read(silent)
    with pytest.raises(InputError, match="is for pictures of 640×480 px, not of 1280×720"):
        read(calibration_files.opencv_yaml(), image_size=(1280, 720))


def test_scared_frame_data(read, check, calibration_files):
    found = read(calibration_files.scared_frame_data(), image_size=(640, 480))
    check(found)
    assert found.source == "SCARED frame_data"


RECTIFIED = (
    "%YAML:1.0\n---\nimageSize: [ 640, 480 ]\n"
    "P1: !!opencv-matrix\n   rows: 3\n   cols: 4\n   dt: d\n"
    "   data: [ 800., 0., 300., 0., 0., 800., 200., 0., 0., 0., 1., 0. ]\n"
    "P2: !!opencv-matrix\n   rows: 3\n   cols: 4\n   dt: d\n"
    "   data: [ 800., 0., 300., -4000., 0., 800., 200., 0., 0., 0., 1., 0. ]\n"
)


def test_a_rectified_pair(read, calibration_files):
    # P2's last column is −f B = −4000: B = 5 mm. At 100 mm, the disparity is 800 · 5/100 = 40 px.
    found = read(RECTIFIED)
    rig = found.rigs[0]
    assert rig.baseline == pytest.approx(5)
    assert rig.b.project([[0, 0, 100]])[0] == pytest.approx([260, 200])
    assert found.lenses is None
    both = calibration_files.opencv_yaml() + RECTIFIED.split("480 ]\n")[1]
    assert read(both).rigs[0].baseline == pytest.approx(np.sqrt(26))
    assert read(both, rectified=True).rigs[0].baseline == pytest.approx(5)


def test_stereomis(read, check, calibration_files):
    found = read(calibration_files.stereomis_ini())
    check(found)
    assert found.source == "StereoMIS INI"


def ros_pair(files, model="plumb_bob"):
    rectified = [[900.0, 0, 330, 0], [0, 900, 245, 0], [0, 0, 1, 0]]
    moved = [[900.0, 0, 330, -4.5], [0, 900, 245, 0], [0, 0, 1, 0]]  # −f B: B = 5 mm = 0.005 m
    d = [0.02, -0.01, 0.003, 0.0] if model == "equidistant" else files.D_A
    return (
        files.ros(files.K_A, d, files.R, rectified, model),
        files.ros(files.K_B, d, np.eye(3), moved, model),
    )


def test_ros_camera_info(read, calibration_files):
    # In the axes of the rectified left camera. The left one's raw axes: Rᵀ X = (37.6, 20, 93.2),
    # so 320 + 1000·37.6/93.2 = 723.4335; the right one's: X − (5, 0, 0): 310 + 900·5/100 = 355.
    found = read(*ros_pair(calibration_files))
    rig = found.rigs[0]
    assert rig.a.project([[10, 20, 100]])[0] == pytest.approx([723.4335, 454.5923], abs=1e-4)
    assert rig.b.project([[10, 20, 100]])[0] == pytest.approx([355, 430])
    assert rig.baseline == pytest.approx(5)
    assert "metres" in found.notes[0]
    flat = read(*ros_pair(calibration_files), rectified=True)
    assert flat.rigs[0].a.project([[10, 20, 100]])[0] == pytest.approx([420, 425])
    assert flat.rigs[0].b.project([[10, 20, 100]])[0] == pytest.approx([375, 425])
    assert flat.lenses is None


def test_ros_messages_as_they_are_printed(read, calibration_files):
    def printed(k, d, turn, projection):
        lists = {"k": k, "d": d, "r": turn, "p": projection}
        lines = [f"{name}:\n" + "".join(f"- {value}\n" for value in np.ravel(values))
                 for name, values in lists.items()]  # fmt: skip
        return "header:\n  frame_id: left\nheight: 480\nwidth: 640\n" + "".join(lines)

    files, eye = calibration_files, np.eye(3)
    rectified = np.column_stack([files.K_A, [0, 0, 0]])
    moved = np.column_stack([files.K_B, [-4.5, 0, 0]])
    found = read(printed(files.K_A, files.D_A, eye, rectified),
                 printed(files.K_B, files.D_B, eye, moved + 0.0))  # fmt: skip
    assert found.rigs[0].baseline == pytest.approx(5)
    assert found.rigs[0].a.image_size == (640, 480)


def test_ros_equidistant_is_a_fisheye(read, calibration_files):
    found = read(*ros_pair(calibration_files, "equidistant"))
    assert str(found.lenses[0]) == "fisheye lens"


def test_bouguets_toolbox(read, check, calibration_files):
    found = read(calibration_files.bouguet())
    check(found)
    assert found.source == "Calib_Results_stereo.mat"
    only_vector = calibration_files.bouguet()
    del only_vector["R"]
    check(read(only_vector))


@pytest.mark.parametrize("newer", [False, True])
def test_matlab_stereo_parameters(read, check, calibration_files, newer):
    described = calibration_files.matlab_struct(newer)
    found = read(json.dumps(described))
    check(found)
    assert found.source == "MATLAB stereoParameters"
    check(read({"s": described}))


def test_matlab_matrices_for_opencv(read, check, calibration_files):
    files = calibration_files
    check(
        read({"intrinsicMatrix1": files.K_A, "distortionCoefficients1": files.D_A,
              "intrinsicMatrix2": files.K_B, "distortionCoefficients2": files.D_B,
              "rotationOfCamera2": files.R, "translationOfCamera2": files.T,
              "imageSize": [480.0, 640.0]})
    )  # fmt: skip


def test_mayacam_in_centimetres_with_its_quirks(read, check, calibration_files):
    files = calibration_files
    a = files.mayacam(files.K_A, np.eye(3), [0, 0, 0], drops_zero=True)
    b = files.mayacam(files.K_B, files.R, np.array(files.T) / 10, size="480,640")
    found = read(a, b, units="cm")
    check(found, bent=False)
    assert "480, 640 is read as rows, columns" in found.notes[0]
    check(read(a.replace("\n", "\r\n"), b, units="cm"), bent=False)


def test_mayacam_undistortion_is_in_opencvs_order(read, check, calibration_files):
    files = calibration_files
    bends = "\nundistortion\n" + "\n".join(map(str, [*files.D_A, 0, 0, 0])) + "\n"
    a = files.mayacam(files.K_A, np.eye(3), [0, 0, 0]) + bends
    check(read(a, files.mayacam(files.K_B, files.R, files.T)))


def test_x_ray_in_the_wrong_unit_is_noted(read, calibration_files):
    files = calibration_files
    a = files.mayacam(files.K_A, np.eye(3), [0, 0, 100])
    b = files.mayacam(files.K_B, [[0, 0, -1], [0, 1, 0], [1, 0, 0]], [0, 0, 100])
    assert any("--units cm" in note for note in read(a, b).notes)
    assert not any("--units" in note for note in read(a, b, units="cm").notes)


def test_metres_read_as_millimetres_are_noted(read, calibration_files):
    small = calibration_files.opencv_yaml().replace("-5.0, 0.0, 1.0", "-0.005, 0.0, 0.001")
    assert any("implausible" in note for note in read(small).notes)
    assert not any("implausible" in note for note in read(small, units="m").notes)


def test_exchanged_eyes_are_noted(read):
    exchanged = RECTIFIED.replace("-4000.", "4000.")
    assert any("left of view a" in note for note in read(exchanged).notes)
    assert not any("left of view a" in note for note in read(RECTIFIED).notes)


def test_rtk(read, calibration_files):
    # X = (10, 20, 0): first u = −1536·10/−1000 = 15.36 mm, v = 30.72 mm. The second looks along
    # x: depth 10 − 1000, u = 0, v = −1536·20/−990 = 31.0303 mm. Pixels of 0.4 mm, 512×384.
    found = read(calibration_files.RTK, image_size=(512, 384), pixel_spacing=0.4)
    rig = found.rigs[0]
    assert rig.a.project([[10, 20, 0]])[0] == pytest.approx([255.5 + 38.4, 191.5 + 76.8])
    assert rig.b.project([[10, 20, 0]])[0] == pytest.approx([255.5, 191.5 + 77.5758], abs=1e-4)
    assert rig.baseline == pytest.approx(1000 * np.sqrt(2))
    assert min(rig.a.depth([[0, 0, 0]]), rig.b.depth([[0, 0, 0]])) == pytest.approx(1000)


def test_rtk_per_frame_from_a_file_per_plane(read, calibration_files):
    head, first, second = calibration_files.RTK.split("<Projection>")
    tail = "</RTKThreeDCircularGeometry>\n"
    turned = "<Projection>".join([head, second.replace(tail, ""), first]) + tail
    found = read(calibration_files.RTK, turned, image_size=(512, 512), pixel_spacing=0.4)
    assert len(found.rigs) == 2
    assert found.rigs[1].a.project([[10, 20, 0]])[0] == pytest.approx([255.5, 333.0758], abs=1e-4)


def test_two_views_scaled_by_dots(read, calibration_files):
    described = calibration_files.two_view()
    found = read(json.dumps(described), image_size=(640, 480), pitch=1.82)
    rig = found.rigs[0]
    assert rig.baseline == pytest.approx(np.sqrt(26), rel=1e-4)
    seen = rig.b.project(calibration_files.POINT)[0]
    assert seen == pytest.approx(calibration_files.SEEN_B, abs=0.01)
    doubled = read(json.dumps(described), image_size=(640, 480), pitch=3.64)
    assert doubled.rigs[0].baseline == pytest.approx(2 * np.sqrt(26), rel=1e-4)


def test_a_rig_json_keeps_lenses(read, check, calibration_files, tmp_path):
    found = read(calibration_files.opencv_yaml())
    write_rig(found.rigs, tmp_path / "rig.json", found.lenses)
    again = read_calibration(tmp_path / "rig.json")
    check(again)
    assert again.rigs[0].frame == "camera_a"


def test_a_hand_written_rig_json_may_name_a_distortion(read, check, calibration_files):
    files = calibration_files
    size = {"image_size": [640, 480]}
    a = {"intrinsics": files.K_A, "rotation": np.eye(3).tolist(), "translation": [0, 0, 0]}
    b = {"intrinsics": files.K_B, "rotation": files.R, "translation": files.T}
    cameras = [a | size | {"distortion": files.D_A}, b | size | {"distortion": files.D_B}]
    check(read(json.dumps({"units": "mm", "frame": "camera_a", "cameras": cameras})))


def test_what_a_rig_measures_in_millimetres(read, calibration_files):
    # Axes 2·asin(0.28)… the turn's angle: 16.26°. A pixel at 50 mm before f = 1000 px: 0.05 mm.
    found = measure(read(calibration_files.opencv_yaml()).rigs[0])
    assert found.convergence_deg == pytest.approx(np.degrees(np.arcsin(0.28)))
    flat = measure(read(RECTIFIED).rigs[0])
    assert flat.mm_per_pixel == pytest.approx((50 / 800, 50 / 800))
    assert flat.center_named == "10 baselines away"
