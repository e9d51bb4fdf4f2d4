"""A plane's pictures: where each frame's bytes lie in the file, and one frame decoded at a time."""

from __future__ import annotations

import struct
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from stereosom_plugin.acquisition import Image
from stereosom_plugin.errors import InputError

from .codec import CodecError, decode_with_simpleitk
from .header import Header, pydicom, uid_name

UNCOMPRESSED = ("1.2.840.10008.1.2", "1.2.840.10008.1.2.1")
RLE = "1.2.840.10008.1.2.5"
JPEG_FAMILY = tuple(f"1.2.840.10008.1.2.4.{n}" for n in (50, 51, 57, 70, 80, 81, 90, 91))

# What is bounded before anything is decoded: a header can promise any size.
MOST_PIXELS_A_SIDE = 8192
MOST_FRAMES = 10_000
MOST_BYTES = 2 << 30

ITEM, SEQUENCE_END, UNDEFINED = 0xFFFEE000, 0xFFFEE0DD, 0xFFFFFFFF

Span = tuple[int, int]  # first byte, number of bytes


@dataclass(frozen=True, eq=False)
class PixelStore:
    """The frames of one file; nothing is read before `read`, and nothing is kept.

    Parameters
    ----------
    path : Path
    transfer_syntax : str
        Its UID.
    shape : (int, int)
        Rows and columns.
    bits : (int, int)
        Bits allocated (8 or 16) and bits stored.
    signed : bool
        Whether numbers are signed.
    spans : tuple of tuple of (int, int)
        Per frame, where its pieces lie in the file: first byte, number of bytes.
    """

    path: Path
    transfer_syntax: str
    shape: tuple[int, int]
    bits: tuple[int, int]
    signed: bool
    spans: tuple[tuple[Span, ...], ...]

    def __len__(self) -> int:
        return len(self.spans)

    def read(self, index: int) -> Image:
        """Read one frame, (rows, columns), 8 or 16 bits, as it was stored.

        Raises
        ------
        InputError
            Where this frame is broken; others may be well.
        """
        data = b""
        try:
            with self.path.open("rb") as file:
                for first, length in self.spans[index]:
                    file.seek(first)
                    data += file.read(length)
            raw = self._decode(data)
        except (CodecError, OSError) as error:
            raise self._broken(index, str(error)) from None
        if raw.dtype.itemsize * 8 != self.bits[0] or raw.shape != self.shape:
            raise self._broken(index, f"holds {raw.shape} {raw.dtype}, not {self.shape}")
        return self._values(raw)

    def _decode(self, data: bytes) -> npt.NDArray[Any]:
        if self.transfer_syntax in UNCOMPRESSED:
            raw = np.frombuffer(data, dtype=f"<u{self.bits[0] // 8}")
            if raw.size != self.shape[0] * self.shape[1]:
                raise CodecError("the file ends within it")
            return raw.reshape(self.shape)
        frame = self._one_frame_dataset(data)
        if self.transfer_syntax != RLE:
            stream = BytesIO()
            frame.save_as(stream, enforce_file_format=True)
            return decode_with_simpleitk(stream.getvalue())
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                # pydicom's own decoder: others that may be installed can kill the interpreter.
                return np.asarray(pydicom.pixels.pixel_array(frame, decoding_plugin="pydicom"))
        except Exception as error:  # it raises many kinds on broken data
            raise CodecError(str(error).partition("\n")[0]) from None

    def _one_frame_dataset(self, data: bytes) -> Any:
        """Wrap one frame's bytes so that a decoder meets nothing else of the file."""
        frame = pydicom.Dataset()
        frame.file_meta = pydicom.dataset.FileMetaDataset()
        frame.file_meta.TransferSyntaxUID = self.transfer_syntax
        # Secondary Capture: a class of which no decoder expects geometry.
        frame.file_meta.MediaStorageSOPClassUID = frame.SOPClassUID = "1.2.840.10008.5.1.4.1.1.7"
        frame.file_meta.MediaStorageSOPInstanceUID = frame.SOPInstanceUID = "1.2.3"
        frame.Rows, frame.Columns = self.shape
        frame.BitsAllocated, frame.BitsStored = self.bits
        frame.HighBit = self.bits[1] - 1
        frame.PixelRepresentation = int(self.signed)
        frame.SamplesPerPixel = 1
        frame.PhotometricInterpretation = "MONOCHROME2"
        frame.PixelData = pydicom.encaps.encapsulate([data])
        frame["PixelData"].VR = "OB"
        frame["PixelData"].is_undefined_length = True
        return frame

    def _values(self, raw: npt.NDArray[Any]) -> Image:
        """Drop what lies above the stored bits, extend the sign."""
        allocated, stored = self.bits
        unused = allocated - stored
        kind = "i" if self.signed else "u"
        values = (raw.view(f"u{allocated // 8}") << unused).view(f"{kind}{allocated // 8}")
        return np.asarray(values >> unused)

    def _broken(self, index: int, why: str) -> InputError:
        return InputError(f"{self.path}, frame {index}", why, "leave this frame out")


