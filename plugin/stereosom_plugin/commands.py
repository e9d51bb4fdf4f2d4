"""What each subcommand of `stereosom` does; `cli` reads its words."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from stereosom.options import Options, Prior
from stereosom.reconstruct import METHODS
from stereosom.stereo_som import METHOD as STEREO_SOM
from stereosom.stereo_som import StereoSomOptions

from . import masks, segmentation
from .acquisition import Acquisition, Image
from .calibration import read_rig
from .centerline import Centerline, read_vtp
from .errors import InputError, require
from .evaluation import FrameErrors, evaluate
from .experiments import EXPERIMENTS
from .output import RECORD, RIG, OutputFolder, Row, centerline_path, read_table
from .polydata import generator
from .run import Sampling, describe_inputs, reconstruct_run

Arguments = argparse.Namespace


def fluoroscopy(arguments: Arguments) -> int:
    """Reconstruct a biplane X-ray run from DICOM."""
    from .fluoroscopy import read_biplane

    acquisition = read_biplane(*arguments.inputs)
    return _reconstruct(acquisition, segmentation.segment_xray, arguments)


def from_masks(arguments: Arguments) -> int:
    """Reconstruct pairs of mask pictures."""
    rigs = read_rig(arguments.rig)
    acquisition = masks.read_masks(arguments.a, arguments.b, rigs, rate_hz=arguments.rate)
    if len(acquisition) == 1:
        # Of a run, empty frames fail and the others are done; here nothing would be left.
        for path, image in zip(acquisition.sources, acquisition.read(0), strict=True):
            if not segmentation.binary(image).any():
                raise InputError(
                    path, "shows no device: the mask is empty", "give a mask that is white on it"
                )
    return _reconstruct(acquisition, segmentation.binary, arguments)


def render(arguments: Arguments) -> int:
    """Draw one frame of an output folder, or a `.vtp`."""
    path, picture = Path(arguments.input), Path(arguments.output)
    if picture.suffix.lower() != ".png":
        raise InputError(picture, "is no .png", "give --output a name that ends in .png")
    folder = path if path.is_dir() else path.parent
    if path.is_dir():
        rows = read_table(path)
        with_curve = [int(row["frame"]) for row in rows if row["status"] in ("ok", "predicted")]
        if not with_curve:
            raise InputError(path, "holds no centerline", "render a run with one frame that is ok")
        frame = with_curve[0] if arguments.frame is None else arguments.frame
        path = centerline_path(path, frame)
    line = read_vtp(path)
    rigs = read_rig(folder / RIG) if (folder / RIG).exists() else ()
    images = _source_pictures(folder, line.frame, arguments.quiet)
    _draw(line, rigs, images, picture, color_by=arguments.color_by)
    _say(arguments, str(picture))
    return 0


def evaluation(arguments: Arguments) -> int:
    """Compare centerlines with the truth."""
    errors = evaluate(arguments.input, arguments.truth)
    if arguments.json:
        print(json.dumps([asdict(frame) for frame in errors], indent=1))
    else:
        print(_table(errors))
    return 0


def demo(arguments: Arguments) -> int:
    """Reconstruct the study that ships, draw it, and compare it with its truth."""
    with sample_folder() as sample:
        arguments.inputs = [str(sample / "plane_a.dcm"), str(sample / "plane_b.dcm")]
        arguments.command, arguments.render = "fluoroscopy", True
        code = fluoroscopy(arguments)
        if not arguments.json and not arguments.quiet:
            print("\nagainst the truth, mm:")
            print(_table(evaluate(arguments.output, sample)))
            print(f"\nlook at {Path(arguments.output) / 'scene.png'}")
    return code


def experiment(arguments: Arguments) -> int:
    """Repeat an experiment; print what it found."""
    output = Path(arguments.output or arguments.name)
    progress = _progress(arguments, arguments.name)
    print(EXPERIMENTS[arguments.name](output, progress=progress))
    return 0


def sample_folder() -> Any:
    """Context that gives the folder of the sample study, from the wheel or the checkout."""
    shipped = files("stereosom_plugin") / "sample"
    if shipped.is_dir():
        return as_file(shipped)
    return nullcontext(Path(__file__).parents[2] / "data" / "biplane")


# ---- what they share ---------------------------------------------------------------------


def _reconstruct(
    acquisition: Acquisition, segment: Callable[[Image], Any], arguments: Arguments
) -> int:
    for note in acquisition.notes:
        print(f"stereosom: note: {note}", file=sys.stderr)
    frames = _frames(arguments.frames, len(acquisition))
    options = _options(arguments)
    folder = OutputFolder(arguments.output, _record(acquisition, arguments))
    folder.begin(acquisition.rigs, overwrite=arguments.overwrite)
    results = reconstruct_run(
        acquisition,
        folder,
        segment=segment,
        frames=frames,
        method=arguments.method,
        options=options,
        sampling=Sampling(arguments.samples, arguments.spacing),
        progress=_progress(arguments),
    )
    for result in results:
        if not result.ok:
            _warn(f"frame {result.index}: {result.status}: {result.reason}")
    folder.finish()
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
    _draw(line, acquisition.rigs, pictures, folder.path / "scene.png", overlays=folder.path)


def _draw(
    line: Centerline,
    rigs: Sequence[Any],
    images: tuple[Image, Image] | None,
    picture: Path,
    *,
    color_by: str = "Curvature",
    overlays: Path | None = None,
) -> None:
    from . import render as pictures

    rig = rigs[min(line.frame, len(rigs) - 1)] if rigs else None
    pictures.scene(line, rig, picture, images, color_by=color_by)
    if overlays and images and rig:
        for view, image, camera in zip("ab", images, (rig.a, rig.b), strict=True):
            path = overlays / f"overlay_{view}.png"
            color = pictures.VIEW_COLORS[view]
            pictures.overlay(image, line.backbone, camera, path, color=color)


def _source_pictures(folder: Path, frame: int, quiet: bool) -> tuple[Image, Image] | None:
    """The pictures that a folder was made of, where they are still in their place."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        paths = [Path(source["path"]) for source in record["inputs"]]
        if record["command"] == "fluoroscopy":
            from .fluoroscopy import read_biplane

            return read_biplane(paths[0], paths[1]).read(frame)
        rigs = read_rig(folder / RIG)
        half = len(paths) // 2
        pair = (paths[frame], paths[half + frame])
        return masks.read_masks(*pair, rigs[:1]).read(0)
    except (OSError, ValueError, KeyError, IndexError, TypeError):
        if not quiet:
            _warn("the pictures that it was made of are not found: it is drawn without them")
        return None


