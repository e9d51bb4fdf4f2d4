"""What a bent end looks like in the view along which it points, by three accounts of its light.

- `additive`: light is absorbed on the whole way through the device. Where it folds over itself,
  or is seen lengthwise, it is darker, and its end face shows. So do raw pictures.
- `covering`: the silhouette, face included, is as dark as the device seen from the side: so do
  pictures whose dark end is cut off.
- `flat`: the same without the face, as in drawn pictures.

All of them are fitted; the run as a whole decides which holds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import ndimage

from stereosom.arrays import Booleans, Floats
from stereosom.camera import Camera

from .loops import loops
from .picture import Gray, Mask, binned, darkest, gaussian, log_light, middle, spread
from .tube import Tube

# Pixels of the device that are compared, beside it, and of those that are merely empty.
BESIDE, SPARSE = 3, 4
# Spacing of the points that stand for the body and for its axis, px.
SPACING, ALONG = 0.75, 0.7
# Greatest radius that is compared pixel by pixel, px, and the least noise of the root.
WIDE, LEAST_NOISE = 4.0, 0.01
# Root of the light, as a share, above which nothing lies behind that a closing does not follow.
PALE = 0.9
# Blur of the points themselves, px.
_POINT_BLUR = 0.3
_POINT_WEIGHTS = gaussian(_POINT_BLUR, reach=3.0)


class Window:
    """The picture about an end: the root of its light, as a share of the light without a device.

    The root, because photon noise is the same in it at every brightness. Where the device is
    wide, pixels are put together.

    Attributes
    ----------
    radius : float
        Half the device's width, px of the window.
    root : (rows, columns) array
    noise : float
        Standard deviation of the root where there is no device.
    compared : (rows, columns) array of bool
        Pixels that are worth to be compared.
    places : (n,) array of int
        Their numbers: a pick by number takes a third of the time.
    """

    def __init__(self, picture: Gray, mask: Mask, tube: Tube, end: int, reach: float) -> None:
        radius = float(tube.radius[end])
        self.factor = factor = max(1, round(radius / WIDE))
        self.radius = radius / factor
        size = np.array(picture.shape[::-1])
        low = np.clip(np.floor(tube.line[end] - reach).astype(int), 0, size - 1)
        high = np.clip(np.ceil(tube.line[end] + reach).astype(int) + 1, low + factor, size)
        low = np.minimum(low, size - factor)
        part = slice(low[1], high[1]), slice(low[0], high[0])
        light = binned(picture[part], factor)
        drawn = binned(mask[part].astype(np.float32), factor) > 0
        width = 2 * round(3 * self.radius) + 5
        log = log_light(light, darkest(picture))
        lit = loops().smooth(log, gaussian(0.6))
        lit = ndimage.grey_closing(lit, (width, width), mode="nearest")
        lit = loops().smooth(lit, gaussian(2.0))
        empty = ~spread(drawn, BESIDE)
        if np.count_nonzero(empty) > 30:
            lit += middle((log - lit)[empty])  # a closing lies above what is noisy
        self._low = low
        # Unlike its logarithm, the root may go down to no light at all.
        self.root = np.sqrt(np.maximum(light, 0) / np.exp(lit))
        noise = 1.4826 * middle(np.abs(self.root[empty] - 1)) if empty.any() else 0.0
        self.noise = max(noise, LEAST_NOISE)
        edge = 0.5 * (1 + np.exp(-0.5 * tube.absorption))
        # What is dark and hangs together with the device; the rest is anatomy, or other wires.
        pieces, _ = ndimage.label(self.root < edge, np.ones((3, 3)))
        device = np.isin(pieces, pieces[drawn & (pieces > 0)])
        self.compared: Booleans = spread(device | drawn, BESIDE)
        self.compared[::SPARSE, ::SPARSE] |= self.root[::SPARSE, ::SPARSE] > PALE
        self.places = np.flatnonzero(self.compared)

    def inside(self, pixels: Floats) -> Floats:
        """Pixels (n, 2) of the picture as those of the window."""
        return np.asarray((pixels - self._low + 0.5) / self.factor - 0.5)

    def projection(self, camera: Camera) -> Floats:
        """Of points in space, mm, to pixels of the window, (3, 4)."""
        x, y = (0.5 - self._low) / self.factor - 0.5
        inside = np.array([[1 / self.factor, 0, x], [0, 1 / self.factor, y], [0, 0, 1]])
        return np.asarray(inside @ camera.projection)

    def root_of(self, light: Floats, weights: Floats) -> Floats:
        """Root of the light, (rows, columns), at the compared pixels, after a blur."""
        return np.asarray(np.sqrt(loops().smooth(light, weights).ravel()[self.places]))


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis in a window: its points (n, 2), px, and the way to each, px as seen from the side."""

    points: Floats
    way: Floats

    def even(self, spacing: float) -> tuple[Floats, float]:
        """Points at the middles of equal steps of the way, and the step."""
        points, step = loops().even(self.points, self.way, spacing)
        return points, float(step)


