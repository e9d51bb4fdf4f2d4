"""A film, one picture at a time: `Film`. Times are the container's own."""

from __future__ import annotations

import os
from collections.abc import Iterator
from io import IOBase
from pathlib import Path
from typing import Any

import numpy as np

from stereosom.arrays import Floats

from ..acquisition import Image
from ..errors import InputError, require

MOST_FRAMES, MOST_SIDE = 200_000, 8192
# A picture so many frames ahead is decoded up to; farther ones are sought.
_AHEAD = 120
_CODEC = "convert it, for example: ffmpeg -i FILM -c:v libx264 -crf 12 film.mp4"


class Film:
    """Pictures of one video stream, (rows, columns, 3), red, green, blue.

    Opening it reads the index of the container (times, sizes) and decodes nothing. Frames asked
    for in order are decoded once each; to go back, the nearest key frame before is sought.

    Parameters
    ----------
    path : path
    content : file, optional
        What is read in its place, where the film is a part of it.

    Attributes
    ----------
    times : (n,) array
        Seconds, from the container, increasing.
    size : (int, int)
        Width and height, px.

    Raises
    ------
    InputError
        Where it is no film, its codec is unknown, or it is larger than any endoscope's.
    """

    def __init__(self, path: Path, content: IOBase | None = None) -> None:
        self.path, self._content = path, content
        self._av = require("av", "endoscopy")
        self._container, self._stream = self._open()
        width, height = self._stream.codec_context.width, self._stream.codec_context.height
        if not (0 < width <= MOST_SIDE and 0 < height <= MOST_SIDE):
            raise InputError(path, f"has pictures of {width}×{height} px", "give a film")
        self.size = (int(width), int(height))
        self._next = 0
        self._stamps = self._read_stamps()
        self.times: Floats = np.array(
            [float(stamp * self._stream.time_base) for stamp in self._stamps]
        )
        self._number = {stamp: number for number, stamp in enumerate(self._stamps)}
        self._rewind(0)
        self._process = os.getpid()

    def __len__(self) -> int:
        return len(self._stamps)

    def frame(self, number: int) -> Image:
        """Decode a picture.

        Raises
        ------
        InputError
            Where its bytes cannot be decoded.
        """
        if self._process != os.getpid():
            # A copy of a process (`ahead`) lacks the decoder's threads; closed, it would wait
            # for them.
            self._left = self._container, self._stream, self._frames
            self._container, self._stream = self._open()
            # Both processes have work enough: decoding frames side by side would cost a tenth more.
            self._stream.thread_type = "SLICE"
            self._process, self._next = os.getpid(), len(self) + 1
        if not self._next <= number <= self._next + _AHEAD:
            self._rewind(number)
        try:
            for frame in self._frames:
                at = self._number.get(frame.pts, self._next)
                self._next = at + 1
                if at < number:
                    continue
                if at > number:
                    break
                if (frame.width, frame.height) != self.size:
                    break
                return np.asarray(frame.to_ndarray(format="rgb24"))
        except self._av.error.FFmpegError as error:
            self._next = len(self) + 1  # what follows has to be sought
            raise InputError(
                self.path, f"frame {number} cannot be decoded ({_said(error)})", _CODEC
            ) from None
        self._next = len(self) + 1
        raise InputError(self.path, f"frame {number} cannot be decoded", _CODEC)

    def _open(self) -> tuple[Any, Any]:
        try:
            if self._content is not None:
                self._content.seek(0)
            container = self._av.open(self._content or str(self.path), metadata_errors="ignore")
        except FileNotFoundError:
            raise InputError(self.path, "no such file", "check the path") from None
        except (self._av.error.FFmpegError, OSError) as error:
            raise InputError(self.path, f"is no film ({_said(error)})", _CODEC) from None
        if not container.streams.video:
            raise InputError(self.path, "holds no pictures", "give the film, not its sound")
        stream = container.streams.video[0]
        if stream.codec_context is None:
            raise InputError(self.path, "has a codec that cannot be read", _CODEC)
        stream.thread_type = "AUTO"
        return container, stream

    def _read_stamps(self) -> list[int]:
        """Presentation times of all pictures, in order, without decoding one."""
        stamps: set[int] = set()
        try:
            for packet in self._container.demux(self._stream):
                if packet.pts is not None and packet.size and not packet.is_discard:
                    stamps.add(packet.pts)
                if len(stamps) > MOST_FRAMES:
                    raise InputError(
                        self.path, f"has more than {MOST_FRAMES} frames", "cut it into pieces"
                    )
        except self._av.error.FFmpegError as error:
            if not stamps:
                raise InputError(self.path, f"cannot be read ({_said(error)})", _CODEC) from None
        if not stamps:
            raise InputError(self.path, "holds no picture that has a time", _CODEC)
        return sorted(stamps)

    def _rewind(self, number: int) -> None:
        """Go to the key frame at or before a picture."""
        stamp = self._stamps[number]
        try:
            self._container.seek(stamp, stream=self._stream, backward=True)
        except self._av.error.FFmpegError:  # some containers cannot be sought in
            self._container.close()
            self._container, self._stream = self._open()
        self._frames: Iterator[Any] = self._container.decode(self._stream)
        self._next = max(0, number - _AHEAD)  # or anywhere before it: frames tell their times


def _said(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)[:120]
