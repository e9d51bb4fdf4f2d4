"""One run: from what was chosen in the panel to results in the scene, and to files."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from stereosom.reconstruct import track
from stereosom.reconstruction import Reconstruction
from stereosom_plugin.exports import write_sequence
from stereosom_plugin.output import OutputFolder
from stereosom_plugin.polydata import generator, to_centerline, write_markups
from stereosom_plugin.run import describe_inputs
from stereosom_plugin.segmentation import observe

from .results import Results
from .settings import Settings
from .views import Source, View, source_from_dicom, source_from_rig

SEQUENCE = "centerlines.seq.mrb"


def open_source(
    scene: Any,
    view_a: Any,
    view_b: Any,
    rig_file: str,
    settings: Settings,
    file_of: Callable[[str], str | None],
) -> Source:
    """Pictures and geometry of both views.

    Parameters
    ----------
    scene : vtkMRMLScene
    view_a, view_b : vtkMRMLNode
        A volume or a sequence each.
    rig_file : str
        A calibration; empty: the geometry is that of the DICOM files.
    settings : Settings
    file_of : callable
        SOP Instance UID to path: `slicer.dicomDatabase.fileForInstance`.

    Raises
    ------
    InputError
        Where they cannot be used; what, why, and how to mend it.
    """
    a, b = View.of(scene, view_a, "view a"), View.of(scene, view_b, "view b")
    if rig_file:
        return source_from_rig(a, b, rig_file, settings.rate)
    return source_from_dicom(a, b, file_of)


def reconstruct(
    scene: Any, source: Source, settings: Settings
) -> tuple[Results, Iterator[Reconstruction]]:
    """Results that are still empty, and the frames, each in the scene as soon as it is given."""
    results = Results(scene, source, settings.samples)

    def frames() -> Iterator[Reconstruction]:
        observations = observe(source.acquisition, settings.segment())
        for result in track(observations, method=settings.method, options=settings.options()):
            results.add(result)
            yield result

    return results, frames()


def line_of(result: Reconstruction) -> str:
    """What is to be said of a frame."""
    line = f"frame {result.index}: {result.status}"
    if result.backbone is not None:
        line += f", {result.backbone.length:.1f} mm"
    return f"{line} ({result.reason})" if result.reason else line


def export(results: Results, settings: Settings, folder: str | Path) -> Path:
    """Write a folder as the `stereosom` command does, and a `.seq.mrb`.

    ParaView opens its `.pvd`; `stereosom render` and `export` take the folder.

    Raises
    ------
    InputError
        Where the folder holds something else or cannot be written.
    """
    source = results.source
    record = {
        "generator": generator(),
        "command": source.command,
        "inputs": describe_inputs(source.acquisition.sources),
        "options": asdict(settings),
        "notes": list(source.acquisition.notes),
    }
    output = OutputFolder(folder, record)
    output.begin(source.acquisition.rigs, lenses=source.acquisition.lenses)
    for result in results.kept:
        if result.index not in output.frames_done:
            output.commit(
                result, samples=results.samples, source_uids=source.acquisition.source_uids
            )
    output.finish()
    lines = [to_centerline(r, samples=results.samples) for r in results.kept if r.ok]
    if lines:
        write_sequence(lines, output.path / SEQUENCE)
    return output.path


def load_editable(results: Results, load: Callable[[str], Any]) -> Any:
    """Load the curve of the time that is shown as a markups curve, whose points can be moved.

    `load` is `slicer.util.loadMarkups`; it goes through the file that Slicer reads best.

    Raises
    ------
    ValueError
        Where the frame has no curve.
    """
    result = results.result_shown()
    if not result.ok:
        raise ValueError(f"frame {result.index} has no curve: {result.reason}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"centerline_{result.index:04d}.mrk.json"
        write_markups(result, path)
        return load(str(path))
