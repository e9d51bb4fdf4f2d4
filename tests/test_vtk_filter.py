"""`vtkStereoSOM` in a VTK pipeline: data, time, progress, and errors in VTK's own way."""

import json

import numpy as np
import pytest
import pyvista
from scipy.linalg import rq
from scipy.ndimage import distance_transform_edt
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import VTK_STRING, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline
from vtkmodules.vtkFiltersCore import vtkTubeFilter
from vtkmodules.vtkIOImage import vtkPNGReader

from stereosom.camera import Camera, StereoRig
from stereosom.synthetic import arc, converging_rig, silhouette
from stereosom_plugin.calibration import write_rig
from stereosom_plugin.centerline import vtk_messages
from stereosom_plugin.errors import InputError
from stereosom_plugin.vtk_filter import centerline, to_image, vtkStereoSOM

RADII = (60.0, 66.0, 72.0)  # mm, of quarter circles: one a time step
LENGTHS = [np.pi / 2 * radius for radius in RADII]
RIG = converging_rig(60)


@pytest.fixture(scope="module")
def masks():
    """Both views of each quarter circle."""
    return [
        [to_image(silhouette(arc(radius, 90), 1.0, camera)) for camera in (RIG.a, RIG.b)]
        for radius in RADII
    ]


@pytest.fixture
def filter_of(masks):
    """A filter on the first masks that records its errors, and its progress."""

    def make(*images, **properties):
        som = vtkStereoSOM()
        som.told, som.shown = [], []

        def hear(caller, event, text):
            som.told.append(text)

        hear.CallDataType = VTK_STRING
        som.AddObserver("ErrorEvent", hear)
        som.AddObserver("ProgressEvent", lambda *_: som.shown.append(som.GetProgress()))
        for port, image in enumerate(images or masks[0]):
            som.SetInputDataObject(port, image)
        for name, value in {"Rig": RIG, **properties}.items():
            getattr(som, f"Set{name}")(value)
        return som

    return make


class Film(VTKPythonAlgorithmBase):
    """A source of one view's pictures, at given seconds; remembers what it was asked for."""

    def __init__(self, images, times):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType="vtkImageData")
        self.images, self.times, self.asked = images, times, []

    def RequestInformation(self, request, inputs, outputs):
        information = outputs.GetInformationObject(0)
        if self.times:
            information.Set(Pipeline.TIME_STEPS(), self.times, len(self.times))
            information.Set(Pipeline.TIME_RANGE(), (self.times[0], self.times[-1]), 2)
        width, height, _ = self.images[0].GetDimensions()
        information.Set(Pipeline.WHOLE_EXTENT(), (0, width - 1, 0, height - 1, 0, 0), 6)
        return 1

    def RequestData(self, request, inputs, outputs):
        time = outputs.GetInformationObject(0).Get(Pipeline.UPDATE_TIME_STEP())
        self.asked.append(time)
        shown = self.times.index(time) if self.times else 0
        vtkImageData.GetData(outputs).ShallowCopy(self.images[shown])
        return 1


def length(polydata):
    return polydata.GetCellData().GetArray("Length").GetValue(0)


def pose(camera):
    """Rotation and translation of a camera, from its matrix."""
    upper, rotation = rq(camera.projection[:, :3])
    rotation = np.diag(np.sign(upper.diagonal())) @ rotation
    return rotation, -rotation @ camera.center


# ---- data ------------------------------------------------------------------------------


def test_quarter_circle_has_its_known_length_and_radius_of_curvature(filter_of):
    som = filter_of()
    som.Update()
    line = som.GetOutputDataObject(0)
    assert som.told == []
    assert length(line) == pytest.approx(LENGTHS[0], abs=1.0)
    curvature = vtk_to_numpy(line.GetPointData().GetArray("Curvature"))[40:160]
    assert 1 / np.median(curvature) == pytest.approx(60, rel=0.05)
    points = vtk_to_numpy(line.GetPoints().GetData())
    off = np.linalg.norm(points[:, None] - arc(60, 90).sample(2000), axis=2).min(axis=1)
    assert off.mean() < 0.1


def test_picture_files_stand_upright(mask_case, filter_of):
    """VTK's reader begins at the bottom row; our pixels begin at the top."""
    som = vtkStereoSOM()
    som.SetRigFile(mask_case / "rig.json")
    for port, name in enumerate("ab"):
        reader = vtkPNGReader()
        reader.SetFileName(str(mask_case / f"{name}.png"))
        som.SetInputConnection(port, reader.GetOutputPort())
    tube = vtkTubeFilter()
    tube.SetInputConnection(som.GetOutputPort())
    tube.SetRadius(1.0)
    tube.Update()
    assert tube.GetOutput().GetNumberOfPolys() + tube.GetOutput().GetNumberOfStrips() > 0
    in_memory = filter_of()
    in_memory.Update()
    for one, other in [(som, in_memory)]:
        points = [vtk_to_numpy(each.GetOutputDataObject(0).GetPoints().GetData())
                  for each in (one, other)]  # fmt: skip
        np.testing.assert_allclose(points[0], points[1], atol=1e-6)