class EndPicture(Protocol):
    """Root of the light at the compared pixels of a window."""

    def __call__(self, tail: Axis, absorption: float) -> Floats:
        """Of an axis up to the end, and the absorption of the device seen from the side."""


class Additive:
    """Light is absorbed on the whole way through the device: see `additive` above."""

    def __init__(self, window: Window, body: Axis, blur: float) -> None:
        self.window, self.radius = window, window.radius
        # Points blur what they make, also by being shared between pixels. A disc's shadow has the
        # variance r²/4 across; a smaller disc makes up for it.
        blurred = _POINT_BLUR**2 + 1 / 6
        radius = np.sqrt(max(self.radius**2 - 4 * blurred, self.radius**2 / 4))
        count = max(3, int(np.ceil(2 * radius / SPACING)))
        place = (np.arange(count) + 0.5) / count * 2 - 1
        across, along = np.meshgrid(place, place)
        disc = np.hypot(across, along) < 1
        self.across, self.along = radius * across[disc], radius * along[disc]
        self.weights = gaussian(blur, reach=3.0)
        self.body = self._way_through(body)

    def __call__(self, tail: Axis, absorption: float) -> Floats:
        """As in `EndPicture`."""
        through = self.body + self._way_through(tail)
        return self.window.root_of(np.exp(-absorption / (2 * self.radius) * through), self.weights)

    def _way_through(self, axis: Axis) -> Floats:
        """Way through the device at each pixel, px: discs, which are ellipses seen obliquely."""
        centers, step = axis.even(ALONG)
        shape = self.window.root.shape
        heap = loops().discs(centers, step, self.across, self.along, shape)
        # Each point stands for a part of the volume, px³: that is a height at its pixel, px.
        each = np.pi * self.radius**2 * step / len(self.across)
        return np.asarray(each * loops().smooth(heap, _POINT_WEIGHTS))


class Covering:
    """The nearest part of the device alone absorbs light: `covering` or, without face, `flat`."""

    def __init__(self, window: Window, body: Axis, blur: float, *, face: bool) -> None:
        self.window, self.radius, self.face = window, window.radius, face
        self.weights = gaussian(blur, reach=3.0)
        row, column = np.nonzero(window.compared)
        self.pixels = np.column_stack([column, row]).astype(np.float64)
        self.body = loops().shadow(self.pixels, body.points, self.radius, 1.0, False, False)

    def __call__(self, tail: Axis, absorption: float) -> Floats:
        """As in `EndPicture`."""
        pace = max(float(tail.way[-1] - tail.way[-2]), 1e-6)
        root = loops().covered(
            self.pixels, self.body, tail.points, self.radius, pace, self.face, absorption,
            self.weights, self.window.root.shape,
        )  # fmt: skip
        return np.asarray(root)
