"""`vtkStereoSOM`: two pictures in, the centerline out, as a filter in a VTK pipeline.

Three lines in a notebook:

    import pyvista
    from stereosom_plugin import vtk_filter
    vtk_filter.centerline(pyvista.read("a.png"), pyvista.read("b.png"), RigFile="rig.json").plot()
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from stereosom.camera import StereoRig
from stereosom.observation import Observation
from stereosom.options import Options, Prior
from stereosom.reconstruct import DEFAULT_METHOD, reconstruct

from .acquisition import Acquisition
from .calibration import Calibration, read_calibration
from .errors import InputError, require
from .polydata import to_polydata
from .segmentation import Segment, binary, observe, segment_xray
from .vtk_images import picture_of, to_image

vtk_core = require("vtkmodules.vtkCommonCore", "vtk")
vtk_data = require("vtkmodules.vtkCommonDataModel", "vtk")
vtk_execution = require("vtkmodules.vtkCommonExecutionModel", "vtk")
_Base: Any = require("vtkmodules.util.vtkAlgorithm", "vtk").VTKPythonAlgorithmBase

__all__ = ["SEGMENTERS", "centerline", "to_image", "vtkStereoSOM"]

SEGMENTERS: dict[str, Segment] = {"mask": binary, "xray": segment_xray}
_USER_ERROR = 40000  # vtkErrorCode::UserError
_Vector = Any  # three or twelve numbers, or None; checked where they are used
_pipeline = vtk_execution.vtkStreamingDemandDrivenPipeline


class vtkStereoSOM(_Base):  # type: ignore[misc]
    """Reconstruct the backbone of a thin flexible device from two pictures.

    Port 0 takes view a, port 1 view b: `vtkImageData` of one slice, masks or, with a segmenter,
    gray pictures. The output is one polyline, by the contract of `polydata.to_polydata`.

    Where the inputs have time steps, the output has those of view a; a request for a time
    takes the last step at or before it, the same one in both views, and the rig of that step.

    What goes wrong is told in VTK's way: one line with an `ErrorEvent` (on the output window
    where nobody observes it), an error code, an empty output, and what stands downstream is
    not run. No Python exception passes through VTK.

    Examples
    --------
    >>> from stereosom.synthetic import arc, converging_rig, silhouette
    >>> rig = converging_rig(60)
    >>> som = vtkStereoSOM()
    >>> som.SetRig(rig)
    >>> for port, camera in enumerate((rig.a, rig.b)):
    ...     som.SetInputDataObject(port, to_image(silhouette(arc(60), 1.0, camera)))
    >>> _ = som.Update()
    >>> line = som.GetOutputDataObject(0)
    >>> line.GetNumberOfPoints(), round(line.GetCellData().GetArray("Length").GetValue(0))
    (200, 95)
    """

    def __init__(self) -> None:
        _Base.__init__(
            self,
            nInputPorts=2,
            inputType="vtkImageData",
            nOutputPorts=1,
            outputType="vtkPolyData",
        )
        self._rig_file = ""
        self._rig: StereoRig | None = None
        self._projections: list[_Vector] = [None, None]
        self._segmenter: str | Segment = "mask"
        self._method = DEFAULT_METHOD
        self._samples, self._spacing = 200, 0.0
        self._radius, self._length = 0.0, 0.0
        self._base: _Vector = None
        self._direction: _Vector = None
        self._top_down = False
        self._reason, self._error_code = "", 0

    # ---- properties: checked when the filter runs, so that no setter raises ----------

    def SetRigFile(self, path: str | None) -> None:
        """Take the geometry of both views from a `rig.json` or another calibration file."""
        self._set("_rig_file", str(path or ""))

    def SetRig(self, rig: StereoRig | None) -> None:
        """Take the geometry from Python; goes before a file."""
        self._set("_rig", rig)

    def SetProjectionA(self, *rows: Any) -> None:
        """Give view a's 3×4 projection, world mm to pixels, as 12 numbers by rows."""
        self._set("_projections", [_numbers(rows), self._projections[1]])

    def SetProjectionB(self, *rows: Any) -> None:
        """Give view b's 3×4 projection, world mm to pixels, as 12 numbers by rows."""
        self._set("_projections", [self._projections[0], _numbers(rows)])

    def SetSegmenter(self, segmenter: str | Segment) -> None:
        """`mask` (above half of the range), `xray` (dark tubes), or image → boolean mask."""
        self._set("_segmenter", segmenter)

    def SetMethod(self, name: str) -> None:
        """Choose the method by its name in `stereosom.METHODS`."""
        self._set("_method", name)

    def SetSamples(self, count: int) -> None:
        """Set the number of points of the output (default 200)."""
        self._set("_samples", count)

    def SetSpacing(self, step: float) -> None:
        """Set the longest step between points, mm; 0: use the number of points."""
        self._set("_spacing", step)

    def SetRadius(self, radius: float) -> None:
        """Radius of the device, mm; 0: unknown."""
        self._set("_radius", radius)

    def SetLength(self, length: float) -> None:
        """Deployed arc length, mm; 0: unknown."""
        self._set("_length", length)

    def SetBase(self, *point: Any) -> None:
        """Where the device begins, mm; None: unknown."""
        self._set("_base", _numbers(point))

    def SetDirection(self, *vector: Any) -> None:
        """Direction of deployment at the base; None: unknown."""
        self._set("_direction", _numbers(vector))

    def SetTopDown(self, top_down: bool) -> None:
        """Whether the first row of the image data is the top of the picture.

        VTK's readers of pictures begin at the bottom (the default); arrays from numpy, and
        3D Slicer's volumes, at the top.
        """
        self._set("_top_down", bool(top_down))

    def GetReason(self) -> str:
        """What the last result assumed, or why there is none."""
        return self._reason

    def GetErrorCode(self) -> int:
        """0, or vtkErrorCode's UserError where the last run ended in an error."""
        return self._error_code

    def _set(self, name: str, value: Any) -> None:
        setattr(self, name, value)
        self.Modified()

    # ---- the pipeline ----------------------------------------------------------------

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Tell which times there are."""
        return self._guarded(self._tell_times, inputs, outputs)

    def RequestUpdateExtent(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Ask both views for the time step that is wanted."""
        return self._guarded(self._ask_for_time, inputs, outputs)

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        """Reconstruct."""
        return self._guarded(self._reconstruct, inputs, outputs)

    def _guarded(self, step: Callable[[Any, Any], None], inputs: Any, outputs: Any) -> int:
        try:
            step(inputs, outputs)
        except (InputError, ValueError, ImportError) as error:
            return self._refuse(str(error))
        except Exception as error:
            return self._refuse(f"unexpected {type(error).__name__}: {error}; please report it")
        return 1

    def _refuse(self, text: str) -> int:
        """Tell in one line what is wrong, in VTK's way."""
        self._reason, self._error_code = " ".join(text.split()), _USER_ERROR
        # The pipeline would add that the algorithm "returned failure", with a dump: once will do.
        executive = self.GetExecutive()
        if not executive.HasObserver("ErrorEvent"):
            executive.AddObserver("ErrorEvent", lambda *_: None)
        line = f"vtkStereoSOM: {self._reason}"
        if self.HasObserver("ErrorEvent"):
            self.InvokeEvent("ErrorEvent", line)
        else:
            vtk_core.vtkOutputWindow.GetInstance().DisplayErrorText(f"ERROR: {line}\n")
        return 0

    def _tell_times(self, inputs: Any, outputs: Any) -> None:
        steps = _time_steps(inputs)
        times = steps[0] or steps[1]
        if times:
            information = outputs.GetInformationObject(0)
            information.Set(_pipeline.TIME_STEPS(), times, len(times))
            information.Set(_pipeline.TIME_RANGE(), (times[0], times[-1]), 2)

    def _ask_for_time(self, inputs: Any, outputs: Any) -> None:
        steps = _time_steps(inputs)
        index, _ = _wanted(steps, outputs)
        for port, times in enumerate(steps):
            information = inputs[port].GetInformationObject(0)
            # Left alone, VTK asks both ports for the extent of port 0.
            whole = _pipeline.WHOLE_EXTENT()
            if information.Has(whole):
                information.Set(_pipeline.UPDATE_EXTENT(), information.Get(whole), 6)
            if times:
                information.Set(_pipeline.UPDATE_TIME_STEP(), times[min(index, len(times) - 1)])

    def _reconstruct(self, inputs: Any, outputs: Any) -> None:
        self._reason, self._error_code = "", 0
        index, time = _wanted(_time_steps(inputs), outputs)
        images = [
            picture_of(vtk_data.vtkImageData.GetData(inputs[port]), view, top_down=self._top_down)
            for port, view in enumerate("ab")
        ]
        calibration = self._calibration([image.shape for image in images])
        self.UpdateProgress(0.1)
        observation = self._observed(images, calibration, index, time)
        self.UpdateProgress(0.4)
        if self.GetAbortExecute():
            return
        result = reconstruct(observation, method=self._method, options=self._options())
        if not result.ok:
            raise ValueError(f"frame {index}, {time:g} s: {result.status}: {result.reason}")
        self._reason = result.reason
        self.UpdateProgress(0.9)
        output = vtk_data.vtkPolyData.GetData(outputs)
        output.ShallowCopy(
            to_polydata(result, samples=int(self._samples), spacing=self._spacing or None)
        )
        output.GetInformation().Set(vtk_data.vtkDataObject.DATA_TIME_STEP(), time)

    # ---- what the properties say -----------------------------------------------------

    def _options(self) -> Options:
        return Options(
            Prior(self._base, self._direction, self._length or None, self._radius or None)
        )

    def _observed(
        self, images: list[Any], calibration: Calibration, index: int, time: float
    ) -> Observation:
        """The device's pixels in both views, free of lens distortion."""
        segmenter = self._segmenter
        if not callable(segmenter):
            if segmenter not in SEGMENTERS:
                choice = " or ".join(SEGMENTERS)
                raise InputError("Segmenter", f"there is no {segmenter!r}", f"give {choice}")
            segmenter = SEGMENTERS[segmenter]
        rigs, lenses = calibration.rigs, calibration.lenses
        if len(rigs) > 1 and index >= len(rigs):
            raise InputError(
                self._rig_file,
                f"has {len(rigs)} projections, frame {index} is wanted",
                "give one, or one per frame",
            )
        pair = (images[0], images[1])
        rig = rigs[index if len(rigs) > 1 else 0]
        one_frame = Acquisition(lambda _: pair, (rig,), np.array([time]), lenses=lenses)
        return replace(next(observe(one_frame, segmenter)), index=index)

    def _calibration(self, shapes: list[Any]) -> Calibration:
        """Rigs and lenses: from Python, from matrices, or from a file."""
        if self._rig is not None:
            return Calibration((self._rig,), None, "Python")
        a, b = self._projections
        if a is not None and b is not None:
            for name, matrix in (("ProjectionA", a), ("ProjectionB", b)):
                if len(matrix) != 12:
                    raise InputError(name, f"has {len(matrix)} numbers", "give 3×4, by rows")
            sizes = [(columns, rows) for rows, columns in shapes]
            rig = StereoRig.from_projections(
                np.reshape(a, (3, 4)), np.reshape(b, (3, 4)), sizes[0], sizes[1]
            )
            return Calibration((rig,), None, "matrices")
        if not self._rig_file:
            raise InputError(
                "the rig",
                "is not given, so nothing tells where the views stood",
                "set RigFile to a rig.json, or ProjectionA and ProjectionB",
            )
        return read_calibration(self._rig_file)