def test_rows_from_the_top_are_taken_as_told(filter_of):
    som, turned = filter_of(), filter_of(TopDown=True)
    for port, camera in enumerate((RIG.a, RIG.b)):
        upright = silhouette(arc(60, 90), 1.0, camera)
        turned.SetInputDataObject(port, to_image(upright[::-1]))
    som.Update()
    turned.Update()
    points = [vtk_to_numpy(each.GetOutputDataObject(0).GetPoints().GetData())
              for each in (som, turned)]  # fmt: skip
    np.testing.assert_allclose(points[0], points[1], atol=1e-9)


def test_matrices_do_as_well_as_a_file(filter_of, tmp_path):
    write_rig([RIG], tmp_path / "rig.json")
    lengths = []
    for properties in (
        {"RigFile": tmp_path / "rig.json", "Rig": None},
        {"ProjectionA": RIG.a.projection, "ProjectionB": RIG.b.projection.ravel(), "Rig": None},
    ):
        som = filter_of(**properties)
        som.Update()
        assert som.told == []
        lengths.append(length(som.GetOutputDataObject(0)))
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-9)


def test_views_may_have_pictures_of_different_size(filter_of):
    """View b is cut 100 pixels narrower and lower than view a."""
    cut = Camera(RIG.b.projection, (924, 668))
    for rig, larger_first in ((StereoRig(RIG.a, cut), True), (StereoRig(cut, RIG.a), False)):
        images = [to_image(silhouette(arc(60, 90), 1.0, camera)) for camera in (rig.a, rig.b)]
        som = filter_of(*images, Rig=rig)
        with vtk_messages() as messages:
            som.Update()
        assert (som.told, messages) == ([], []), larger_first
        assert length(som.GetOutputDataObject(0)) == pytest.approx(LENGTHS[0], abs=1.0)


def test_lens_distortion_is_taken_from_the_pixels(filter_of, tmp_path):
    """Both views through a barrel lens; the straight reading of the same pixels misses."""
    focal, (width, height) = 1500.0, RIG.a.image_size
    ideal = np.array([[focal, 0, 511.5], [0, focal, 383.5], [0, 0, 1]])
    cameras, images, truth = [], [], arc(110, 90).sample(6000)
    for camera in (RIG.a, RIG.b):
        lens = {"intrinsics": ideal.tolist(), "distortion": [-1.8, 0.0, 0.0, 0.0]}
        rotation, translation = pose(camera)
        seen = truth @ rotation.T + translation
        x, y = seen[:, 0] / seen[:, 2], seen[:, 1] / seen[:, 2]
        factor = 1 - 1.8 * (x * x + y * y)  # OpenCV's k1
        pixels = np.column_stack([x * factor, y * factor]) * focal + ideal[:2, 2]
        half = focal / seen[:, 2].mean()  # 1 mm
        mask = np.ones((height, width), dtype=bool)
        mask[tuple(np.round(pixels[:, ::-1]).astype(int).T)] = False
        images.append(to_image(distance_transform_edt(mask) <= half))
        cameras.append({"image_size": [width, height], "rotation": rotation.tolist(),
                        "translation": translation.tolist(), **lens})  # fmt: skip
    off = []
    for bent in (True, False):
        if not bent:
            for camera in cameras:
                del camera["distortion"]
        described = {"units": "mm", "frame": "world", "cameras": cameras}
        (tmp_path / "rig.json").write_text(json.dumps(described))
        som = filter_of(*images, Rig=None, RigFile=tmp_path / "rig.json")
        som.Update()
        assert som.told == []
        points = vtk_to_numpy(som.GetOutputDataObject(0).GetPoints().GetData())
        off.append(np.linalg.norm(points[-1] - truth[-1]))
    assert off[0] < 0.5 < 2 < off[1], off


def test_gray_pictures_need_a_segmenter_and_colors_are_averaged(filter_of, masks):
    gray = filter_of(Segmenter=lambda image: image < 100)
    for port in (0, 1):
        dark = vtk_to_numpy(masks[0][port].GetPointData().GetScalars())
        picture = np.where(dark > 0, 40, 200).astype(np.uint8)
        color = np.column_stack([picture - 30, picture, picture + 30, np.full_like(picture, 255)])
        image = pyvista.ImageData(dimensions=masks[0][port].GetDimensions())
        image.point_data["color"] = color
        image.point_data.active_scalars_name = "color"
        gray.SetInputDataObject(port, image)
    gray.Update()
    assert gray.told == []
    assert length(gray.GetOutputDataObject(0)) == pytest.approx(LENGTHS[0], abs=1.0)


