"""The module Stereo SOM of 3D Slicer: metadata, the panel, and nothing else.

All that is computed stands in `StereoSOMLib`, which needs no Qt.
"""

from pathlib import Path
from typing import Annotated, Any, Optional, Union

import slicer
import vtk
from slicer import vtkMRMLScalarVolumeNode, vtkMRMLSequenceNode
from slicer.parameterNodeWrapper import Choice, Minimum, WithinRange, parameterNodeWrapper
from slicer.ScriptedLoadableModule import (
    ScriptedLoadableModule,
    ScriptedLoadableModuleLogic,
    ScriptedLoadableModuleTest,
    ScriptedLoadableModuleWidget,
)
from slicer.util import VTKObservationMixin

from StereoSOMLib import packages
from StereoSOMLib.settings import METHODS, SEGMENTERS, Settings


class StereoSOM(ScriptedLoadableModule):
    """What Slicer shows of the module."""

    def __init__(self, parent: Any) -> None:
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = "Stereo SOM"
        parent.categories = ["Shape Sensing"]
        parent.dependencies = ["Sequences", "Markups", "Models", "Tables"]
        parent.contributors = ["The stereosom contributors"]
        parent.helpText = (
            "Two views of a thin flexible device in (biplane X-ray, or pictures with a rig file), "
            "its 3D backbone out. Research software, not a medical device."
        )
        parent.acknowledgementText = (
            "Stereo self-organizing map: Croom, Rucker, Romano and Webster, ICRA 2010."
        )


# `Optional` and `Union`: the wrapper reads these when the module is loaded, in old Pythons, too.
@parameterNodeWrapper
class StereoSOMParameterNode:
    """What is chosen in the panel, saved with the scene: the inputs, and all of `Settings`."""

    viewA: Union[vtkMRMLScalarVolumeNode, vtkMRMLSequenceNode, None]  # noqa: UP007
    viewB: Union[vtkMRMLScalarVolumeNode, vtkMRMLSequenceNode, None]  # noqa: UP007
    rigFile: Path = Path()
    segmenter: Annotated[str, Choice(list(SEGMENTERS))] = Settings.segmenter
    method: Annotated[str, Choice(list(METHODS))] = Settings.method
    radius: Annotated[float, Minimum(0)] = Settings.radius
    length: Annotated[float, Minimum(0)] = Settings.length
    samples: Annotated[int, WithinRange(2, 2000)] = Settings.samples
    rate: Annotated[float, WithinRange(0.01, 1000)] = Settings.rate


class StereoSOMWidget(ScriptedLoadableModuleWidget, VTKObservationMixin):
    """The panel: it passes on what is chosen, and shows how far it is."""

    def __init__(self, parent: Any = None) -> None:
        ScriptedLoadableModuleWidget.__init__(self, parent)
        VTKObservationMixin.__init__(self)
        self.logic: Any = None
        self._parameterNode: Any = None
        self._guiTag: Any = None
        self._stopped = False

    # ---- what Slicer calls -----------------------------------------------------------

    def setup(self) -> None:
        """Build the panel when it is first opened."""
        ScriptedLoadableModuleWidget.setup(self)
        panel = slicer.util.loadUI(self.resourcePath("UI/StereoSOM.ui"))
        self.layout.addWidget(panel)
        self.ui = slicer.util.childWidgetVariables(panel)
        panel.setMRMLScene(slicer.mrmlScene)
        self.logic = StereoSOMLogic()
        scene = slicer.mrmlScene
        self.addObserver(scene, scene.StartCloseEvent, self.onSceneStartClose)
        self.addObserver(scene, scene.EndCloseEvent, self.onSceneEndClose)
        self.ui.applyButton.connect("clicked(bool)", self.onApply)
        self.ui.stopButton.connect("clicked(bool)", self.onStop)
        self.ui.editButton.connect("clicked(bool)", self.onEdit)
        self.ui.exportButton.connect("clicked(bool)", self.onExport)
        self._setRunning(False)
        self.initializeParameterNode()

    def cleanup(self) -> None:
        """Slicer closes."""
        self._stopped = True
        self.removeObservers()

    def enter(self) -> None:
        """The user opens the panel."""
        self.initializeParameterNode()

    def exit(self) -> None:
        """The user leaves the panel."""
        self._setParameterNode(None)

    def onSceneStartClose(self, caller: Any, event: Any) -> None:
        """Let go of the nodes that are about to go."""
        self._stopped = True
        self._setParameterNode(None)
        self.logic.results = None

    def onSceneEndClose(self, caller: Any, event: Any) -> None:
        """Begin anew in the empty scene."""
        if self.parent.isEntered:
            self.initializeParameterNode()

    # ---- parameters ------------------------------------------------------------------

    def initializeParameterNode(self) -> None:
        """Bind the panel to the scene's parameter node."""
        self._setParameterNode(self.logic.getParameterNode())

    def _setParameterNode(self, node: Any) -> None:
        changed = vtk.vtkCommand.ModifiedEvent
        if self._parameterNode:
            self._parameterNode.disconnectGui(self._guiTag)
            self.removeObserver(self._parameterNode, changed, self._checkCanApply)
        self._parameterNode = node
        if node:
            # The .ui file names the parameter of each widget: SlicerParameterName.
            self._guiTag = node.connectGui(self.ui)
            self.addObserver(node, changed, self._checkCanApply)
            self._checkCanApply()

    def _checkCanApply(self, caller: Any = None, event: Any = None) -> None:
        node = self._parameterNode
        self.ui.applyButton.enabled = bool(node and node.viewA and node.viewB)

    # ---- buttons ---------------------------------------------------------------------

    def onApply(self, *_: Any) -> None:
        """Reconstruct, and show each frame as it comes."""
        with slicer.util.tryWithErrorDisplay("Stereo SOM", waitCursor=False):
            self._stopped = False
            self._setRunning(True)
            try:
                self.logic.ensurePackages(self._parameterNode)
                for done, count, line in self.logic.process(self._parameterNode):
                    self.ui.progressBar.maximum = count
                    self.ui.progressBar.value = done
                    self.ui.messageLabel.text = line
                    self.ui.seekWidget.setMRMLSequenceBrowserNode(self.logic.results.browser)
                    self.ui.playWidget.setMRMLSequenceBrowserNode(self.logic.results.browser)
                    self.ui.tableView.setMRMLTableNode(self.logic.results.table)
                    slicer.app.processEvents()
                    if self._stopped:
                        break
                slicer.util.resetSliceViews()
                slicer.util.resetThreeDViews()
            finally:
                self._setRunning(False)

    def onStop(self, *_: Any) -> None:
        """End after the present frame; what is done stays."""
        self._stopped = True

    def onEdit(self, *_: Any) -> None:
        """Load the curve that is shown as a markups curve."""
        with slicer.util.tryWithErrorDisplay("Stereo SOM", waitCursor=True):
            self.logic.editable()

    def onExport(self, *_: Any) -> None:
        """Write a folder of results."""
        with slicer.util.tryWithErrorDisplay("Stereo SOM", waitCursor=True):
            folder = self.logic.export(self._parameterNode, self.ui.exportPathEdit.currentPath)
            self.ui.messageLabel.text = f"written to {folder}"

    def _setRunning(self, running: bool) -> None:
        self.ui.inputsButton.enabled = not running
        self.ui.settingsButton.enabled = not running
        self.ui.applyButton.visible = not running
        self.ui.stopButton.visible = running
        self.ui.progressBar.visible = running
        done = self.logic.results is not None and not running
        self.ui.editButton.enabled = done
        self.ui.exportButton.enabled = done