def open_pixels(header: Header) -> PixelStore:
    """Find each frame in the file without reading any.

    Raises
    ------
    InputError
        Where the pixels cannot be read, are too many, or are fewer than promised.
    """
    rows, columns = header.whole("Rows"), header.whole("Columns")
    frames = header.whole("NumberOfFrames", 1)
    allocated = header.whole("BitsAllocated")
    stored = header.whole("BitsStored", allocated)
    photometric = header.text("PhotometricInterpretation")
    if header.whole("SamplesPerPixel", 1) != 1 or not photometric.startswith("MONOCHROME"):
        raise header.refuse("its picture is not a gray one", "give the original XA objects")
    if (
        allocated not in (8, 16)
        or not 1 <= stored <= allocated
        or header.whole("HighBit", stored - 1) != stored - 1
    ):
        raise header.refuse("its pixels are laid out in no way that XA allows", "convert it")
    size = rows * columns * allocated // 8
    if min(rows, columns, frames) < 1:
        raise header.refuse(f"promises {frames} frames of {columns}×{rows}", "export it again")
    if (
        max(rows, columns) > MOST_PIXELS_A_SIDE
        or frames > MOST_FRAMES
        or size * frames > MOST_BYTES
    ):
        raise header.refuse(
            f"promises {frames} frames of {columns}×{rows}, more than is read "
            f"({MOST_FRAMES} frames, {MOST_PIXELS_A_SIDE} pixels a side, 2 GiB)",
            "export a shorter run",
        )
    with header.path.open("rb") as file:
        compressed = seek_pixels(header, file, (*UNCOMPRESSED, RLE, *JPEG_FAMILY))
        if compressed:
            spans = compressed_spans(header, file, frames, size)
        else:
            spans = uncompressed_spans(header, file, frames, size)
    return PixelStore(
        header.path,
        header.transfer_syntax,
        (rows, columns),
        (allocated, stored),
        header.whole("PixelRepresentation", 0) == 1,
        spans,
    )


def seek_pixels(header: Header, file: BinaryIO, syntaxes: tuple[str, ...]) -> bool:
    """Move to Pixel Data, where it is in one of these syntaxes; say whether it is compressed."""
    syntax = header.transfer_syntax
    if syntax not in syntaxes:
        raise header.refuse(
            f"its transfer syntax, {uid_name(syntax)!r}, is not read", "store it uncompressed"
        )
    file.seek(header.pixel_position)
    group, element = struct.unpack("<HH", file.read(4).ljust(4, b"\0"))
    if (group, element) != (0x7FE0, 0x0010):
        raise header.refuse("holds no pixels", "export the object with its pictures")
    return syntax not in UNCOMPRESSED


def _pixel_length(header: Header, file: BinaryIO) -> int:
    implicit = header.transfer_syntax == UNCOMPRESSED[0]
    data = file.read(4 if implicit else 8).ljust(4, b"\0")
    return int(struct.unpack("<I", data[-4:])[0])


