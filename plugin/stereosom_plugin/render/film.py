"""Films: MP4 (H.264, which every browser plays) and GIF, a frame at a time."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, require
from ..files import write_whole
from .style import Picture

SUFFIXES = (".mp4", ".gif")
_H264_OPTIONS = {"crf": "18", "preset": "veryfast"}
# As ITU-R BT.709 numbers itself in H.264, annex E: players else guess by the picture's size.
_BT709 = 1


def write_film(pictures: Iterable[Picture], path: str | Path, fps: float) -> int:
    """Write pictures as they come; none is kept. Returns how many there were.

    Parameters
    ----------
    pictures : iterable of (rows, columns, 3) arrays of bytes
        All of one size; for MP4 an even one.
    path : path
        A `.mp4` or `.gif`, written whole or not at all.
    fps : float
        Pictures per second.

    Raises
    ------
    InputError
        Where the file cannot be written, the size is odd, or there are no pictures.
    ImportError
        Where PyAV is missing; it names the extra.
    """
    av = require("av", "vtk")
    count, rate = 0, Fraction(fps).limit_denominator(1000)
    with write_whole(path) as part:
        try:
            # A thread encodes one picture while the next is drawn; it has no more than one.
            with (
                av.open(str(part), "w", format=part.suffix[1:].lower()) as container,
                ThreadPoolExecutor(1) as beside,
            ):
                writer: Any = None
                added: Future[None] | None = None
                for picture in pictures:
                    if added is None:
                        kind = _Mp4 if part.suffix.lower() == ".mp4" else _Gif
                        writer = kind(container, picture.shape[1], picture.shape[0], rate)
                    else:
                        added.result()
                    added = beside.submit(writer.add, np.ascontiguousarray(picture), count)
                    count += 1
                if added is None:
                    raise InputError(path, "would have no pictures", "give a run with frames")
                added.result()
                writer.end()
        except av.error.FFmpegError as error:
            raise OSError(error.errno, error.strerror) from error
    return count


def check_even(size: tuple[int, int]) -> None:
    """Refuse a size that H.264 cannot have: it keeps one color per two by two pixels.

    Raises
    ------
    InputError
        Where width or height is odd.
    """
    width, height = size
    if width % 2 or height % 2:
        raise InputError(
            f"{width}x{height}",
            "is odd, and an MP4 has an even width and height",
            f"give --size {width - width % 2}x{height - height % 2}",
        )


class _Mp4:
    def __init__(self, container: Any, width: int, height: int, rate: Fraction) -> None:
        check_even((width, height))
        self._av, self._container = require("av", "vtk"), container
        self._stream = container.add_stream("libx264", rate=rate, options=_H264_OPTIONS)
        context = self._stream.codec_context
        context.width, context.height, context.pix_fmt = width, height, "yuv420p"
        context.color_primaries = context.color_trc = context.colorspace = _BT709
        self._reformat = {"format": "yuv420p", "dst_colorspace": "ITU709"}

    def add(self, picture: Picture, number: int) -> None:
        frame = self._av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame = frame.reformat(**self._reformat)
        frame.pts = number
        frame.time_base = 1 / self._stream.codec_context.framerate
        self._container.mux(self._stream.encode(frame))

    def end(self) -> None:
        self._container.mux(self._stream.encode())


class _Gif:
    """Every picture gets its own 256 colors, so that none has to wait for the last one."""

    def __init__(self, container: Any, width: int, height: int, rate: Fraction) -> None:
        self._av, self._container = require("av", "vtk"), container
        self._stream = container.add_stream("gif", rate=rate)
        context = self._stream.codec_context
        context.width, context.height, context.pix_fmt = width, height, "pal8"
        self._graph = graph = self._av.filter.Graph()
        source = graph.add_buffer(width=width, height=height, format="rgb24", time_base=1 / rate)
        split = graph.add("split")
        palette = graph.add("palettegen", "stats_mode=single")
        use = graph.add("paletteuse", "new=1:dither=none")
        sink = graph.add("buffersink")
        source.link_to(split)
        split.link_to(use, 0, 0)
        split.link_to(palette, 1, 0)
        palette.link_to(use, 0, 1)
        use.link_to(sink)
        graph.configure()
        self._time_base = 1 / rate

    def add(self, picture: Picture, number: int) -> None:
        frame = self._av.VideoFrame.from_ndarray(picture, format="rgb24")
        frame.pts, frame.time_base = number, self._time_base
        self._graph.push(frame)
        self._drain()

    def end(self) -> None:
        self._graph.push(None)
        self._drain()
        self._container.mux(self._stream.encode())

    def _drain(self) -> None:
        while True:
            try:
                frame = self._graph.pull()
            except (self._av.error.BlockingIOError, self._av.error.EOFError):
                return
            self._container.mux(self._stream.encode(frame))