def centerline(image_a: Any, image_b: Any, **properties: Any) -> Any:
    """Reconstruct two images at once, without a pipeline.

    Parameters
    ----------
    image_a, image_b : vtkImageData
        As pyvista and VTK's readers give them.
    **properties
        By the names of the filter's setters: `RigFile="rig.json"`, `Radius=1.0`, ...

    Returns
    -------
    pyvista.PolyData
        By the contract of `polydata.to_polydata`.

    Raises
    ------
    InputError
        Where there is no such property, or no centerline: it says why.
    """
    som, told = vtkStereoSOM(), []

    # VTK hands the text over only where the observer says that it takes one.
    def hear(caller: Any, event: str, text: str) -> None:
        told.append(text)

    hear.CallDataType = vtk_core.VTK_STRING  # type: ignore[attr-defined]
    som.AddObserver("ErrorEvent", hear)
    for name, value in properties.items():
        if not hasattr(vtkStereoSOM, f"Set{name}"):
            raise InputError(name, "is no property of vtkStereoSOM", "see help(vtkStereoSOM)")
        getattr(som, f"Set{name}")(value)
    som.SetInputDataObject(0, image_a)
    som.SetInputDataObject(1, image_b)
    som.Update()
    if told:
        what, _, rest = told[0].removeprefix("vtkStereoSOM: ").partition(": ")
        why, _, mend = rest.partition("; ")
        raise InputError(what, why or "no result", mend or "look at both pictures")
    return require("pyvista", "vtk").wrap(som.GetOutputDataObject(0))


