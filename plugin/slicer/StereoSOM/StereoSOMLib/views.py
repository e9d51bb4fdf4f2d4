"""A view's pictures: from the volume or sequence that the user chose to an `Acquisition`.

Pixels are (i, j) of a volume: i is the column, j the row from the top, as in the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.calibration import read_calibration
from stereosom_plugin.errors import InputError
from stereosom_plugin.vtk_images import picture_of

_SECONDS = {"s": 1.0, "ms": 1e-3}
_INSTANCES = "DICOM.instanceUIDs"


class Place(NamedTuple):
    """Where a picture lies: a volume, and which of its slices."""

    volume: Any
    slice_number: int


@dataclass(frozen=True)
class View:
    """One view: pictures of a sequence (an item each), or of a volume (a slice each).

    Parameters
    ----------
    name : str
        In messages.
    shown : vtkMRMLVolumeNode or None
        What slice views show of it.
    sequence : vtkMRMLSequenceNode or None
    """

    name: str
    shown: Any
    sequence: Any

    @classmethod
    def of(cls, scene: Any, node: Any, name: str) -> View:
        """Take what the user chose: a volume, a sequence, or a volume that shows a sequence.

        Raises
        ------
        InputError
            Where nothing was chosen, or it holds no pictures.
        """
        if node is None:
            raise InputError(name, "is not chosen", "choose a volume or a sequence")
        if node.IsA("vtkMRMLSequenceNode"):
            browsers = [b for b in _browsers(scene) if b.IsSynchronizedSequenceNode(node, True)]
            shown = browsers[0].GetProxyNode(node) if browsers else None
            view = cls(name, shown, node)
        else:
            sequences = [browser.GetSequenceNode(node) for browser in _browsers(scene)]
            view = cls(name, node, next((found for found in sequences if found), None))
        for number in range(view.items):
            volume = view.item(number)
            if not volume.IsA("vtkMRMLVolumeNode") or volume.GetImageData() is None:
                raise InputError(name, "holds no pictures", "choose a volume or image sequence")
        if len(view) == 0:
            raise InputError(name, "holds no frames", "choose a volume or image sequence")
        return view

    @property
    def items(self) -> int:
        """Number of volumes."""
        return 1 if self.sequence is None else self.sequence.GetNumberOfDataNodes()

    def item(self, number: int) -> Any:
        """One of the volumes."""
        return self.shown if self.sequence is None else self.sequence.GetNthDataNode(number)

    def __len__(self) -> int:
        if self.sequence is not None:
            return int(self.items)
        return int(self.shown.GetImageData().GetDimensions()[2])

    def place(self, frame: int) -> Place:
        """Where the picture of a frame lies."""
        return Place(self.shown, frame) if self.sequence is None else Place(self.item(frame), 0)

    def picture(self, frame: int) -> Any:
        """Gray values of a frame, (rows, columns), the top row first."""
        volume, number = self.place(frame)
        chosen = number if self.sequence is None else None  # an item is one picture
        return picture_of(volume.GetImageData(), self.name, top_down=True, slice_number=chosen)

    def times(self) -> Any:
        """Seconds of the frames, (n,), from the sequence's index; None where it has no times."""
        scale = _SECONDS.get(self.sequence.GetIndexUnit()) if self.sequence else None
        if scale is None:
            return None
        try:
            values = [float(self.sequence.GetNthIndexValue(i)) for i in range(len(self))]
        except ValueError:
            return None
        return scale * np.array(values)

    def files(self, file_of: Callable[[str], str | None]) -> list[Path]:
        """DICOM files that the pictures were loaded from, in order, as Slicer's database says.

        Raises
        ------
        InputError
            Where a volume does not say where it comes from, or the database has no such file.
        """
        uids: list[str] = []
        for number in range(self.items):
            own = (self.item(number).GetAttribute(_INSTANCES) or "").split()
            if not own:
                raise InputError(
                    self.name,
                    "was not loaded from DICOM, so nothing tells where it was taken from",
                    "load it with the DICOM module, or choose a rig file",
                )
            uids += own
        files = []
        for uid in dict.fromkeys(uids):
            file = file_of(uid)
            if not file:
                raise InputError(
                    self.name, f"its file ({uid}) is not in the DICOM database", "import it again"
                )
            files.append(Path(file))
        return files

    def frame_of(self, files: list[Path], file: Path, number: int) -> int:
        """Which of the view's frames a picture of a file is."""
        return number if len(files) == 1 else files.index(file)


def _browsers(scene: Any) -> Iterator[Any]:
    for number in range(scene.GetNumberOfNodesByClass("vtkMRMLSequenceBrowserNode")):
        yield scene.GetNthNodeByClass(number, "vtkMRMLSequenceBrowserNode")


@dataclass(frozen=True)
class Source:
    """An acquisition, and which frames of both views its frames are.

    `acquisition.rig(n).a` is view a here, too: where DICOM says that the user's view a is plane
    B, the views change places.
    """

    acquisition: Acquisition
    views: tuple[View, View]
    frames: tuple[list[int], list[int]]
    command: str


def source_from_rig(a: View, b: View, rig_file: str, rate: float) -> Source:
    """Take pictures from the scene, and the geometry from a calibration file.

    Raises
    ------
    InputError
        Where the views do not pair, or not with the file.
    """
    if len(a) != len(b):
        raise InputError("views a, b", f"have {len(a)} and {len(b)} frames", "choose two that pair")
    calibration = read_calibration(rig_file)
    count, rigs = len(a), calibration.rigs
    if len(rigs) not in (1, count):
        raise InputError(
            rig_file, f"has {len(rigs)} projections for {count} frames", "give one, or one each"
        )
    for view, camera in ((a, rigs[0].a), (b, rigs[0].b)):
        width, height = view.place(0).volume.GetImageData().GetDimensions()[:2]
        if (width, height) != tuple(camera.image_size):
            raise InputError(
                view.name,
                f"is {width}×{height} pixels, the rig's is {'×'.join(map(str, camera.image_size))}",
                "choose the pictures and the rig of one recording",
            )
    times = next((known for known in (a.times(), b.times()) if known is not None), None)
    notes = list(calibration.notes)
    if times is None:
        times = np.arange(count) / rate
        if count > 1:
            notes.append(f"the pictures carry no times: {rate:g} frames per second are taken")

    def read(frame: int) -> tuple[Any, Any]:
        return a.picture(frame), b.picture(frame)

    acquisition = Acquisition(
        read,
        rigs,
        times - times[0],
        (Path(rig_file),),
        notes=tuple(notes),
        lenses=calibration.lenses,
    )
    return Source(acquisition, (a, b), (list(range(count)), list(range(count))), "slicer")


def source_from_dicom(a: View, b: View, file_of: Callable[[str], str | None]) -> Source:
    """Take everything from the DICOM files that both views were loaded from.

    Raises
    ------
    InputError
        Where a view was not loaded from DICOM, or the files are no biplane run.
    """
    from stereosom_plugin.fluoroscopy import read_biplane

    files = {view.name: view.files(file_of) for view in (a, b)}
    acquisition = read_biplane(list(dict.fromkeys([*files[a.name], *files[b.name]])))
    assert acquisition.source_frames is not None  # DICOM was read
    of_a, of_b = acquisition.source_frames
    views = (a, b) if of_a[0].path in files[a.name] else (b, a)
    frames = [
        [view.frame_of(files[view.name], picture.path, picture.number) for picture in pictures]
        for view, pictures in zip(views, (of_a, of_b), strict=True)
    ]
    return Source(acquisition, views, (frames[0], frames[1]), "fluoroscopy")
