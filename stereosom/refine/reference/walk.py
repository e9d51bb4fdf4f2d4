"""A walk along the device from where a guess lies on both masks, to either end of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Booleans, Floats

# Such a share of what a step of the walk is beside the device is made good at once, and the walk
# turns towards it by such another: less follows no bend, more follows the pixels' own steps.
FOLLOWED, TURNED = 0.6, 0.05
# Two views that see about the same side of the device are believed no more than this, as a share.
ALIKE = 0.3
# A stretch that runs towards a camera by more than this is not seen from the side, as the share of
# its length that the picture shows; nor one that is so much narrower or wider than the device, as
# its width in half widths, give or take a pixel.
SHOWN, NARROWEST, WIDEST = 0.5, 1.2, 2.5
# Beside a mask no wider is looked for the device than its half width and this, px.
BESIDE_PX = 2.0
# A view that sees the device from no side says that it is not beside the mask: it is drawn in by
# so many half widths. It is looked for in so many directions.
DRAWN_IN, DIRECTIONS = 0.3, 16
# The disc of a flat end that is tilted more is not told from a bend: its share as for `SHOWN`.
TILTED = 0.7
# The walk goes on for so much more than the guess's length, and for so many radii beyond a mask.
BEYOND, PATIENCE = 0.08, 8.0


@dataclass(frozen=True, eq=False)
class Mask:
    """A view's mask, (rows, columns), with the pixel (x, y) of its first corner."""

    projection: Floats
    inside: Booleans
    corner: Floats

    @classmethod
    def of(cls, projection: Floats, pixels: Floats) -> Mask:
        """Draw pixels (n, 2)."""
        corner = np.rint(pixels.min(axis=0))
        column, row = (np.rint(pixels) - corner).astype(int).T
        inside = np.zeros((row.max() + 1, column.max() + 1), dtype=bool)
        inside[row, column] = True
        return cls(projection, inside, corner)

    def has(self, pixel: Floats) -> bool:
        """Whether a place in the picture is on the mask."""
        column, row = np.floor(pixel + 0.5) - self.corner
        height, width = self.inside.shape
        return bool(0 <= column < width and 0 <= row < height) and bool(
            self.inside[int(row), int(column)]
        )

    def shows(self, place: Floats, heading: Floats) -> tuple[Floats, Floats, Floats, float]:
        """Where a place in space is seen, px, the derivative of that (2, 3), the heading there
        (2,), and what a length across the ray is in the picture, px/mm.
        """
        x, y, depth = self.projection[:, :3] @ place + self.projection[:, 3]
        pixel = np.array([x, y]) / depth
        slopes = (self.projection[:2, :3] - np.outer(pixel, self.projection[2, :3])) / depth
        return pixel, slopes, slopes @ heading, float(np.sqrt(np.sum(slopes**2) / 2))

    def beside(
        self, place: Floats, heading: Floats, radius: float, kept_in: bool
    ) -> tuple[Floats, float]:
        """How far the middle of the device lies beside a place on its way, px, and per mm (3,).

        The latter is zero where this view does not tell: then a place beside the mask is drawn
        in where it is to be `kept_in`.
        """
        pixel, slopes, ahead, scale = self.shows(place, heading)
        half, length = radius * scale, float(np.hypot(*ahead))
        across, offset = np.zeros(2), np.nan
        if length >= SHOWN * scale:
            across = np.array([-ahead[1], ahead[0]]) / length
            offset = self._middle(pixel, across, half)
        if np.isnan(offset) and kept_in and not self.has(pixel):
            across, offset = self._nearest(pixel, half)
        if np.isnan(offset):
            return np.zeros(3), 0.0
        row = across @ slopes
        return row - (row @ heading) * heading, offset

    def _middle(self, pixel: Floats, across: Floats, half: float) -> float:
        """How far across the middle of the mask is, px; NaN where it is no such device."""
        start = 0.0
        if not self.has(pixel):
            for away in np.arange(1.0, half + BESIDE_PX):
                found = [sign for sign in (1, -1) if self.has(pixel + sign * away * across)]
                if found:
                    start = found[0] * away
                    break
            else:
                return np.nan
        edges, most = [start, start], 4 * half + 2
        for side, step in enumerate((0.5, -0.5)):
            while abs(edges[side] - start) < most and self.has(
                pixel + (edges[side] + step) * across
            ):
                edges[side] += step
        width = edges[0] - edges[1] + 0.5
        if not NARROWEST * half - 1 <= width <= WIDEST * half + 1:
            return np.nan
        return (edges[0] + edges[1]) / 2

    def _nearest(self, pixel: Floats, half: float) -> tuple[Floats, float]:
        """The direction to the mask, and how far it is until well inside, px; or else NaN."""
        angles = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
        for away in np.arange(1.0, half + BESIDE_PX):
            for angle in angles:
                way = np.array([np.cos(angle), np.sin(angle)])
                if self.has(pixel + away * way):
                    return way, away + DRAWN_IN * half
        return np.zeros(2), np.nan

    def covers(self, place: Floats, heading: Floats, radius: float, rounded: bool) -> bool:
        """Whether a device that ended here, going so, would end on the mask."""
        pixel, _, ahead, scale = self.shows(place, heading)
        length = float(np.hypot(*ahead))
        shown = min(length / scale, 1.0)
        reach = radius * scale * (1.0 if rounded else np.sqrt(1 - shown**2))
        if shown > TILTED:
            pixel = pixel + reach / length * ahead
        return self.has(pixel)