class StereoSOMLogic(ScriptedLoadableModuleLogic):
    """Between the panel and `StereoSOMLib`: also for scripts in Slicer's Python console."""

    def __init__(self) -> None:
        ScriptedLoadableModuleLogic.__init__(self)
        self.results: Any = None

    def getParameterNode(self) -> StereoSOMParameterNode:
        """What is chosen, as it is saved with the scene."""
        return StereoSOMParameterNode(super().getParameterNode())

    @staticmethod
    def ensurePackages(chosen: Any) -> None:
        """Install what Slicer lacks for this run, if the user agrees."""
        packages.check_python()
        packages.install_missing(
            packages.needed(dicom=not rig_file(chosen)),
            install=slicer.util.pip_install,
            agree=slicer.util.confirmOkCancelDisplay,
        )

    def process(self, chosen: Any) -> Any:
        """Reconstruct a run; yields (frames done, frames in all, a line to show) after each."""
        from StereoSOMLib import run, showing

        settings, scene = settings_of(chosen), slicer.mrmlScene
        source = run.open_source(
            scene, chosen.viewA, chosen.viewB, rig_file(chosen), settings, file_of_instance
        )
        for note in source.acquisition.notes:
            print(f"Stereo SOM: note: {note}")
        self.results, frames = run.reconstruct(scene, source, settings)
        for done, result in enumerate(frames, start=1):
            if done == 1:
                showing.show(scene, self.results)
            yield done, len(source.acquisition), run.line_of(result)

    def editable(self) -> Any:
        """Return a markups curve of the frame that is shown."""
        from StereoSOMLib import run

        return run.load_editable(self.results, slicer.util.loadMarkups)

    def export(self, chosen: Any, folder: str) -> Path:
        """Write a folder as the command `stereosom` does."""
        from StereoSOMLib import run

        if not folder:
            raise ValueError("The export folder is not chosen.")
        return run.export(self.results, settings_of(chosen), folder)


def settings_of(chosen: Any) -> Settings:
    """Return the settings among what is chosen."""
    names = Settings.__dataclass_fields__
    return Settings(**{name: getattr(chosen, name) for name in names})


def rig_file(chosen: Any) -> str:
    """Path of the rig file; empty where none is chosen: `Path()` is the current folder."""
    return "" if chosen.rigFile == Path() else str(chosen.rigFile)


def file_of_instance(uid: str) -> Optional[str]:  # noqa: UP045
    """Return the file of a DICOM object that Slicer has imported."""
    database = slicer.dicomDatabase
    return str(database.fileForInstance(uid)) if database and database.isOpen else None


class StereoSOMTest(ScriptedLoadableModuleTest):
    """Slicer's own self test; the project's tests go through the rest with real MRML nodes."""

    def runTest(self) -> None:
        """Masks of a quarter circle, drawn here, give its length back."""
        self.setUp()
        self.test_quarter_circle()

    def setUp(self) -> None:
        """Begin with an empty scene."""
        slicer.mrmlScene.Clear()

    def test_quarter_circle(self) -> None:
        """Reconstruct two volumes and a rig file."""
        import math
        import tempfile

        logic = StereoSOMLogic()
        chosen = logic.getParameterNode()
        chosen.segmenter = "mask"
        with tempfile.TemporaryDirectory() as folder:
            chosen.rigFile = Path(folder) / "rig.json"
            logic.ensurePackages(chosen)
            from StereoSOMLib.example import quarter_circle

            chosen.viewA, chosen.viewB = quarter_circle(slicer.mrmlScene, chosen.rigFile)
            lines = list(logic.process(chosen))
        assert len(lines) == 1
        length = logic.results.kept[0].backbone.length
        assert abs(length - 60 * math.pi / 2) < 1.0
