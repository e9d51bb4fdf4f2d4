"""`Observation`: what both views saw of the device at one instant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from .arrays import Booleans, Floats, Integers, check_array
from .camera import Camera, StereoRig
from .polygons import inside_by

Kind = Literal["filled", "edges"]
View = Literal["a", "b"]
_PIXELS = ("pixels_a", "pixels_b")


@dataclass(frozen=True, eq=False)
class Observation:
    """One instant: the device's pixels in both views, and where the views stood.

    Parameters
    ----------
    pixels_a, pixels_b : (n, 2) array
        Pixels (x, y) on the device, free of lens distortion. A view that saw nothing
        has none.
    rig : StereoRig
    time : float
        Seconds.
    index : int
        Number of the frame in its source, from zero.
    kind : {'filled', 'edges'}
        Whether the pixels fill the device or trace its edges.
    field_of_view : pair of (m, 2) arrays, optional
        Corners, in order, of the convex region that each view could see (picture border,
        shutter). A device that crosses its border has no end there. Default: the whole
        pictures.
    defect : str
        Why there is nothing to see, where the frames could not be read or used.

    Raises
    ------
    ValueError
        Where an array has the wrong shape or is not finite.
    """

    pixels_a: Floats
    pixels_b: Floats
    rig: StereoRig
    time: float = 0.0
    index: int = 0
    kind: Kind = "filled"
    field_of_view: tuple[Floats, Floats] | None = None
    defect: str = ""

    def __post_init__(self) -> None:
        for name in _PIXELS:
            object.__setattr__(self, name, check_array(getattr(self, name), name, (None, 2)))
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind: {self.kind!r} is not one of {', '.join(get_args(Kind))}")
        if not np.isfinite(self.time):
            raise ValueError(f"time: {self.time!r} is not a finite number of seconds")
        view_a, view_b = self.field_of_view or (
            picture_border(self.rig.a),
            picture_border(self.rig.b),
        )
        checked = tuple(
            check_array(corners, f"field of view {view}", (None, 2))
            for view, corners in (("a", view_a), ("b", view_b))
        )
        object.__setattr__(self, "field_of_view", checked)

    def __reduce__(self) -> tuple[Any, ...]:
        """How it is pickled: its pixels as runs, a hundredth of the bytes of large masks."""
        runs = {name: _runs(getattr(self, name)) for name in _PIXELS}
        return _pickled, ({**self.__dict__, **runs},)

    @classmethod
    def from_masks(cls, mask_a: Any, mask_b: Any, rig: StereoRig, **described: Any) -> Observation:
        """Take the True pixels of two boolean masks, (rows, columns) each.

        Parameters
        ----------
        mask_a, mask_b : (height, width) array of bool
        rig : StereoRig
        **described
            `time`, `index`, `kind`, `field_of_view` as above.

        Raises
        ------
        ValueError
            Where a mask has another size than its camera's picture.

        Examples
        --------
        >>> from stereosom.synthetic import converging_rig
        >>> mask = np.zeros((768, 1024), dtype=bool)
        >>> mask[2, 5] = True  # row 2, column 5
        >>> Observation.from_masks(mask, mask, converging_rig(45)).pixels_a
        array([[5., 2.]])
        """
        pixels = []
        for view, mask, camera in (("a", mask_a, rig.a), ("b", mask_b, rig.b)):
            mask = np.asarray(mask, dtype=bool)
            width, height = camera.image_size
            if mask.shape != (height, width):
                size = "×".join(str(length) for length in mask.shape[::-1])
                raise ValueError(
                    f"mask {view}: is {size} pixels, its camera's picture is {width}×{height}; "
                    "give the mask and the calibration of the same picture"
                )
            row, column = np.divmod(np.flatnonzero(mask), width)
            pixels.append(np.column_stack([column, row]).astype(np.float64))
        return cls(pixels[0], pixels[1], rig, **described)

    def distance_to_border(self, view: View, pixels: Any) -> Floats:
        """How far (n, 2) pixels lie inside the border of a view's field, (n,), px."""
        assert self.field_of_view is not None  # filled in when made
        return inside_by(self.field_of_view["ab".index(view)], pixels)

    def at_border(self, view: View, pixels: Any, within: float) -> Booleans:
        """Whether (n, 2) pixels lie no farther inside the border of a view's field, (n,), px.

        Parameters
        ----------
        view : {'a', 'b'}
        pixels : (n, 2) array
            The device's own in this view, or points no more than half a pixel beside them.
        within : float
            px.
        """
        if self._clearance["ab".index(view)] > within + 0.5:
            return np.zeros(len(pixels), dtype=bool)
        return np.asarray(self.distance_to_border(view, pixels) <= within)

    @cached_property
    def _clearance(self) -> tuple[float, float]:
        """How far the box around the device's pixels stays inside of each view's field, px."""
        views: tuple[tuple[View, Floats], ...] = (("a", self.pixels_a), ("b", self.pixels_b))
        in_a, in_b = (self._clear_by(*view) for view in views)
        return in_a, in_b

    def _clear_by(self, view: View, pixels: Floats) -> float:
        if len(pixels) == 0:
            return np.inf
        # A field is convex: what lies between pixels is as far from the border as they are.
        x, y = pixels.T  # a minimum over each takes a tenth of that over both
        left, right, top, bottom = x.min(), x.max(), y.min(), y.max()
        box = [[left, top], [right, top], [right, bottom], [left, bottom]]
        return float(self.distance_to_border(view, box).min())


def picture_border(camera: Camera) -> Floats:
    """Corners of a camera's whole picture, (4, 2), px: the outer edges of its border pixels."""
    width, height = camera.image_size
    right, bottom = width - 0.5, height - 0.5
    return np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])


def _pickled(state: dict[str, Any]) -> Observation:
    """The observation once more: what was checked need not be checked again."""
    observation = object.__new__(Observation)
    pixels = {name: _out_of_runs(*state[name]) for name in _PIXELS}
    observation.__dict__.update({**state, **pixels})
    return observation


def _runs(pixels: Floats) -> tuple[Floats, Integers]:
    """First pixel (n, 2) and number of pixels (n,) of each run along a row, in order."""
    if len(pixels) == 0:
        return pixels, np.zeros(0, dtype=np.intp)
    x, y = pixels.T
    goes_on = (np.diff(x) == 1) & (np.diff(y) == 0)
    # One step after the other, fractions would not come out the same.
    goes_on &= x[1:] == np.rint(x[1:])
    first = np.flatnonzero(np.append(True, ~goes_on))
    return pixels[first], np.diff(first, append=len(pixels))


def _out_of_runs(first: Floats, count: Integers) -> Floats:
    """Each pixel (n, 2) of runs."""
    pixels = np.repeat(first, count, axis=0)
    pixels[:, 0] += np.arange(len(pixels)) - np.repeat(np.cumsum(count) - count, count)
    pixels.flags.writeable = False
    return pixels
