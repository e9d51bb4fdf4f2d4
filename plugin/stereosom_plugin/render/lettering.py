"""Words on a picture, none over another: legend, scale bar, axes, and names beside places."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from stereosom.arrays import Floats

from ..errors import require
from .style import (
    BACKGROUND,
    COLOR_BY,
    INK,
    Picture,
    colors_of,
    letter_height,
    rgb,
    round_step,
    typeface,
)

Box = tuple[float, float, float, float]


class Lettering:
    """A picture that words are written on, and the places that are taken.

    Parameters
    ----------
    picture : (rows, columns, 3) array of bytes

    Attributes
    ----------
    boxes : list of (left, top, right, bottom)
        What is taken by words and what belongs to them, px.
    """

    def __init__(self, picture: Picture) -> None:
        image, draw = require("PIL.Image", "vtk"), require("PIL.ImageDraw", "vtk")
        self._image = image.fromarray(np.ascontiguousarray(picture))
        self._draw = draw.Draw(self._image, "RGBA")
        self.width, self.height = self._image.size
        self.letter = letter_height((self.width, self.height))
        self.margin = round(1.5 * self.letter)
        self.boxes: list[Box] = []

    @property
    def picture(self) -> Picture:
        """The picture with all words, (rows, columns, 3)."""
        return np.array(self._image, dtype=np.uint8)

    def heading(self, lines: Sequence[str]) -> None:
        """Lines at the top left, the first one larger; each ends before what stands there."""
        y = float(self.margin)
        for number, line in enumerate(lines):
            height = round(self.letter * (1.3 if number == 0 else 1.0))
            band = (0, y - 2, self.width, y + 1.4 * height)
            ends = [box[0] - self.letter for box in self.boxes if _meet(box, band)]
            room = min([self.width - self.margin, *ends]) - self.margin
            while line and typeface(height).getlength(line) > room:
                line = line[:-2].rstrip(" …") + "…" if len(line) > 2 else ""
            if line:
                self._write((self.margin, y), line, height, INK)
            y += 1.55 * height

    def plate(self, words: str, corner: tuple[int, int] = (0, 0)) -> None:
        """One line on a light ground, in the top left corner of a picture that may be dark."""
        pad = round(0.6 * self.letter)
        at = (corner[0] + 2 * pad, corner[1] + 2 * pad)
        self._ground(self._box(at, words, self.letter, "la"), pad)
        self._write(at, words, self.letter, INK)

    def color_bar(self, color_by: str, limits: tuple[float, float]) -> None:
        """The legend of the colors, at the top right, with round numbers."""
        title, _ = COLOR_BY[color_by]
        long, thick = round(0.26 * self.width), round(0.9 * self.letter)
        left, top = self.width - self.margin - long, self.margin
        self._write((left + long / 2, top), title, self.letter, INK, "ma")
        top += round(1.6 * self.letter)
        ramp = colors_of(np.linspace(*limits, long), limits, color_by)
        image = require("PIL.Image", "vtk")
        self._image.paste(image.fromarray(np.tile(ramp, (thick, 1, 1))), (left, top))
        self.boxes.append((left, top, left + long, top + thick))
        step, decimals = self._ticks(limits[1] - limits[0], long)
        first = int(np.ceil(limits[0] / step - 1e-9))
        for k in range(first, int(np.floor(limits[1] / step + 1e-9)) + 1):
            x = left + (k * step - limits[0]) / (limits[1] - limits[0]) * (long - 1)
            self._draw.line([(x, top + thick), (x, top + 1.3 * thick)], INK, self._stroke)
            label = f"{k * step + 0.0:.{decimals}f}"
            self._write((x, top + 1.4 * thick), label, self.letter, INK, "ma")

    def swatches(self, named: Sequence[tuple[str, str, float]]) -> None:
        """What colors mean that are not in the color bar: (name, color, opacity), bottom right."""
        y = self.height - self.margin - self.letter
        x = self.width - self.margin
        widest = max((typeface(self.letter).getlength(name) for name, _, _ in named), default=0)
        left = x - widest - 2.4 * self.letter
        # In a narrow picture the scale bar is in the way: then above it.
        while any(_meet((left, y - 2, x, y + 1.3 * self.letter), box) for box in self.boxes):
            y -= self.letter
        for name, color, opacity in reversed(named):
            left = self._write((x, y), name, self.letter, INK, "ra")[0]
            box = (left - 2.4 * self.letter, y, left - 0.6 * self.letter, y + self.letter)
            fill = (*rgb(color), round(255 * opacity))
            self._draw.rectangle(box, fill, rgb(color), self._stroke)
            self.boxes.append(box)
            y -= round(1.6 * self.letter)

    def scale_bar(self, pixels_per_mm: float, note: str = "", plate: bool = False) -> None:
        """A bar of round millimetres at the bottom left, on a light ground if wished."""
        millimetres = round_step(0.2 * self.width / pixels_per_mm, 1)
        long = millimetres * pixels_per_mm
        left, bottom = self.margin, self.height - self.margin
        thick = max(3, round(0.3 * self.letter))
        box = (left, bottom - thick, left + long, bottom)
        words = f"{millimetres:g} mm{note}"
        top = bottom - thick - 1.5 * self.letter
        if plate:
            wide = max(long, typeface(self.letter).getlength(words))
            self._ground((left, top, left + wide, bottom), round(0.6 * self.letter))
        self._write((left, top), words, self.letter, INK)
        self._draw.rectangle(box, INK)
        self.boxes.append(box)

    def axes(self, directions: Floats, names: Sequence[str]) -> None:
        """Where the axes point: (3, 2) unit vectors' pictures, x right and y down, bottom left."""
        image, draw = require("PIL.Image", "vtk"), require("PIL.ImageDraw", "vtk")
        fine, arm = 4, 2.6 * self.letter
        side = round(2 * (arm + 1.4 * self.letter))
        left, top = self.margin - 0.4 * self.letter, self.height - self.margin - side
        top -= 2.6 * self.letter  # above the scale bar
        self._ground((left, top, left + side, top + side), 0)
        # Lines at an angle: drawn four times as large, so that they end up smooth.
        tile = self._image.crop((round(left), round(top), round(left) + side, round(top) + side))
        tile = tile.resize((fine * side, fine * side), image.Resampling.BOX)
        pen, middle = draw.Draw(tile, "RGBA"), np.array([side / 2, side / 2])
        for direction in directions:
            tip = middle + arm * direction
            pen.line([*(fine * middle), *(fine * tip)], INK, fine * self._stroke)
        self._image.paste(
            tile.resize((side, side), image.Resampling.LANCZOS), (round(left), round(top))
        )
        self.boxes.append((left, top, left + side, top + side))
        taken: list[Box] = []
        for direction, name in zip(directions, names, strict=True):
            if np.linalg.norm(direction) < 0.25:  # it points at the eye
                continue
            away = direction * (1 + 0.75 * self.letter / arm / np.linalg.norm(direction))
            x, y = np.array([left, top]) + middle + arm * away
            box = self._box((x, y), name, self.letter, "mm")
            if not any(_meet(box, other) for other in taken):
                self._draw.text((x, y), name, INK, typeface(self.letter), "mm")
                taken.append(box)

    def name(
        self,
        place: Floats,
        words: str,
        color: str,
        keep_off: Floats,
        gap: float = 0,
        first_deg: float = 0,
    ) -> bool:
        """Write words beside a place (2,), where they cover neither words nor (n, 2) pixels.

        `gap` px away at least, and first at the angle `first_deg`, clockwise from the right.

        Returns
        -------
        bool
            Whether there was room.
        """
        font = typeface(self.letter)
        wide, high = font.getlength(words) / 2, 0.7 * self.letter
        pad = 0.3 * self.letter
        best = None
        distances, angles = (1.2, 2.2, 3.5, 5.0), (0, 180, 270, 90, 315, 225, 45, 135)
        for distance, angle in product(distances, np.radians(np.add(first_deg, angles))):
            away = gap + distance * self.letter
            x = place[0] + np.cos(angle) * (away + wide)
            y = place[1] + np.sin(angle) * (away + high)
            box = (x - wide - pad, y - high - pad, x + wide + pad, y + high + pad)
            if not self._free(box):
                continue
            inside = (keep_off >= box[:2]) & (keep_off <= box[2:])
            covered = np.count_nonzero(inside.all(axis=1))
            # The fewest pixels of the device covered; of those, the nearest.
            if best is None or covered < best[0]:
                best = (covered, x, y, box)
            if covered == 0:
                break
        if best is None:
            return False
        _, x, y, box = best
        self._draw.rounded_rectangle(box, 0.3 * self.letter, (*rgb(BACKGROUND), 200))
        self._draw.text((x, y), words, color, font, "mm")
        self.boxes.append(box)
        return True

    def _ground(self, box: Box, pad: int) -> None:
        grown = (box[0] - pad, box[1] - pad, box[2] + pad, box[3] + pad)
        self._draw.rounded_rectangle(grown, pad, (*rgb(BACKGROUND), 215))

    def _ticks(self, span: float, long: int) -> tuple[float, int]:
        """Steps between the numbers of a bar, about three, that leave room between them."""
        step, decimals = span, 0
        for steps in (3, 2.5, 2, 1.5, 1):
            step = round_step(span, steps)
            decimals = max(0, -int(np.floor(np.log10(step) + 1e-9)))
            widest = typeface(self.letter).getlength(f"{span:.{decimals}f}")
            if step / span * long > widest + self.letter:
                break
        return step, decimals

    @property
    def _stroke(self) -> int:
        return max(1, round(self.letter / 10))

    def _write(
        self, at: tuple[float, float], words: str, height: int, color: str, anchor: str = "la"
    ) -> Box:
        box = self._box(at, words, height, anchor)
        self._draw.text(at, words, color, typeface(height), anchor)
        self.boxes.append(box)
        return box

    def _box(self, at: tuple[float, float], words: str, height: int, anchor: str) -> Box:
        left, top, right, bottom = self._draw.textbbox(at, words, typeface(height), anchor)
        return (left, top, right, bottom)

    def _free(self, box: Box) -> bool:
        edge = 0.3 * self.letter
        inside = box[0] >= edge and box[1] >= edge
        inside &= box[2] <= self.width - edge and box[3] <= self.height - edge
        return inside and not any(_meet(box, other) for other in self.boxes)


def _meet(one: Box, other: Box) -> bool:
    apart = one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
    return not apart
