"""`read_biplane`: find the two planes of one run, and join them to an `Acquisition`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

from stereosom.arrays import Floats
from stereosom.camera import Camera, StereoRig
from stereosom.observation import picture_border
from stereosom_plugin.acquisition import Acquisition, Image, SourceFrame
from stereosom_plugin.errors import InputError

from .geometry import read_cameras, read_shutter
from .header import Header, label, read_header, uid_name
from .pixels import PixelStore, open_pixels
from .timing import FrameTimes, pair_frames, read_times

XA = "1.2.840.10008.5.1.4.1.1.12.1"
OTHER_IMAGE_OF_BIPLANE_PAIR = "121314"
# A folder of a DICOM medium: study, series, objects. Deeper or fuller is not one recording.
DEEPEST, MOST_FILES = 4, 10_000

StrPath = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Plane:
    """One plane of a run, whatever kind of object it came from."""

    header: Header
    pixels: PixelStore
    cameras: tuple[Camera, ...]
    times: FrameTimes
    shutter: Floats | None
    notes: tuple[str, ...]


def read_biplane(a: StrPath | Sequence[StrPath], b: StrPath | None = None) -> Acquisition:
    """Open a biplane X-ray angiography run; its pictures stay on the disk until asked for.

    Parameters
    ----------
    a : path, or pair of paths
        A DICOM XA object, or a folder that holds exactly one biplane pair.
    b : path, optional
        The other plane. The order does not matter: the objects say which is which.

    Returns
    -------
    Acquisition
        View a is plane A. Frame `isocenter_lps`: mm, patient axes about the isocenter.
        `notes` says what had to be assumed.

    Raises
    ------
    InputError
        Where the objects are not two planes of one run, or leave their geometry open.
    """
    first, second, notes = _find_pair(a, b)
    plane_a, plane_b = _read_plane(first), _read_plane(second)
    for name, plane in (("A", plane_a), ("B", plane_b)):
        notes += [f"plane {name}: {note}" for note in plane.notes]
    frames_a, frames_b, pairing_notes = pair_frames(plane_a.times, plane_b.times)
    times = plane_a.times.seconds[frames_a]

    def read(index: int) -> tuple[Image, Image]:
        return (
            plane_a.pixels.read(int(frames_a[index])),
            plane_b.pixels.read(int(frames_b[index])),
        )

    moving = len(plane_a.cameras) > 1 or len(plane_b.cameras) > 1
    try:
        rigs = tuple(
            StereoRig(_camera(plane_a, i), _camera(plane_b, j), "isocenter_lps")
            for i, j in list(zip(frames_a, frames_b, strict=True))[: None if moving else 1]
        )
    except ValueError:
        raise InputError(
            "planes A and B", "stand in the same place", "give two different views"
        ) from None
    views = None
    if plane_a.shutter is not None or plane_b.shutter is not None:
        views = _field_of_view(plane_a), _field_of_view(plane_b)
    return Acquisition(
        read,
        rigs,
        times - times[0],
        (first.path, second.path),
        (first.text("SOPInstanceUID"), second.text("SOPInstanceUID")),
        views,
        tuple(notes + pairing_notes),
        (
            [SourceFrame(first.path, int(frame)) for frame in frames_a],
            [SourceFrame(second.path, int(frame)) for frame in frames_b],
        ),
    )


def _read_plane(header: Header) -> Plane:
    """Read a classic XA object. Another kind of object needs its own way to a `Plane`."""
    pixels = open_pixels(header)
    rows, columns = pixels.shape
    cameras, notes = read_cameras(header, (columns, rows), len(pixels))
    times, time_notes = read_times(header, len(pixels))
    notes += time_notes
    if header.value("MaskSubtractionSequence"):
        notes.append("a mask is meant to be subtracted for display; frames are taken as stored")
    return Plane(header, pixels, cameras, times, read_shutter(header, cameras[0]), tuple(notes))


def _camera(plane: Plane, frame: int) -> Camera:
    return plane.cameras[frame if len(plane.cameras) > 1 else 0]


def _field_of_view(plane: Plane) -> Floats:
    return picture_border(plane.cameras[0]) if plane.shutter is None else plane.shutter


def _find_pair(
    a: StrPath | Sequence[StrPath], b: StrPath | None
) -> tuple[Header, Header, list[str]]:
    """Headers of plane A and plane B, in this order, and notes."""
    if b is None and not isinstance(a, (str, os.PathLike)):
        if len(a) != 2:
            raise InputError("biplane run", f"{len(a)} files were given", "give two")
        a, b = a
    assert isinstance(a, (str, os.PathLike))
    if b is None:
        path = Path(a)
        if path.is_dir():
            return _pair_in_folder(path)
        _check_class(read_header(path))
        raise InputError(path, "is one plane only", "give the other one too, or their folder")
    headers = read_header(Path(a)), read_header(Path(b))
    for header in headers:
        _check_class(header)
    return _order(*headers)


def _check_class(header: Header) -> None:
    uid = header.text("SOPClassUID")
    if uid != XA:
        raise header.refuse(
            f"is {uid_name(uid)!r}, not X-Ray Angiographic Image Storage", "give two XA objects"
        )


def _order(one: Header, two: Header) -> tuple[Header, Header, list[str]]:
    """Tell plane A from plane B, or say why the two are no pair."""
    both = f"{one.path} and {two.path}"
    for keyword in ("SOPInstanceUID", "StudyInstanceUID"):
        for header in (one, two):
            if not header.text(keyword):
                raise header.missing(keyword)
    if one.text("SOPInstanceUID") == two.text("SOPInstanceUID"):
        raise InputError(both, "are the same plane twice", "give both planes")
    if one.text("StudyInstanceUID") != two.text("StudyInstanceUID"):
        raise InputError(both, "belong to different studies", "give both planes of one run")
    partners = _partners(one), _partners(two)
    for header, other, named in ((one, two, partners[0]), (two, one, partners[1])):
        if named and other.text("SOPInstanceUID") not in named:
            raise header.refuse(
                f"its other plane is another object than {other.path}",
                "give both planes of one run",
            )
    letters = _letter(one), _letter(two)
    if letters in (("A", "B"), ("A", ""), ("", "B")):
        return one, two, []
    if letters in (("B", "A"), ("B", ""), ("", "A")):
        return two, one, []
    if letters[0]:
        raise InputError(both, f"are both plane {letters[0]}", "give plane A and plane B")
    if any(partners):
        return one, two, [f"{label('ImageType')} names no plane; the first file is taken as A"]
    raise InputError(both, "nothing in them says that they are a biplane pair", "give such a pair")


def _letter(header: Header) -> str:
    """'A', 'B', or empty where Image Type does not say."""
    words = header.text("ImageType").upper().split("\\")
    return {"BIPLANE A": "A", "BIPLANE B": "B"}.get(words[2], "") if len(words) > 2 else ""


def _partners(header: Header) -> set[str]:
    """UIDs of the objects that are named as the other plane."""
    try:
        return {
            str(item.ReferencedSOPInstanceUID)
            for item in header.value("ReferencedImageSequence") or ()
            for purpose in item.get("PurposeOfReferenceCodeSequence") or ()
            if purpose.get("CodeValue") == OTHER_IMAGE_OF_BIPLANE_PAIR
        }
    except InputError:
        raise
    except Exception:  # a malformed sequence
        raise header.refuse(
            f"{label('ReferencedImageSequence')} cannot be read", "export it again"
        ) from None


def _pair_in_folder(folder: Path) -> tuple[Header, Header, list[str]]:
    headers, broken = [], []
    for path in _dicom_files(folder):
        try:
            header = read_header(path)
            if header.text("SOPClassUID") == XA:
                headers.append(header)
        except InputError as error:
            broken.append(str(error))
    pairs = []
    for one, two in combinations(headers, 2):
        try:
            pairs.append(_order(one, two))
        except InputError:
            continue
    if len(pairs) == 1:
        return pairs[0]
    listed = ", ".join(
        f"{header.path.relative_to(folder)} ({_letter(header) or 'no plane named'})"
        for header in headers[:6]
    )
    found = f"{len(headers)} X-ray angiograms" + (f": {listed}" if headers else "")
    found += ", …" if len(headers) > 6 else ""
    found += f"; not readable: {broken[0]}" if broken else ""
    wanted = "no biplane pair" if not pairs else f"{len(pairs)} possible biplane pairs"
    raise InputError(folder, f"holds {wanted} ({found})", "give the two files of one run")


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