def _numbers(values: Sequence[Any]) -> Any:
    """Several numbers, or one sequence of them, as VTK's setters take both."""
    if len(values) == 1:
        return None if values[0] is None else list(np.ravel(values[0]))
    return list(values)


def _time_steps(inputs: Any) -> list[tuple[float, ...]]:
    """Times of both views; where both have several, frames pair by their number."""
    steps = []
    for port in range(2):
        information = inputs[port].GetInformationObject(0)
        key = _pipeline.TIME_STEPS()
        has_times = information is not None and information.Has(key)
        steps.append(tuple(information.Get(key) or ()) if has_times else ())
    counts = {len(times) for times in steps} - {0, 1}
    if len(counts) > 1:
        raise InputError(
            "views a, b",
            f"have {len(steps[0])} and {len(steps[1])} time steps, which do not pair",
            "give both views the same frames",
        )
    return steps


def _wanted(steps: list[tuple[float, ...]], outputs: Any) -> tuple[int, float]:
    """Number and time (s) of the step that is asked for: the last at or before the request."""
    times = max(steps, key=len) if len(steps[0]) < 2 else steps[0]
    information, key = outputs.GetInformationObject(0), _pipeline.UPDATE_TIME_STEP()
    if not times:
        return 0, 0.0
    if not information.Has(key):
        return 0, times[0]
    slack = 1e-9 * max(1.0, abs(times[-1]))
    index = int(np.searchsorted(times, information.Get(key) + slack, side="right")) - 1
    index = max(index, 0)
    return index, times[index]