def uncompressed_spans(
    header: Header, file: BinaryIO, frames: int, size: int
) -> tuple[tuple[Span, ...], ...]:
    """Where each frame of so many bytes lies, from the place that `seek_pixels` moved to."""
    length = _pixel_length(header, file)
    first = file.tell()
    present = min(length, file.seek(0, 2) - first)
    if present < frames * size:
        raise header.refuse(
            f"is truncated: {present} bytes of pixels, {frames} frames need {frames * size}",
            "copy or export it again",
        )
    # A pad byte or two do no harm; a row more says that rows, columns or frames are wrong.
    row = size // header.whole("Rows")
    if length != UNDEFINED and length - frames * size >= max(row, 2):
        raise header.refuse(
            f"holds {length} bytes of pixels, but {frames} frames take {frames * size}",
            "correct Rows, Columns or NumberOfFrames",
        )
    return tuple(((first + index * size, size),) for index in range(frames))


def compressed_spans(
    header: Header, file: BinaryIO, frames: int, size: int
) -> tuple[tuple[Span, ...], ...]:
    """Group the fragments to frames: by the offset table, else by count, else by their starts."""
    if _pixel_length(header, file) != UNDEFINED:
        raise header.refuse("its compressed pixels are not in fragments", "export it again")
    first = file.tell()
    table, *fragments = _items(header, file)
    file.seek(table[0])
    count = min(table[1] // 4, MOST_FRAMES)
    offsets = struct.unpack(f"<{count}I", file.read(4 * count))
    begin = table[0] + table[1]
    positions = [position - 8 - begin for position, _ in fragments]
    if len(fragments) == frames:
        starts = list(range(frames))
    elif frames == 1:
        starts = [0]
    elif len(offsets) == frames and set(offsets) <= set(positions):
        starts = [positions.index(offset) for offset in offsets]
    else:
        starts = [i for i, span in enumerate(fragments) if _begins_picture(file, span)]
    if len(starts) != frames or not fragments or starts[0] != 0 or sorted(set(starts)) != starts:
        raise header.refuse(
            f"promises {frames} frames and holds {len(fragments)} pieces after byte {first}, "
            "which do not make them",
            "copy or export it again",
        )
    ends = [*starts[1:], len(fragments)]
    spans = tuple(tuple(fragments[i:j]) for i, j in zip(starts, ends, strict=True))
    # No codec makes a picture much larger than it is.
    if max(sum(length for _, length in frame) for frame in spans) > 4 * size + (1 << 20):
        raise header.refuse("a compressed frame is larger than its picture", "export it again")
    return spans


def fragments(header: Header, file: BinaryIO) -> tuple[Span, ...]:
    """Where the pieces of a film lie, from the place that `seek_pixels` moved to."""
    if _pixel_length(header, file) != UNDEFINED:
        raise header.refuse("its film is not in fragments", "export it again")
    _, *pieces = _items(header, file)
    return tuple(pieces)


def _items(header: Header, file: BinaryIO) -> Iterator[Span]:
    """Offset table, then every fragment: only their headers are read."""
    begin = file.tell()
    end = file.seek(0, 2)
    position = begin
    while True:
        file.seek(position)
        group, element, length = struct.unpack("<HHI", file.read(8).ljust(8, b"\0"))
        tag = group << 16 | element
        # A missing end mark is forgiven: whether all frames are there is judged by count.
        if tag == SEQUENCE_END or (position >= end and position > begin):
            return
        if tag != ITEM or position + 8 + length > end:
            raise header.refuse(
                f"is truncated or torn at byte {position} of its {end}", "copy or export it again"
            )
        yield position + 8, length
        position += 8 + length


def _begins_picture(file: BinaryIO, span: Span) -> bool:
    """Whether a fragment begins a JPEG or a JPEG 2000 picture."""
    file.seek(span[0])
    return file.read(2) in (b"\xff\xd8", b"\xff\x4f")
