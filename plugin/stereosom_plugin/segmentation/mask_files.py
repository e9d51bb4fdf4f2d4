"""Masks of a run that are files already: two folders, one per view."""

from __future__ import annotations

import hashlib
from pathlib import Path

from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.errors import InputError
from stereosom_plugin.masks import read_masks

from .binary import binary
from .picture import Mask


class MaskFiles:
    """Stands in for a segmentation: it is asked for the masks of a frame by its number.

    Parameters
    ----------
    a, b : path
        Folders of mask pictures, white on the device, in order of their names; or a file each,
        where the run has but one frame.
    run : Acquisition
        Whose masks they are: they must have its frames and its pictures' sizes.

    Raises
    ------
    InputError
        Where they do not go with the run.
    """

    def __init__(self, a: str | Path, b: str | Path, run: Acquisition) -> None:
        self._pictures = read_masks(a, b, run.rigs[:1])
        count = len(self._pictures)
        if count != len(run):
            raise InputError(
                f"{a}, {b}",
                f"hold {count} masks a view, the run has {len(run)} frames",
                "give a mask per frame, an empty one where nothing is to be seen",
            )
        self.named = [str(Path(one).resolve()) for one in (a, b)]

    @property
    def digest(self) -> str:
        """SHA-256 of all files, in order."""
        total = hashlib.sha256()
        for path in self._pictures.sources:
            total.update(hashlib.sha256(path.read_bytes()).digest())
        return total.hexdigest()

    def masks(self, frame: int) -> tuple[Mask, Mask]:
        """Of view a and view b.

        Raises
        ------
        InputError
            Where the frame's files are no masks.
        """
        image_a, image_b = self._pictures.read(frame)
        return binary(image_a), binary(image_b)
