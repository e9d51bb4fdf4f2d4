"""`read_stereo`: films or pictures of both eyes and their calibration -> Acquisition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from stereosom.arrays import Floats

from ..acquisition import Acquisition, Image, SourceFrame
from ..calibration import Calibration, read_calibration
from ..errors import InputError
from .agreement import agreement, matched_places, row_gap, tell_something
from .dicom import ColorFrames, is_dicom, open_dicom
from .film import Film
from .layout import LAYOUTS, Layout, apart, eye_size, widened
from .pairing import Numbers, pair_by_time
from .pictures import SUFFIXES, Pictures

Source = Film | Pictures | ColorFrames
Paths = str | Path | Sequence[str | Path]
_CHECKED_FRAMES = 3


def read_stereo(
    left: Paths,
    right: Paths | None,
    rig: str | Path,
    *,
    layout: Layout | None = None,
    right_first: bool = False,
    rectified: bool = False,
    rate_hz: float | None = None,
    check: bool = True,
) -> Acquisition:
    """Read a stereo recording. Nothing is decoded but what is asked for, one pair at a time.

    Parameters
    ----------
    left, right : path or sequence of paths
        A film, a folder of pictures, a picture or a DICOM file of each eye; without `right`,
        `left` holds both eyes.
    rig : path
        A calibration of any format of `read_calibration`.
    layout : {'side-by-side', 'top-bottom', 'interleaved', 'interleaved-frames'}, optional
        How one film or picture holds both eyes.
    right_first : bool
        In it the right eye comes first.
    rectified : bool
        Take the calibration's P1 and P2. Where the pictures are seen to be rectified, and the
        calibration has them, they are taken without being asked for.
    rate_hz : float, optional
        Pairs per second of pictures, which carry no times. Default: one.
    check : bool
        Ask a few pictures whether the calibration can be theirs.

    Raises
    ------
    InputError
        Where something cannot be read, does not pair, has another size than the calibration
        says, or the pictures look exchanged or rectified while the calibration is not.
    """
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0):
        raise InputError("--rate", f"{rate_hz:g} is no frame rate", "give frames per second")
    if right is None:
        if layout is None and _paired(left):
            layout = "interleaved-frames"
        acquisition, found = _stacked(_source(left), rig, layout, right_first, rectified, rate_hz)
    else:
        if layout is not None or right_first:
            raise InputError(
                "--layout", "is for one film that holds both eyes", "give one file, or no layout"
            )
        acquisition, found = _two(_source(left), _source(right), rig, rectified, rate_hz)
    return _checked(acquisition, found, rig, right is None) if check else acquisition


def _two(
    left: Source, right: Source, rig: str | Path, rectified: bool, rate_hz: float | None
) -> tuple[Acquisition, Calibration]:
    if left.size != right.size:
        sizes = " and ".join(f"{width}×{height}" for width, height in (left.size, right.size))
        raise InputError(
            _name(right), f"the eyes are {sizes} px", "give both eyes of one endoscope"
        )
    found = read_calibration(rig, image_size=left.size, rectified=rectified)
    if left.times is None or right.times is None:
        if (left.times is None) != (right.times is None):
            raise InputError(
                f"{_name(left)}, {_name(right)}", "are a film and pictures", "give two of a kind"
            )
        if len(left) != len(right):
            raise InputError(
                f"{_name(left)}, {_name(right)}",
                f"hold {len(left)} and {len(right)} pictures, which do not pair",
                "give both eyes the same frames",
            )
        times, notes = _counted(len(left), rate_hz)
        numbers = (np.arange(len(left)), np.arange(len(left)))
    else:
        *numbers_found, notes = pair_by_time(left.times, right.times)
        numbers = (numbers_found[0], numbers_found[1])
        if len(numbers[0]) == 0:
            raise InputError(
                f"{_name(left)}, {_name(right)}",
                "have no frames of the same time",
                "give both eyes of one recording",
            )
        times = left.times[numbers[0]]

    def read(index: int) -> tuple[Image, Image]:
        return left.frame(int(numbers[0][index])), right.frame(int(numbers[1][index]))

    files = (_files(left), _files(right))
    made = Acquisition(
        read, found.rigs[:1], times, sources=(*files[0], *files[1]),
        notes=(*found.notes, *notes), lenses=found.lenses,
        source_frames=(_frames(left, numbers[0]), _frames(right, numbers[1])),
    )  # fmt: skip
    return made, found


def _stacked(
    source: Source,
    rig: str | Path,
    layout: Layout | None,
    right_first: bool,
    rectified: bool,
    rate_hz: float | None,
) -> tuple[Acquisition, Calibration]:
    if layout is None:
        raise InputError(
            _name(source),
            "is one file, and where it holds the two eyes is not said",
            f"give --layout ({', '.join(LAYOUTS)}), or a second file",
        )
    share = eye_size(source.size, layout)
    found = _calibration_of_one(rig, share, source.size, layout, rectified)
    size = found.rigs[0].a.image_size
    notes: tuple[str, ...] = ()
    if size != share:
        notes = (f"the eyes' {share[0]}×{share[1]} px are widened to {size[0]}×{size[1]}",)
    each = len(source) // 2 if layout == "interleaved-frames" else len(source)
    if layout == "interleaved-frames" and len(source) % 2:
        notes += (f"the last of {len(source)} frames has no other eye",)
    if each == 0:
        raise InputError(_name(source), "holds only one eye", "give a longer film")
    step = 2 if layout == "interleaved-frames" else 1
    if source.times is None:
        times, counted = _counted(each, rate_hz)
        notes += counted
    else:
        times = source.times[: each * step : step]

    def read(index: int) -> tuple[Image, Image]:
        if layout == "interleaved-frames":
            first, second = source.frame(2 * index), source.frame(2 * index + 1)
        else:
            first, second = apart(source.frame(index), layout)
        lines = (0, 1) if layout == "interleaved" else (None, None)
        first, second = widened(first, size, lines[0]), widened(second, size, lines[1])
        return (second, first) if right_first else (first, second)

    numbers = np.arange(each) * step
    made = Acquisition(
        read, found.rigs[:1], times, sources=tuple(_files(source)),
        notes=(*found.notes, *notes), lenses=found.lenses,
        source_frames=(_frames(source, numbers), _frames(source, numbers + step - 1)),
    )  # fmt: skip
    return made, found


def _calibration_of_one(
    rig: str | Path, share: tuple[int, int], whole: tuple[int, int], layout: Layout, rectified: bool
) -> Calibration:
    """The calibration of an eye's share, or of the camera's picture that was squeezed into it.

    Lines that take turns come from two whole pictures, so those are asked for first.
    """
    sizes = [whole, share] if layout == "interleaved" else [share, whole]
    refused: InputError | None = None
    for size in dict.fromkeys(sizes):
        try:
            return read_calibration(rig, image_size=size, rectified=rectified)
        except InputError as error:
            refused = refused or error
    assert refused is not None
    raise refused


def _checked(
    acquisition: Acquisition, found: Calibration, rig: str | Path, stacked: bool
) -> Acquisition:
    """Refuse what cannot be, take P1 and P2 of rectified pictures, note what looks wrong."""
    chosen = np.unique(np.linspace(0, len(acquisition) - 1, _CHECKED_FRAMES).astype(int))
    pairs = []
    for index in chosen:
        try:
            pairs.append(matched_places(*acquisition.read(int(index))))
        except InputError:  # one torn frame does not end a run
            continue
    if not pairs:
        acquisition.read(0)  # says why
        return acquisition
    a, b = (np.concatenate([pair[view] for pair in pairs]) for view in (0, 1))
    model, size = found.rigs[0], found.rigs[0].a.image_size
    as_given = agreement(model, found.lenses, (a, b))
    rows = row_gap((a, b))
    are_rectified = _rectified(rows, as_given.gap)
    if not np.isfinite(as_given.gap) or (as_given.good and not are_rectified):
        return acquisition
    if not tell_something((a, b), size[0]):
        return acquisition
    exchanged = agreement(model, found.lenses, (b, a))
    what = ", ".join(dict.fromkeys(str(path) for path in acquisition.sources[:: max(
        1, len(acquisition.sources) - 1)]))  # fmt: skip
    if exchanged.good or (as_given.in_front < 0.3 and exchanged.in_front > 0.7):
        raise InputError(
            what,
            f"left and right are exchanged: {1 - as_given.in_front:.0%} of the places that both "
            "eyes see would lie behind the endoscope",
            "give --right-first" if stacked else "give the other eye first",
        )
    if are_rectified:
        try:
            straight = read_calibration(rig, image_size=size, rectified=True)
        except InputError:
            raise InputError(
                rig,
                f"is not of these pictures, which are rectified: what both eyes see lies in one "
                f"row to {rows:.1f} px, and {as_given.gap:.1f} px off its epipolar line",
                "give a calibration with P1 and P2, or the pictures as they were recorded",
            ) from None
        note = "the pictures are rectified: P1 and P2 of the calibration are taken"
        return replace(
            acquisition, rigs=straight.rigs[:1], lenses=None,
            notes=(*acquisition.notes, *straight.notes, note),
        )  # fmt: skip
    note = (
        f"the pictures hardly agree with the calibration: what both eyes see lies "
        f"{as_given.gap:.1f} px off its epipolar line, the median over {len(a)} places"
    )
    return replace(acquisition, notes=(*acquisition.notes, note))


def _rectified(rows: float, gap: float) -> bool:
    """Whether places lie in rows, to so many px, rather than so far from their epipolar lines."""
    return rows <= 1.5 < gap or (rows < gap / 4 and gap > 1)


def _source(paths: Paths) -> Source:
    """A film, or pictures: of a list, of a folder, or one."""
    if not isinstance(paths, str | Path):
        listed = [Path(path) for path in paths]
        return Pictures(listed) if len(listed) != 1 else _source(listed[0])
    path = Path(paths)
    if not path.exists():
        raise InputError(path, "no such file or folder", "check the path")
    if path.is_dir():
        pictures = sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
        if not pictures:
            kinds = ", ".join(sorted(SUFFIXES))
            raise InputError(path, "holds no pictures", f"give a film, or one of {kinds}")
        return Pictures(pictures)
    if is_dicom(path):
        return open_dicom(path)[0]
    return Pictures([path]) if path.suffix.lower() in SUFFIXES else Film(path)


def _paired(path: Paths) -> bool:
    """Whether a DICOM file says that its frames are the left and the right eye's in turn."""
    return isinstance(path, str | Path) and is_dicom(Path(path)) and open_dicom(Path(path))[1]


def _counted(count: int, rate_hz: float | None) -> tuple[Floats, tuple[str, ...]]:
    guessed = rate_hz is None and count > 1
    note = ("no --rate was given: one frame per second is assumed",) if guessed else ()
    return np.arange(count) / (rate_hz or 1.0), note


def _files(source: Source) -> list[Path]:
    return source.paths if isinstance(source, Pictures) else [source.path]


def _frames(source: Source, numbers: Numbers) -> list[SourceFrame]:
    if isinstance(source, Pictures):
        return [SourceFrame(source.paths[number], 0) for number in numbers]
    return [SourceFrame(source.path, int(number)) for number in numbers]


def _name(source: Source) -> Path:
    return _files(source)[0]
