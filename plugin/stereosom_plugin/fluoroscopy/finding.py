"""Find the two planes of one run among DICOM files: which belong together, which is which."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from stereosom_plugin.errors import InputError

from .header import Header, label, read_header, uid_name

XA = "1.2.840.10008.5.1.4.1.1.12.1"
ENHANCED_XA = "1.2.840.10008.5.1.4.1.1.12.1.1"
OTHER_IMAGE_OF_BIPLANE_PAIR = "121314"
# A folder of a DICOM medium: study, series, objects. Deeper or fuller is not one recording.
DEEPEST, MOST_FILES = 4, 10_000
MOST_RUNS = 1000


@dataclass(frozen=True, eq=False)
class Stack:
    """The frames of one plane: one file with all of them, or files with one each, in order."""

    headers: tuple[Header, ...]
    letter: str

    @property
    def name(self) -> str:
        """How to call it in a message."""
        more = len(self.headers) - 1
        return str(self.headers[0].path) + (f" and {more} more files" if more else "")

    def texts(self, keyword: str) -> set[str]:
        """The different values of an element in its files."""
        return {header.text(keyword) for header in self.headers}


@dataclass(frozen=True, eq=False)
class Found:
    """What was found: plane A and plane B, or one file that may hold the frames of both."""

    a: Stack
    b: Stack | None
    notes: tuple[str, ...] = ()


def find_planes(paths: Sequence[Path]) -> Found:
    """Find the planes of one run in files and folders.

    Raises
    ------
    InputError
        Where they hold no run, more than one, or planes that do not belong together.
    """
    if not paths:
        raise InputError("biplane run", "0 files were given", "give both planes or their folder")
    if len(paths) == 1 and paths[0].is_dir():
        return _find_in_folder(paths[0])
    single = len(paths) == 2 and not any(path.is_dir() for path in paths)
    files = [file for path in paths for file in (_dicom_files(path) if path.is_dir() else [path])]
    headers = [read_header(file) for file in (files if single else dict.fromkeys(files))]
    for header in headers:
        _check_class(header)
    if single:  # the user's word counts: these two, in this order where they do not say it
        return _order(*(Stack((header,), plane_letter(header)) for header in headers))
    stacks = _stacks(headers)
    if len(stacks) == 1:
        return Found(stacks[0], None)
    if len(stacks) == 2:
        return _order(*stacks)
    raise InputError(
        "the files given",
        f"make {len(stacks)} runs or planes ({_listed(stacks, None)})",
        "give those of one biplane run",
    )


def plane_letter(header: Header) -> str:
    """'A', 'B', or empty where an object or a frame does not say which plane it is of."""
    identified = header.text("PlaneIdentification").upper()
    for keyword in ("FrameType", "ImageType"):
        words = header.text(keyword).upper().split("\\")
        spelled = words[2] if len(words) > 2 else ""
        for letter in "AB":
            if spelled == f"BIPLANE {letter}" or identified == f"PLANE {letter}":
                return letter
    return ""


def _find_in_folder(folder: Path) -> Found:
    headers, broken = [], []
    for path in _dicom_files(folder):
        try:
            header = read_header(path)
            if header.text("SOPClassUID") in (XA, ENHANCED_XA):
                headers.append(header)
        except InputError as error:
            broken.append(str(error))
    stacks = _stacks(headers)
    by_study = defaultdict(list)
    for stack in stacks:
        by_study[stack.headers[0].text("StudyInstanceUID")].append(stack)
    found = []
    for stacks_of_study in by_study.values():
        for one, two in combinations(stacks_of_study, 2):
            try:
                found.append(_order(one, two))
            except InputError:
                continue
    if len(found) == 1:
        return found[0]
    if not found and len(stacks) == 1 and not broken and _may_hold_both(stacks[0]):
        return Found(stacks[0], None)
    count = f"{len(headers)} X-ray angiograms" + (f": {_listed(stacks, folder)}" if stacks else "")
    count += f"; not readable: {broken[0]}" if broken else ""
    wanted = "no biplane pair" if not found else f"{len(found)} possible biplane pairs"
    raise InputError(folder, f"holds {wanted} ({count})", "give the two files of one run")


def _may_hold_both(stack: Stack) -> bool:
    """Whether a lone stack is worth a look for a second plane: it names none."""
    return stack.letter == "" and (len(stack.headers) > 1 or _frames(stack.headers[0]) > 1)


def _frames(header: Header) -> int:
    try:
        return header.whole("NumberOfFrames", 1)
    except InputError:
        return 1


def _stacks(headers: Iterable[Header]) -> list[Stack]:
    """Files with one frame each, of one series and plane, make one stack; others one each."""
    series: dict[tuple[str, ...], list[Header]] = defaultdict(list)
    for header in headers:
        key: tuple[str, ...] = (str(header.path),)
        if _frames(header) == 1 and header.text("SeriesInstanceUID"):
            key = ("", *map(header.text, ("StudyInstanceUID", "SeriesInstanceUID")))
            key = (*key, plane_letter(header))
        series[key].append(header)
    if len(series) > MOST_RUNS:
        raise InputError("these files", f"make more than {MOST_RUNS} runs", "give one run's files")
    return [
        Stack(tuple(sorted(files, key=_place)), plane_letter(files[0])) for files in series.values()
    ]


def _place(header: Header) -> tuple[float, str, str]:
    """Where a file stands in its series."""
    try:
        number = header.number("InstanceNumber")
    except InputError:
        number = None
    return (float("inf") if number is None else number, _time(header), str(header.path))


def _time(header: Header) -> str:
    return header.text("AcquisitionDateTime") or header.text("AcquisitionTime")


def _check_class(header: Header) -> None:
    uid = header.text("SOPClassUID")
    if uid not in (XA, ENHANCED_XA):
        raise header.refuse(
            f"is {uid_name(uid)!r}, not X-Ray Angiographic Image Storage"
            if uid
            else f"has no {label('SOPClassUID')}",
            "give two XA objects",
        )


def _order(one: Stack, two: Stack) -> Found:
    """Tell plane A from plane B, or say why the two are no pair."""
    both = f"{one.name} and {two.name}"
    for keyword in ("SOPInstanceUID", "StudyInstanceUID"):
        for stack in (one, two):
            if "" in stack.texts(keyword):
                raise stack.headers[0].missing(keyword)
    own = one.texts("SOPInstanceUID"), two.texts("SOPInstanceUID")
    if own[0] & own[1]:
        raise InputError(both, "are the same plane twice", "give both planes")
    if one.texts("StudyInstanceUID") != two.texts("StudyInstanceUID"):
        raise InputError(both, "belong to different studies", "give both planes of one run")
    partners = _partners(one), _partners(two)
    for stack, other, named, others in (
        (one, two, partners[0], own[1]),
        (two, one, partners[1], own[0]),
    ):
        if named and not named & others:
            raise stack.headers[0].refuse(
                f"its other plane is another object than {other.name}",
                "give both planes of one run",
            )
    letters = one.letter, two.letter
    if letters in (("A", "B"), ("A", ""), ("", "B")):
        return Found(one, two)
    if letters in (("B", "A"), ("B", ""), ("", "A")):
        return Found(two, one)
    if letters[0]:
        raise InputError(both, f"are both plane {letters[0]}", "give plane A and plane B")
    if any(partners):
        note = f"{label('ImageType')} names no plane; the first file is taken as A"
        return Found(one, two, (note,))
    raise InputError(both, "nothing in them says that they are a biplane pair", "give such a pair")


def _partners(stack: Stack) -> set[str]:
    """UIDs of the objects that are named as the other plane."""
    named = set()
    for header in stack.headers:
        for item in header.items("ReferencedImageSequence"):
            purposes = item.items("PurposeOfReferenceCodeSequence")
            if any(code.text("CodeValue") == OTHER_IMAGE_OF_BIPLANE_PAIR for code in purposes):
                named.add(item.text("ReferencedSOPInstanceUID"))
        for item in header.items("ReferencedOtherPlaneSequence"):
            named.add(item.text("ReferencedSOPInstanceUID"))
    return named - {""}


def _listed(stacks: Sequence[Stack], folder: Path | None) -> str:
    listed = [
        f"{stack.headers[0].path.relative_to(folder) if folder else stack.name} "
        f"({stack.letter or 'no plane named'})"
        for stack in stacks[:6]
    ]
    return ", ".join(listed) + (", …" if len(stacks) > 6 else "")


def _dicom_files(folder: Path) -> list[Path]:
    """Files that bear the DICOM mark, in order of name."""
    files = []
    for parent, folders, names in os.walk(folder):
        folders.sort()
        if len(Path(parent).relative_to(folder).parts) >= DEEPEST:
            folders.clear()
        files += [Path(parent, name) for name in sorted(names)]
        if len(files) > MOST_FILES:
            raise InputError(folder, f"holds more than {MOST_FILES} files", "give the two files")
    return [path for path in files if path.is_file() and _marked(path)]


def _marked(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            file.seek(128)
            return file.read(4) == b"DICM"
    except OSError:
        return False