def _options(arguments: Arguments) -> Options:
    prior = Prior(arguments.base, arguments.direction, arguments.length, arguments.radius)
    if arguments.method == STEREO_SOM:
        return StereoSomOptions(prior=prior, reference_vectors=arguments.nodes)
    return Options(prior=prior)


def _record(acquisition: Acquisition, arguments: Arguments) -> dict[str, Any]:
    """What makes a call this call: the same one goes on where it stopped."""
    shaping = ("method", "nodes", "base", "direction", "length", "radius", "frames", "samples",
               "spacing", "rate")  # fmt: skip
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


def _progress(
    arguments: Arguments, does: str = "reconstructing"
) -> Callable[[Iterable[Any]], Iterator[Any]]:
    """A bar on a terminal; nothing in a pipe."""
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
    _say(arguments, f"{len(rows)} frames: " + ", ".join(f"{n} {s}" for s, n in counts.items()))
    curves = [row for row in rows if row["status"] in ("ok", "predicted")]
    if curves:
        _say(
            arguments,
            f"length {_range(curves, 'length_mm')} mm, tip to ±{_range(curves, 'sigma_mm')} mm, "
            f"residual {_range(curves, 'residual_a_px')} px in view a, "
            f"{_range(curves, 'residual_b_px')} px in view b",
        )
        assumed = next((row["reason"] for row in curves if row["reason"]), "")
        if assumed:
            _say(arguments, f"assumed: {assumed}")
    _say(arguments, f"written to {folder.path}")


def _range(rows: Sequence[Row], column: str) -> str:
    values = [float(row[column]) for row in rows]
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return low if low == high else f"{low} to {high}"


def _table(errors: Sequence[FrameErrors]) -> str:
    columns = ("distance", "mean", "p95", "maximum", "base", "tip")
    lines = ["frame " + "".join(f"{name:>10}" for name in columns) + "   covered"]
    lines += [
        f"{frame.frame:5d} "
        + "".join(f"{getattr(frame, name):10.3f}" for name in columns)
        + f"{frame.covered:10.1%}"
        for frame in errors
    ]
    return "\n".join(lines)


def _say(arguments: Arguments, text: str) -> None:
    if not arguments.quiet and not getattr(arguments, "json", False):
        print(text)


def _warn(text: str) -> None:
    print(f"stereosom: {text}", file=sys.stderr)


__all__ = ["METHODS", "demo", "evaluation", "fluoroscopy", "from_masks", "render", "sample_folder"]
