"""`Calibration`: what every format becomes; `View`: one camera on the way there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from stereosom.arrays import Floats, check_array, check_image_size
from stereosom.camera import Camera, Frame, StereoRig

from ..lens import FisheyeLens, Lens, RadialTangentialLens

MM_PER = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}


@dataclass(frozen=True, eq=False)
class Calibration:
    """The geometry of both views, as it was read.

    Parameters
    ----------
    rigs : tuple of StereoRig
        One, or one per frame where the geometry moves; mm.
    lenses : pair of Lens, optional
        Of view a and view b. None: the pictures are those of ideal cameras.
    source : str
        The format that was recognized.
    notes : tuple of str
        What was assumed or looks wrong, one sentence each, for the user to read.
    """

    rigs: tuple[StereoRig, ...]
    lenses: tuple[Lens, Lens] | None
    source: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class View:
    """One camera as a file describes it: s (x, y, 1) = K (R X + t) for the ideal picture.

    Parameters
    ----------
    intrinsics, rotation : (3, 3) array
        K, px; R, world axes to camera axes.
    translation : (3,) array
        t, in the file's units.
    size : (int, int), optional
        Width and height, px, where the file says them.
    lens : Lens, optional
    """

    intrinsics: Any
    rotation: Any
    translation: Any
    size: tuple[int, int] | None = None
    lens: Lens | None = None

    def __post_init__(self) -> None:
        for name, shape in (("intrinsics", (3, 3)), ("rotation", (3, 3)), ("translation", (3,))):
            values = getattr(self, name)
            if name == "translation":
                values = np.ravel(values)
            object.__setattr__(self, name, check_array(values, name, shape))
        gap = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if gap > 1e-3 or np.linalg.det(self.rotation) < 0:
            raise ValueError("rotation: is none (its rows are no right-handed unit vectors)")
        k = self.intrinsics
        if k[0, 0] <= 0 or k[1, 1] == 0 or np.any(k[2] != [0, 0, 1]) or k[1, 0] != 0:
            raise ValueError("intrinsics: must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]]")

    def camera(self, mm_per_unit: float, size: tuple[int, int]) -> Camera:
        """The ideal camera."""
        return Camera.from_pose(
            self.intrinsics, self.rotation, self.translation * mm_per_unit, size
        )


def lens_of(intrinsics: Any, coefficients: Any, fisheye: bool = False) -> Lens | None:
    """The lens of OpenCV's coefficients; None where all are zero and nothing bends."""
    given: Floats = check_array(np.ravel(coefficients), "distortion", (None,))
    if fisheye:
        return FisheyeLens(intrinsics, given)
    if not given.any():
        return None
    return RadialTangentialLens(intrinsics, given)


def assemble(
    a: View,
    b: View,
    source: str,
    *,
    units: str = "mm",
    image_size: tuple[int, int] | None = None,
    frame: Frame = "camera_a",
    notes: Sequence[str] = (),
) -> Calibration:
    """Make a calibration of two views.

    Parameters
    ----------
    units : {'mm', 'cm', 'm', 'in'}
        Of the translations.
    image_size : (int, int), optional
        Taken where the file says none; where it says another one, that is an error.

    Raises
    ------
    ValueError
        Where a size is missing or contradicts, or the cameras make no rig.
    """
    sizes = [checked_size(view.size, image_size) for view in (a, b)]
    camera_a, camera_b = (
        view.camera(MM_PER[units], size) for view, size in zip((a, b), sizes, strict=True)
    )
    rig = StereoRig(camera_a, camera_b, frame)
    return Calibration((rig,), pair_of(a.lens, b.lens), source, tuple(notes))


def checked_size(said: tuple[int, int] | None, wanted: tuple[int, int] | None) -> tuple[int, int]:
    """The picture's size, from the file or the caller, who must not contradict each other."""
    if said is None and wanted is None:
        raise ValueError("says no picture size; give it with --image-size WIDTHxHEIGHT")
    if said is not None and wanted is not None and tuple(said) != tuple(wanted):
        raise ValueError(
            f"is for pictures of {said[0]}×{said[1]} px, not of {wanted[0]}×{wanted[1]}; "
            "give the calibration of these pictures"
        )
    return check_image_size(said if said is not None else wanted)


def pair_of(a: Lens | None, b: Lens | None) -> tuple[Lens, Lens] | None:
    """Both lenses, or None where neither bends; a view without one gets one that is straight."""
    if a is None and b is None:
        return None
    straight = RadialTangentialLens(np.eye(3), np.zeros(4))
    return a or straight, b or straight