def walk(
    projection_a: Floats,
    pixels_a: Floats,
    projection_b: Floats,
    pixels_b: Floats,
    guess: Floats,
    radius: float,
    rounded: Booleans,
) -> tuple[Floats, int]:
    """A way along the device, from base to tip, begun where a guess lies on both masks.

    Each step goes on as the guess does, and is moved towards the middle of either mask across it.

    Parameters
    ----------
    projection_a, projection_b : (3, 4) arrays
    pixels_a, pixels_b : (n, 2) arrays
        Of filled masks.
    guess : (n, 3) array
        At even steps, mm.
    radius : float
        Of the device, mm.
    rounded : (2,) array
        Whether the base, and the tip, is half a ball.

    Returns
    -------
    way : (k, 3) array
        mm. Empty where all of the guess lies on both masks, or nothing.
    first : int
        Which step of the guess the first of it stands for; before the guess's own, less than zero.
    """
    views = Mask.of(projection_a, pixels_a), Mask.of(projection_b, pixels_b)
    headings = np.empty_like(guess)
    headings[1:-1] = guess[2:] - guess[:-2]
    headings[0], headings[-1] = guess[1] - guess[0], guess[-1] - guess[-2]
    headings /= np.linalg.norm(headings, axis=1)[:, None]
    if all(view.has(view.shows(place, place)[0]) for place in guess for view in views):
        return np.empty((0, 3)), 0
    # It begins in the middle of the longest stretch that lies on both.
    longest, run, begin = 0, 0, 0
    for at in range(len(guess)):
        run = run + 1 if _on_both(views, guess[at], headings[at], radius) else 0
        if run > longest:
            longest, begin = run, at - (run - 1) // 2
    if longest == 0:
        return np.empty((0, 3)), 0
    to_base = _one_way(views, guess, headings, begin, -1, radius, bool(rounded[0]))
    to_tip = _one_way(views, guess, headings, begin, 1, radius, bool(rounded[1]))
    if len(to_base) == 0 or len(to_tip) == 0:
        return np.empty((0, 3)), 0
    return np.concatenate([to_base[:0:-1], to_tip]), begin - len(to_base) + 1


def _on_both(views: tuple[Mask, Mask], place: Floats, heading: Floats, radius: float) -> bool:
    for view in views:
        row, offset = view.beside(place, heading, radius, kept_in=False)
        scale = view.shows(place, heading)[3]
        if not row.any() or abs(offset) > radius * scale:
            return False
    return True


def _one_way(
    views: tuple[Mask, Mask],
    guess: Floats,
    headings: Floats,
    begin: int,
    way: int,
    radius: float,
    rounded: bool,
) -> Floats:
    """From a place of the guess to its tip, or its base, up to the last that both masks cover."""
    view_a, view_b = views
    step = float(np.linalg.norm(guess[1] - guess[0]))
    left = len(guess) - begin if way > 0 else begin + 1
    path = np.empty((left + int(BEYOND * len(guess)), 3))
    place, heading, covered = guess[begin], way * headings[begin], 0
    for number in range(len(path)):
        on_a = view_a.has(view_a.shows(place, heading)[0])
        on_b = view_b.has(view_b.shows(place, heading)[0])
        # Beyond the device's end neither is on its mask.
        row_a, offset_a = view_a.beside(place, heading, radius, kept_in=on_b)
        row_b, offset_b = view_b.beside(place, heading, radius, kept_in=on_a)
        moved = _moved(row_a, offset_a, row_b, offset_b)
        place = place + (FOLLOWED if number else 1.0) * moved
        if number:
            heading = _unit(heading + TURNED / step * moved)
        path[number] = place
        if all(view.covers(place, heading, radius, rounded) for view in views):
            covered = number + 1
        elif (number + 1 - covered) * step > PATIENCE * radius:
            break
        at = begin + way * (number + 1)
        if 0 <= at < len(guess):
            heading = _unit(heading + way * (headings[at] - headings[at - way]))
        place = place + step * heading
    return path[:covered]


def _moved(row_a: Floats, offset_a: float, row_b: Floats, offset_b: float) -> Floats:
    """The least move, mm, that makes good what both views see beside, as far as they tell."""
    aa, bb, ab = row_a @ row_a, row_b @ row_b, row_a @ row_b
    damping = ALIKE**2 * max(aa, bb)
    if damping == 0:
        return np.zeros(3)
    determinant = (aa + damping) * (bb + damping) - ab**2
    by_a = ((bb + damping) * offset_a - ab * offset_b) / determinant
    by_b = ((aa + damping) * offset_b - ab * offset_a) / determinant
    return np.asarray(by_a * row_a + by_b * row_b)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
