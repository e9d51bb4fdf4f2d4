"""From frames to files: segment, track, write, one frame at a time."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from stereosom.observation import Observation
from stereosom.options import Options
from stereosom.reconstruct import track
from stereosom.reconstruction import Reconstruction

from .acquisition import Acquisition
from .ahead import ahead
from .centerline import read_vtp
from .output import OutputFolder, centerline_path
from .segmentation import Segmentation, Show, is_own, observe

# Frames that are made again where an interrupted run goes on.
REPEATED = 3


@dataclass(frozen=True)
class Sampling:
    """How finely a curve is written: a number of points, or a longest step in mm."""

    samples: int = 200
    spacing: float | None = None


def reconstruct_run(
    acquisition: Acquisition,
    folder: OutputFolder,
    *,
    segment: Segmentation,
    frames: Sequence[int],
    method: str,
    options: Options,
    sampling: Sampling,
    progress: Callable[[Iterable[int]], Iterable[int]] = iter,
    watch: Callable[[Observation], None] | None = None,
    show: Show | None = None,
) -> Iterator[Reconstruction]:
    """Reconstruct the frames that are not done yet, and write each while the next is tracked.

    Parameters
    ----------
    acquisition : Acquisition
    folder : OutputFolder
        Begun; frames that have a row in it are passed over.
    segment : callable, pair of callables or MaskFiles
        As in `observe`.
    frames : sequence of int
        Numbers of the frames that are wanted.
    method : str
    options : Options
    sampling : Sampling
    progress : callable
        Wraps the frame numbers that are left, to show how far it is.
    watch : callable, optional
        Given each observation before it is reconstructed.
    show : callable, optional
        Given the pictures and masks of each frame, as in `observe`.

    Yields
    ------
    Reconstruction
        Each as soon as its files are written.
    """
    done = folder.frames_done
    left = [frame for frame in frames if frame not in done]
    again = _again(frames, done, left)
    options = _resumed(folder, options, again)
    steps = iter(progress(left))
    seen: Iterable[Observation] = observe(acquisition, segment, frames=[*again, *left], show=show)
    if is_own(segment):  # a user's may hold what cannot be copied
        seen = _after_first(seen)
    observations = _watched(seen, watch)

    def written(result: Reconstruction) -> Reconstruction:
        folder.commit(
            result,
            samples=sampling.samples,
            spacing=sampling.spacing,
            source_uids=acquisition.source_uids,
        )
        return result

    # A disk takes its time: meanwhile the next frame is tracked.
    with ThreadPoolExecutor(1) as disk:
        waiting: Future[Reconstruction] | None = None
        for result in track(observations, method=method, options=options):
            if result.index in done:
                continue
            if waiting is not None:
                yield waiting.result()
            next(steps, None)
            waiting = disk.submit(written, result)
        if waiting is not None:
            yield waiting.result()
    next(steps, None)


def _after_first(seen: Iterable[Observation]) -> Iterator[Observation]:
    """Yield the same, all but the first from another process, ahead.

    There is nothing else to be done before the first, and what was loaded and compiled for it
    here need not be loaded once more there, nor for the next run.
    """
    seen = iter(seen)
    yield from islice(seen, 1)
    yield from ahead(seen)


def _watched(
    observations: Iterable[Observation], watch: Callable[[Observation], None] | None
) -> Iterator[Observation]:
    for observation in observations:
        if watch is not None:
            watch(observation)
        yield observation


def describe_inputs(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """Path and SHA-256 of each input file, for the record of a run."""
    paths = list(paths)
    with ThreadPoolExecutor() as pool:  # both planes at once
        digests = list(pool.map(_digest, paths))
    return [
        {"path": str(Path(path).resolve()), "sha256": digest}
        for path, digest in zip(paths, digests, strict=True)
    ]


def _digest(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _again(frames: Sequence[int], done: set[int], left: Sequence[int]) -> list[int]:
    """Frames of an interrupted run that are made once more, unwritten, before it goes on.

    They tell anew what is not in the files: how the device moved, and how it was segmented.
    """
    if not left:
        return []
    before = [frame for frame in frames if frame < left[0] and frame in done]
    return before[-REPEATED:]


def _resumed(folder: OutputFolder, options: Options, again: Sequence[int]) -> Options:
    """Start from the last curve of an interrupted run before the frames that are made again."""
    curves = [
        int(row["frame"])
        for row in folder.rows
        if row["status"] in ("ok", "predicted") and not (again and int(row["frame"]) >= again[0])
    ]
    if not curves:
        return options
    return replace(options, start=read_vtp(centerline_path(folder.path, max(curves))).backbone)
