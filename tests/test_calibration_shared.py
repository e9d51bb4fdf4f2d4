"""Real rigs: a biplane X-ray laboratory's image intensifiers, two cameras and their dots."""

import json

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import KDTree

import stereosom
from stereosom import StereoRig
from stereosom.camera import triangulate
from stereosom_plugin import segmentation
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.calibration import read_calibration


@pytest.fixture(scope="module")
def laboratory(shared_data):
    return shared_data / "guide3d_biplane"


@pytest.fixture(scope="module")
def project(laboratory):
    session = laboratory / "calibration" / "2024-01-18"
    return read_calibration(session / "xma_unzipped", units="cm")


def cube(laboratory, camera, number):
    """Beads that were found on the cube's picture: pixels, and mm in space."""
    session = laboratory / "calibration" / "2024-01-18"
    data = session / "xma_unzipped" / camera / "data"
    seen = np.loadtxt(data / f"Calibration_{number}_PointsDetected.csv", delimiter=",")
    kept = np.loadtxt(data / f"Calibration_{number}_PointsInlier.csv") > 0
    beads = np.loadtxt(session / "framespec_cm.csv", delimiter=",", skiprows=1, usecols=(0, 1, 2))
    return seen[kept], 10 * beads[kept]


@pytest.mark.parametrize(("view", "camera", "number"), [(0, "Camera 1", 16709),
                                                        (1, "Camera 2", 16710)])  # fmt: skip
def test_the_cube_reprojects_below_a_pixel_once_undistorted(
    laboratory, project, view, camera, number
):
    seen, beads = cube(laboratory, camera, number)
    shown = (project.rigs[0].a, project.rigs[0].b)[view].project(beads)
    raw = np.linalg.norm(seen - shown, axis=1)
    straight = np.linalg.norm(project.lenses[view].undistort(seen) - shown, axis=1)
    assert np.sqrt(np.mean(straight**2)) < 1
    assert np.median(straight) < 0.8
    assert 10 < np.median(raw) < 12


def test_both_planes_agree_on_where_the_beads_are(laboratory, project):
    """Beads that both planes show, triangulated: within 0.3 mm of the cube, 130 mm wide."""
    found = [
        {tuple(bead): pixel for pixel, bead in zip(*cube(laboratory, *which), strict=True)}
        for which in (("Camera 1", 16709), ("Camera 2", 16710))
    ]
    common = sorted(set(found[0]) & set(found[1]))
    pixels = [
        lens.undistort(np.array([seen[bead] for bead in common]))
        for lens, seen in zip(project.lenses, found, strict=True)
    ]
    off = np.linalg.norm(triangulate(project.rigs[0], *pixels) - np.array(common), axis=1)
    assert len(common) >= 10
    assert np.median(off) < 0.3


def frames(laboratory):
    """Hand-drawn wires, tip first, raw pixels: camera 1 is 16710, the project's second."""
    described = json.loads((laboratory / "annotations.json").read_text())
    return [
        tuple(np.array(frame[name]["points"], dtype=float) for name in ("camera1", "camera2"))
        for frame in described["frames"]
    ]


@pytest.fixture(scope="module")
def exchanged(project):
    rig = project.rigs[0]
    return StereoRig(rig.b, rig.a), project.lenses[::-1]


def test_wire_tips_lie_on_their_epipolar_lines_once_undistorted(laboratory, exchanged):
    rig, lenses = exchanged

    def off(tip_a, tip_b):
        line = rig.fundamental @ np.append(tip_a, 1)
        return abs(line @ np.append(tip_b, 1)) / np.hypot(*line[:2])

    tips = [(a[:1], b[:1]) for a, b in frames(laboratory)]
    raw = [off(a[0], b[0]) for a, b in tips]
    straight = [off(lenses[0].undistort(a)[0], lenses[1].undistort(b)[0]) for a, b in tips]
    assert np.median(straight) < 2
    assert max(straight) < 2.5
    assert min(raw) > 8.5


def dense(line, count):
    """Points at equal steps along a polyline; hands double some of its points."""
    steps = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    kept = np.append(True, np.diff(steps) > 0)
    at = np.linspace(0, steps[-1], count)
    return np.column_stack([np.interp(at, steps[kept], line[kept, axis]) for axis in (0, 1)])


def drawn(line):
    """The wire as a mask, five pixels wide."""
    mask = np.zeros((1024, 1024), dtype=bool)
    column, row = np.clip(np.rint(dense(line, 6000)).astype(int), 0, 1023).T
    mask[row, column] = True
    return ndimage.distance_transform_edt(~mask) <= 2.5


def test_3d_curves_of_the_wires_reproject_below_a_pixel(laboratory, exchanged):
    """Where a plane shows more of the wire than the other, the rest has no 3D curve."""
    (rig, lenses), wires = exchanged, frames(laboratory)
    acquisition = Acquisition(
        lambda index: tuple(drawn(line) for line in wires[index]),
        (rig,),
        np.arange(len(wires), dtype=float),
        lenses=lenses,
    )
    off = ([], [])
    for seen, wire in zip(segmentation.observe(acquisition, lambda m: m), wires, strict=True):
        result = stereosom.reconstruct(seen)
        assert result.ok, result.reason
        curve = result.backbone.sample(3000)
        for view, camera in enumerate((rig.a, rig.b)):
            line = lenses[view].undistort(dense(wire[view], 400))
            off[view].append(np.median(KDTree(camera.project(curve)).query(line)[0]))
    assert max(off[0]) < 1
    assert max(off[1]) < 1


def test_a_rig_of_two_cameras_from_their_fundamental_matrix(shared_data):
    """Dots of 18.2 mm pitch on two cameras' pictures of a concentric-tube robot."""
    path = shared_data / "concentric_tube_robot_stereo" / "calibration.json"
    found = read_calibration(path, image_size=(1280, 720), pitch=18.2)
    described = json.loads(path.read_text())
    assert found.lenses is None  # the matrix is that of the pixels as seen
    pixels = [np.array(described[name]) for name in ("dots_left", "dots_right")]
    dots = triangulate(found.rigs[0], *pixels)
    nearest = np.asarray(KDTree(dots).query(dots, k=2)[0])[:, 1]
    assert np.median(nearest) == pytest.approx(18.2)
    assert np.std(nearest) < 0.1
    # The board is flat: not used in the fit, so it tells.
    flat = np.linalg.svd(dots - dots.mean(axis=0))[1][2] / np.sqrt(len(dots))
    assert flat < 0.3


def test_mayacam_of_other_laboratories(shared_data):
    folder = shared_data / "xray_backgrounds" / "Calibration"
    for joint in ("wrist", "left_knee", "right_ankle"):
        found = read_calibration([folder / f"xr_calib_{joint}_cam0{n}.txt" for n in (1, 2)])
        assert found.source == "MayaCam 2.0"
        assert 1000 < found.rigs[0].baseline < 2500
        assert not found.notes
