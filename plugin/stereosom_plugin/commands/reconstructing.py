"""What every command shares that reconstructs a run: options, progress, output, report."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from stereosom.options import Options, Prior
from stereosom.stereo_som import METHOD as STEREO_SOM
from stereosom.stereo_som import StereoSomOptions

from ..acquisition import Acquisition
from ..centerline import read_vtp
from ..errors import InputError, require
from ..output import OutputFolder, Row, centerline_path
from ..polydata import generator
from ..run import Sampling, describe_inputs, reconstruct_run
from ..segmentation import MaskFiles, Segmentation
from ..segmentation.show import MaskPictures
from .drawing import draw

Arguments = argparse.Namespace


def reconstruct_and_report(
    acquisition: Acquisition,
    segment: Segmentation,
    arguments: Arguments,
    *,
    check_geometry: bool = False,
) -> int:
    """Reconstruct a run into its output folder, draw and report it; returns the exit code.

    Where `check_geometry` is set, a warning is printed if the views disagree about the device.
    """
    from ..geometry_check import GeometryCheck  # scipy.signal: a second that others can do without

    for note in acquisition.notes:
        print(f"stereosom: note: {note}", file=sys.stderr)
    frames = _frames(arguments.frames, len(acquisition))
    options = _options(arguments)
    record = _record(acquisition, arguments)
    if isinstance(segment, MaskFiles):
        record["options"]["masks"] = [*segment.named, segment.digest]
    folder = OutputFolder(arguments.output, record)
    check = GeometryCheck(frames if check_geometry else ())
    folder.begin(acquisition.rigs, lenses=acquisition.lenses, overwrite=arguments.overwrite)
    results = reconstruct_run(
        acquisition,
        folder,
        segment=segment,
        frames=frames,
        method=arguments.method,
        options=options,
        sampling=Sampling(arguments.samples, arguments.spacing),
        progress=progress_bar(arguments),
        watch=check.see,
        show=MaskPictures(folder.path) if getattr(arguments, "show_masks", False) else None,
    )
    for result in results:
        if not result.ok:
            warn(f"frame {result.index}: {result.status}: {result.reason}")
    folder.finish()
    # Where no frame has a curve, it is what was segmented that must be doubted.
    found = any(row["status"] in ("ok", "predicted") for row in folder.rows)
    if found and (doubt := check.warning()):
        warn(f"warning: {doubt}")
    if arguments.render:
        _render_run(acquisition, folder)
    _report(folder, arguments)
    return 0 if all(row["status"] in ("ok", "predicted") for row in folder.rows) else 1


def _render_run(acquisition: Acquisition, folder: OutputFolder) -> None:
    """Draw the first frame that has a curve: in space, and over each view."""
    curves = [row for row in folder.rows if row["status"] in ("ok", "predicted")]
    if not curves:
        return
    line = read_vtp(centerline_path(folder.path, int(curves[0]["frame"])))
    pictures = acquisition.read(line.frame)
    draw(line, acquisition.rigs, pictures, folder.path / "scene.png", overlays=folder.path)


def _options(arguments: Arguments) -> Options:
    prior = Prior(arguments.base, arguments.direction, arguments.length, arguments.radius)
    if arguments.method == STEREO_SOM:
        return StereoSomOptions(prior=prior, reference_vectors=arguments.nodes)
    return Options(prior=prior)


def _record(acquisition: Acquisition, arguments: Arguments) -> dict[str, Any]:
    """What makes a call this call: the same one goes on where it stopped."""
    shaping = ("method", "nodes", "base", "direction", "length", "radius", "frames", "samples",
               "spacing", "rate", "dsa", "refine_geometry", "segmenter", "layout", "right_first",
               "rectified", "background", "color_box", "width")  # fmt: skip
    inputs = list(acquisition.sources)
    if getattr(arguments, "rig", None):
        inputs.append(Path(arguments.rig))
    return {
        "generator": generator(),
        "command": arguments.command,
        "inputs": describe_inputs(inputs),
        "options": {name: getattr(arguments, name, None) for name in shaping},
        "notes": list(acquisition.notes),
    }


def _frames(wanted: tuple[int | None, int | None] | None, count: int) -> range:
    frames = range(count)[slice(*wanted)] if wanted else range(count)
    if len(frames) == 0:
        raise InputError(
            "--frames", f"chooses none of {count} frames", f"give A:B within 0:{count}"
        )
    return frames


def progress_bar(
    arguments: Arguments, does: str = "reconstructing"
) -> Callable[[Iterable[Any]], Iterable[Any]]:
    """A bar on a terminal; nothing in a pipe; or what the caller of `cli.main` shows."""
    if getattr(arguments, "progress", None) is not None:
        return arguments.progress  # type: ignore[no-any-return]
    if arguments.quiet or not sys.stderr.isatty():
        return iter
    bar = require("tqdm", "fluoroscopy").tqdm

    def shown(steps: Iterable[Any]) -> Iterator[Any]:
        return iter(bar(list(steps), desc=does))

    return shown


def _report(folder: OutputFolder, arguments: Arguments) -> None:
    rows = folder.rows
    if arguments.json:
        print(json.dumps({"output": str(folder.path), "frames": rows}, indent=1))
        return
    counts = {row["status"]: 0 for row in rows}
    for row in rows:
        counts[row["status"]] += 1
    frames = "1 frame" if len(rows) == 1 else f"{len(rows)} frames"
    say(arguments, f"{frames}: " + ", ".join(f"{n} {s}" for s, n in counts.items()))
    curves = [row for row in rows if row["status"] in ("ok", "predicted")]
    if curves:
        say(
            arguments,
            f"length {_range(curves, 'length_mm')} mm, tip to ±{_range(curves, 'sigma_mm')} mm, "
            f"residual {_range(curves, 'residual_a_px')} px in view a, "
            f"{_range(curves, 'residual_b_px')} px in view b",
        )
        assumed = next((row["reason"] for row in curves if row["reason"]), "")
        if assumed:
            say(arguments, f"assumed: {assumed}")
    say(arguments, f"written to {folder.path}")


def _range(rows: Sequence[Row], column: str) -> str:
    values = [float(row[column]) for row in rows]
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return low if low == high else f"{low} to {high}"


def say(arguments: Arguments, text: str) -> None:
    """Print a line, unless it is not wanted."""
    if not arguments.quiet and not getattr(arguments, "json", False):
        print(text)


def warn(text: str) -> None:
    """Print a line on standard error."""
    print(f"stereosom: {text}", file=sys.stderr)
