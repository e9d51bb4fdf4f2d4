"""A folder of pictures, or one picture, read like a film without times: `Pictures`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..acquisition import Image
from ..errors import InputError, require

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pgm"})
_MOST_SIDE = 8192


class Pictures:
    """Pictures in order of their names, (rows, columns, 3), red, green, blue.

    Parameters
    ----------
    paths : list of Path
        Not empty.

    Attributes
    ----------
    size : (int, int)
        Width and height, px, of the first one.

    Raises
    ------
    InputError
        Where the first one is no picture.
    """

    times = None

    def __init__(self, paths: list[Path]) -> None:
        self.paths, self._pillow = paths, require("PIL.Image", "endoscopy")
        self.size = self._size(paths[0])

    def __len__(self) -> int:
        return len(self.paths)

    def frame(self, number: int) -> Image:
        """Read a picture.

        Raises
        ------
        InputError
            Where it cannot be read, or has another size than the first.
        """
        path = self.paths[number]
        if (size := self._size(path)) != self.size:
            raise InputError(
                path,
                f"is {size[0]}×{size[1]} px, the first one {self.size[0]}×{self.size[1]}",
                "give pictures of one camera",
            )
        try:
            with self._pillow.open(path) as picture:
                return np.asarray(picture.convert("RGB"))
        except (OSError, SyntaxError, ValueError) as error:
            raise InputError(path, f"cannot be read ({error})", "give a whole picture") from None

    def _size(self, path: Path) -> tuple[int, int]:
        """Width and height from the header, before anything is decoded."""
        try:
            with self._pillow.open(path) as picture:
                width, height = picture.size
        except FileNotFoundError:
            raise InputError(path, "no such file", "check the path") from None
        except (OSError, SyntaxError, ValueError, self._pillow.DecompressionBombError) as error:
            raise InputError(path, f"is no picture ({error})", "give PNG, JPEG or TIFF") from None
        if max(width, height) > _MOST_SIDE:
            raise InputError(path, f"is {width}×{height} px", "give the frame of an endoscope")
        return int(width), int(height)