def test_three_lines_of_pyvista(mask_case):
    line = centerline(
        *(pyvista.read(mask_case / f"{name}.png") for name in "ab"),
        RigFile=mask_case / "rig.json",
        Samples=50,
    )
    assert isinstance(line, pyvista.PolyData)
    assert line.n_points == 50
    assert line.cell_data["Length"][0] == pytest.approx(LENGTHS[0], abs=1.0)
    assert line.field_data["SPACE"][0] == "LPS"


def test_what_is_known_beforehand_is_heard(filter_of):
    first = filter_of()
    first.Update()
    ends = vtk_to_numpy(first.GetOutputDataObject(0).GetPoints().GetData())[[0, -1]]
    other = filter_of(Base=ends[1], Radius=1.0, Spacing=5.0)
    other.Update()
    line = other.GetOutputDataObject(0)
    assert np.linalg.norm(line.GetPoint(0) - ends[1]) < 1.0
    assert line.GetPointData().GetArray("Radius").GetValue(0) == pytest.approx(1.0)
    assert line.GetNumberOfPoints() == 20 + (length(line) > 95)


# ---- time and progress -----------------------------------------------------------------


@pytest.fixture
def film(masks):
    """Both views' sources; view b is exposed 5 ms after view a."""
    times = [0.0, 0.1, 0.2]
    a = Film([pair[0] for pair in masks], times)
    b = Film([pair[1] for pair in masks], [time + 0.005 for time in times])
    som = vtkStereoSOM()
    som.SetRig(RIG)
    som.SetInputConnection(0, a.GetOutputPort())
    som.SetInputConnection(1, b.GetOutputPort())
    return som, a, b


def test_time_steps_are_those_of_view_a(film):
    som, _, _ = film
    som.UpdateInformation()
    information = som.GetOutputInformation(0)
    assert information.Get(Pipeline.TIME_STEPS()) == (0.0, 0.1, 0.2)
    assert information.Get(Pipeline.TIME_RANGE()) == (0.0, 0.2)


@pytest.mark.parametrize(
    ("wanted", "frame"), [(0.0, 0), (0.1, 1), (0.19, 1), (0.2, 2), (7.0, 2), (-1.0, 0)]
)
def test_a_request_takes_the_last_step_at_or_before_it_in_both_views(film, wanted, frame):
    som, a, b = film
    som.UpdateTimeStep(wanted)
    line = som.GetOutputDataObject(0)
    assert length(line) == pytest.approx(LENGTHS[frame], abs=1.0)
    assert (a.asked, b.asked) == ([a.times[frame]], [b.times[frame]])
    assert line.GetFieldData().GetArray("TimeValue").GetValue(0) == a.times[frame]
    assert line.GetFieldData().GetArray("Frame").GetValue(0) == frame
    assert line.GetInformation().Get(vtkPolyData.DATA_TIME_STEP()) == a.times[frame]


def test_a_frame_does_not_depend_on_those_seen_before(film):
    som, _, _ = film
    points = []
    for wanted in (0.1, 0.2, 0.1):
        som.UpdateTimeStep(wanted)
        points.append(np.array(vtk_to_numpy(som.GetOutputDataObject(0).GetPoints().GetData())))
    np.testing.assert_array_equal(points[0], points[2])
    assert np.abs(points[0] - points[1]).max() > 1


def test_a_moving_rig_goes_by_the_frame(film, tmp_path):
    """The second frame's rig stands 100 mm to the side: so does its curve."""
    aside = np.eye(4)
    aside[0, 3] = -100
    moved = type(RIG)(
        *(type(camera)(camera.projection @ aside, camera.image_size) for camera in (RIG.a, RIG.b))
    )
    write_rig([RIG, moved, RIG], tmp_path / "rig.json")
    som, _, _ = film
    som.UpdateTimeStep(0.1)
    x, y, z = som.GetOutputDataObject(0).GetCenter()
    som.SetRig(None)
    som.SetRigFile(tmp_path / "rig.json")
    som.UpdateTimeStep(0.1)
    np.testing.assert_allclose(som.GetOutputDataObject(0).GetCenter(), (x + 100, y, z), atol=1)


def test_progress_rises_to_one(filter_of):
    som = filter_of()
    som.Update()
    assert som.shown == sorted(som.shown)
    assert som.shown[-1] == 1.0
    assert len(set(som.shown)) >= 4


def test_nothing_runs_again_without_a_change(filter_of):
    som = filter_of()
    som.Update()
    som.shown.clear()
    som.Update()
    assert som.shown == []
    som.SetSamples(60)
    som.Update()
    assert som.GetOutputDataObject(0).GetNumberOfPoints() == 60


# ---- what is refused -------------------------------------------------------------------


