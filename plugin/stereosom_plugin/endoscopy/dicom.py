"""DICOM video endoscopy: a film inside, or pictures in color, read one at a time."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from stereosom.arrays import Floats

from ..acquisition import Image
from ..errors import InputError, require
from ..fluoroscopy.header import Header, read_header
from ..fluoroscopy.pixels import (
    MOST_BYTES,
    MOST_FRAMES,
    MOST_PIXELS_A_SIDE,
    UNCOMPRESSED,
    Span,
    compressed_spans,
    fragments,
    seek_pixels,
    uncompressed_spans,
)
from ..fluoroscopy.timing import read_times
from .film import Film

JPEG_BASELINE = "1.2.840.10008.1.2.4.50"
# MPEG-2, H.264 and H.265, all profiles and levels of them.
FILMS = tuple(f"1.2.840.10008.1.2.4.{number}" for number in range(100, 109))


def is_dicom(path: Path) -> bool:
    """Whether a file is DICOM, by its mark."""
    try:
        with path.open("rb") as file:
            return file.read(132)[128:] == b"DICM"
    except OSError:
        return False


def open_dicom(path: Path) -> tuple[Film | ColorFrames, bool]:
    """The pictures of a DICOM file, and whether they are stereo pairs, left before right.

    Raises
    ------
    InputError
        Where it cannot be read, or is packed in a way that endoscopes do not use.
    """
    header = read_header(path)
    paired = header.text("StereoPairsPresent").upper() == "YES"
    if header.transfer_syntax in FILMS:
        with path.open("rb") as file:
            seek_pixels(header, file, FILMS)
            spans = fragments(header, file)
        return Film(path, _Pieces(path, spans)), paired
    return ColorFrames(header), paired


class ColorFrames:
    """The pictures of a multi-frame object, (rows, columns, 3), red, green, blue.

    Attributes
    ----------
    times : (n,) array
        Seconds.
    size : (int, int)
        Width and height, px.

    Raises
    ------
    InputError
        Where its pixels are laid out otherwise.
    """

    def __init__(self, header: Header) -> None:
        self.path, self._syntax = header.path, header.transfer_syntax
        rows, columns = header.whole("Rows"), header.whole("Columns")
        frames = header.whole("NumberOfFrames", 1)
        size = rows * columns * 3
        if (
            min(rows, columns, frames) < 1
            or max(rows, columns) > MOST_PIXELS_A_SIDE
            or frames > MOST_FRAMES
            or size * frames > MOST_BYTES
        ):
            raise header.refuse(f"promises {frames} frames of {columns}×{rows}", "export it again")
        if header.whole("SamplesPerPixel", 1) != 3 or header.whole("BitsAllocated") != 8:
            raise header.refuse("its pictures are not in color of 8 bits", "convert it")
        if self._syntax in UNCOMPRESSED and header.text("PhotometricInterpretation") != "RGB":
            raise header.refuse("its colors are not red, green, blue", "convert it")
        by_plane = header.whole("PlanarConfiguration", 0) == 1
        self._by_plane = by_plane and self._syntax in UNCOMPRESSED
        self.size, self._shape = (columns, rows), (rows, columns)
        with header.path.open("rb") as file:
            if seek_pixels(header, file, (*UNCOMPRESSED, JPEG_BASELINE)):
                self._spans = compressed_spans(header, file, frames, size)
            else:
                self._spans = uncompressed_spans(header, file, frames, size)
        self.times: Floats = read_times([header] * frames)[0].seconds

    def __len__(self) -> int:
        return len(self._spans)

    def frame(self, number: int) -> Image:
        """Read a picture.

        Raises
        ------
        InputError
            Where its bytes cannot be decoded.
        """
        data = _Pieces(self.path, self._spans[number]).read()
        rows, columns = self._shape
        if self._syntax in UNCOMPRESSED:
            values = np.frombuffer(data, dtype=np.uint8)
            if values.size != rows * columns * 3:
                raise InputError(self.path, f"ends within frame {number}", "copy it again")
            if self._by_plane:
                return np.moveaxis(values.reshape(3, rows, columns), 0, -1)
            return values.reshape(rows, columns, 3)
        pillow = require("PIL.Image", "endoscopy")
        try:
            with pillow.open(io.BytesIO(data), formats=["JPEG"]) as picture:
                if picture.size != self.size:
                    raise ValueError(f"it is {picture.size[0]}×{picture.size[1]} px")
                return np.asarray(picture.convert("RGB"))
        except (OSError, SyntaxError, ValueError, pillow.DecompressionBombError) as error:
            raise InputError(
                self.path, f"frame {number} cannot be decoded ({error})", "export it again"
            ) from None


class _Pieces(io.RawIOBase):
    """Stretches of a file, one after the other, as a file."""

    def __init__(self, path: Path, spans: tuple[Span, ...]) -> None:
        self._file, self._spans, self._at = path.open("rb"), spans, 0
        self._starts = np.concatenate([[0], np.cumsum([length for _, length in spans])])

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: int(self._starts[-1])}[whence]
        self._at = max(base + offset, 0)
        return self._at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: Any) -> int:
        piece = int(np.searchsorted(self._starts, self._at, side="right")) - 1
        if piece >= len(self._spans):
            return 0
        within = self._at - int(self._starts[piece])
        self._file.seek(self._spans[piece][0] + within)
        data = self._file.read(min(len(buffer), self._spans[piece][1] - within))
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        self._file.close()
        super().close()
