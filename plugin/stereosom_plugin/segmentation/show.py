"""A picture of what was segmented: both views of a frame, each with the outline of its mask."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stereosom_plugin.acquisition import FramePair
from stereosom_plugin.errors import require
from stereosom_plugin.files import write_whole

from .outline import outline
from .picture import Mask

COLOR = (255, 170, 0)


def picture_name(frame: int) -> str:
    """Name of the picture of a frame."""
    return f"segmentation_{frame:04d}.png"


class MaskPictures:
    """Writes a picture of both masks of each frame into a folder.

    Parameters
    ----------
    folder : path
        Where `segmentation_0000.png`, … go; it must exist.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def __call__(self, index: int, pair: FramePair, mask_a: Mask, mask_b: Mask) -> None:
        """Write one frame; fits `show` of `observe`."""
        parts = [outlined(pair.image_a, mask_a), outlined(pair.image_b, mask_b)]
        height = max(part.shape[0] for part in parts)
        parts = [np.pad(part, ((0, height - len(part)), (0, 0), (0, 0))) for part in parts]
        picture = require("PIL.Image", "fluoroscopy").fromarray(np.hstack(parts))
        with write_whole(self.folder / picture_name(index)) as path:
            picture.save(path)


def outlined(image: Any, mask: Any) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """A gray picture with the outline of a mask in color, (rows, columns, 3).

    Parameters
    ----------
    image : (rows, columns) array
    mask : (rows, columns) array of bool
    """
    gray = np.asarray(image, dtype=np.float32)
    low, high = np.percentile(gray[::4, ::4], [0.5, 99.5])
    gray = np.clip((gray - low) / max(high - low, 1e-6), 0, 1) * 255
    picture = require("PIL.Image", "fluoroscopy").fromarray(gray.astype(np.uint8)).convert("RGB")
    pen = require("PIL.ImageDraw", "fluoroscopy").Draw(picture)
    for line in outline(mask):
        pen.line([tuple(point) for point in line], fill=COLOR, width=1)
    return np.asarray(picture)