def black():
    return to_image(np.zeros((768, 1024), dtype=bool))


def volume():
    image = vtkImageData()
    image.SetDimensions(1024, 768, 3)
    image.AllocateScalars(3, 1)
    return image


def bare():
    image = vtkImageData()
    image.SetDimensions(1024, 768, 1)
    return image


def with_nan():
    return to_image(np.full((768, 1024), np.nan))


WRONG = {
    "no rig": ({"Rig": None}, None, "the rig: is not given"),
    "rig file": ({"Rig": None, "RigFile": "no.json"}, None, "no.json: no such file"),
    "matrix": ({"Rig": None, "ProjectionA": [1, 2], "ProjectionB": [1] * 12}, None, "has 2 numb"),
    "text": ({"Rig": None, "ProjectionA": ["x"] * 12, "ProjectionB": [1] * 12}, None, "could not"),
    "nan": ({"Rig": None, "ProjectionA": [np.nan] * 12, "ProjectionB": [1] * 12}, None, "finite"),
    "method": ({"Method": "guess"}, None, "there is no 'guess'"),
    "segmenter": ({"Segmenter": "guess"}, None, "there is no 'guess'"),
    "samples": ({"Samples": 1}, None, "samples: 1 must lie"),
    "radius": ({"Radius": -1.0}, None, "radius: must be a positive"),
    "failing segmenter": ({"Segmenter": lambda image: 1 / 0}, None, "ZeroDivisionError"),
    "black": ({}, black, "frame 0, 0 s: failed"),
    "volume": ({}, volume, "view a: is a volume of 3 slices"),
    "no scalars": ({}, bare, "view a: has no point scalars"),
    "empty": ({}, vtkImageData, "view a: holds no picture"),
    "pixels": ({}, with_nan, "values that are not finite"),
    "size": ({}, lambda: to_image(np.eye(64, dtype=bool)), "mask a: is 64×64 pixels"),
}


@pytest.mark.parametrize(("properties", "image", "why"), WRONG.values(), ids=WRONG)
def test_wrong_input_is_one_error_event_and_nothing_runs_downstream(
    filter_of, masks, capfd, properties, image, why
):
    som = filter_of(image() if image else masks[0][0], masks[0][1], **properties)
    tube = vtkTubeFilter()
    tube.SetInputConnection(som.GetOutputPort())
    with vtk_messages() as elsewhere:
        tube.Update()
    (error,) = som.told
    assert why in error
    assert error.startswith("vtkStereoSOM: ")
    assert "\n" not in error
    assert som.GetErrorCode() == 40000
    assert som.GetOutputDataObject(0).GetNumberOfPoints() == 0
    assert tube.GetOutput().GetNumberOfPoints() == 0
    assert elsewhere == []
    assert capfd.readouterr() == ("", "")  # no traceback, no dump


def test_unobserved_error_is_one_line_on_the_output_window(masks):
    window, previous = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    try:
        som = vtkStereoSOM()
        for port in (0, 1):
            som.SetInputDataObject(port, masks[0][port])
        som.Update()
    finally:
        vtkOutputWindow.SetInstance(previous)
    (line,) = window.GetOutput().strip().splitlines()
    assert line.startswith("ERROR: vtkStereoSOM: the rig: is not given")


def test_a_mended_filter_works_again(filter_of):
    som = filter_of(Method="guess")
    som.Update()
    som.SetMethod("joint-spline")
    som.Update()
    assert len(som.told) == 1
    assert som.GetErrorCode() == 0
    assert som.GetOutputDataObject(0).GetNumberOfPoints() == 200


def test_views_whose_frames_do_not_pair_are_refused(film, masks):
    som, _, _ = film
    errors = []
    som.AddObserver("ErrorEvent", lambda *_: errors.append(som.GetReason()))
    shorter = Film([pair[1] for pair in masks[:2]], [0.0, 0.1])  # VTK keeps no Python source alive
    som.SetInputConnection(1, shorter.GetOutputPort())
    with vtk_messages():
        som.UpdateTimeStep(0.1)
    assert "have 3 and 2 time steps" in errors[0]


def test_pyvista_users_get_a_python_error(masks):
    with pytest.raises(InputError, match=r"the rig: is not given.*; set RigFile"):
        centerline(*masks[0])
    with pytest.raises(InputError, match="no property"):
        centerline(*masks[0], Rigg=RIG)


def test_a_series_that_names_no_times_is_one_picture(masks):
    som, sources = vtkStereoSOM(), [Film([image], []) for image in masks[0]]
    som.SetRig(RIG)
    for port, source in enumerate(sources):
        som.SetInputConnection(port, source.GetOutputPort())
    som.Update()
    assert length(som.GetOutputDataObject(0)) == pytest.approx(LENGTHS[0], abs=1.0)
