"""A free end that points at one of the sources: where it is, from what the other view shows.

There the device folds over itself, and no middle line follows it to its end. The other view
sees the same stretch from the side: its middle line leaves only the depth along each ray open.
That depth is fitted to the mask of the view that is looked along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from stereosom.arrays import Booleans, Floats
from stereosom.camera import Camera, StereoRig, triangulate
from stereosom.matching import match_monotone

from .picture import Mask

# So far before its end, in radii, the middle line of the view that is looked along is believed;
# over so many before that the depth is begun.
BACK, BEGUN = 4.0, 8.0
# Reach of the fold, radii.
FOLD = 9.0
# Pixels that are compared beside the mask: so many around it, and every which beyond.
BESIDE, SPARSE = 3, 4
# Steps along the tail, ends that are tried at first, and how many of those are followed up.
STEPS, STARTS, FOLLOWED = 24, 13, 2
# Softness of the edges while fitting, px, and how the depth is kept smooth, px² per px².
SOFT, STIFF = 1.5, np.array([0.04, 0.01, 0.04])


@dataclass(frozen=True, eq=False)
class EndView:
    """One view of an end: its camera, the middle line up to the end, and half its width, px."""

    camera: Camera
    line: Floats
    radius: float


@dataclass(frozen=True, eq=False)
class EndOn:
    """An end in space: its place, mm, the direction in which it points, and the fit's misfit.

    `tail` (n, 3), mm, is the axis of the stretch before it; `misfit` the share of the pixels
    compared that the tube does not explain.
    """

    tail: Floats
    misfit: float

    @property
    def place(self) -> Floats:
        """Center of the face, mm."""
        return np.asarray(self.tail[-1])

    @property
    def heading(self) -> Floats:
        """Direction at the end, of length one."""
        heading = self.tail[-1] - self.tail[-3]
        return np.asarray(heading / np.linalg.norm(heading))

    def face(self, camera: Camera, radius: float) -> Floats:
        """Outline (n, 2), px, of the flat face at the end, of a radius in px."""
        scale = radius * float(camera.pixel_size(self.place[None])[0])
        helper = np.eye(3)[np.argmin(np.abs(self.heading))]
        first = np.cross(self.heading, helper)
        first /= np.linalg.norm(first)
        around = np.linspace(0, 2 * np.pi, 40, endpoint=False)[:, None]
        second = np.cross(self.heading, first)
        rim = np.cos(around) * first + np.sin(around) * second
        return np.asarray(camera.project(self.place + scale * rim))


def find_end(rig: StereoRig, along: EndView, beside: EndView, mask: Mask) -> EndOn | None:
    """Find the end of a device that points at the source of one view, or away from it.

    Parameters
    ----------
    rig : StereoRig
    along : EndView
        The view that looks along the end; its line may stop at the fold.
    beside : EndView
        The view that sees it from the side.
    mask : (rows, columns) array of bool
        Of the view that looks along, drawn to its edges.

    Returns
    -------
    EndOn or None
        None where the views do not match before the end.
    """
    trusted = len(along.line) - 1 - round(BACK * along.radius)
    begun = _matched(rig, along, beside, trusted)
    if begun is None:
        return None
    at, level, slope = begun
    tail = np.linspace(at, len(beside.line) - 1, STEPS)
    steps = np.arange(len(beside.line))
    pixels = np.column_stack([np.interp(tail, steps, beside.line[:, i]) for i in (0, 1)])
    model = _Tail(
        along, beside.camera, beside.camera.rays(pixels), level, slope * (tail[-1] - at), mask,
        along.line[: trusted + 1],
    )  # fmt: skip
    starts = sorted(
        ((model.cost(start), tuple(start)) for start in model.starts()), key=lambda one: one[0]
    )
    best = min((model.settled(np.array(s)) for _, s in starts[:FOLLOWED]), key=lambda one: one[0])
    return EndOn(model.points(best[1]), best[0] / max(1, int(model.seen.sum())))


def _matched(
    rig: StereoRig, along: EndView, beside: EndView, trusted: int
) -> tuple[float, float, float] | None:
    """Step of the line beside at the last trusted one of that along, depth there, mm, and slope."""
    thin = 3
    first = max(0, trusted - round(BEGUN * along.radius))
    if trusted - first < 3 * thin:
        return None
    angle = [
        rig.epipolar_angle(view.camera, view.line[::thin]) * view.camera.focal_length
        for view in (along, beside)
    ]
    matching = match_monotone(*angle)
    near = (matching.in_a * thin >= first) & (matching.in_a * thin <= trusted)
    if np.count_nonzero(near) < 4:
        return None
    in_along, in_beside = matching.in_a[near] * thin, matching.in_b[near] * thin
    seen = along.line[in_along], beside.line[in_beside]
    points = triangulate(rig, *(seen if along.camera is rig.a else seen[::-1]))
    depth = np.linalg.norm(points - beside.camera.center, axis=1)
    at = float(in_beside[-1])
    if len(beside.line) - 1 - at < 3 or np.ptp(in_beside) < 2:
        return None
    slope, level = np.polyfit(in_beside - at, depth, 1)
    return at, float(level), float(slope)


class _Tail:
    """The stretch before the end, its depth along the rays of the view beside a cubic."""

    def __init__(
        self, along: EndView, beside: Camera, rays: Floats, level: float, slope: float, mask: Mask,
        body: Floats,
    ) -> None:  # fmt: skip
        self.along, self.beside, self.rays = along, beside, rays
        self.level, self.slope = level, slope
        share = np.linspace(0, 1, len(rays))
        self.share = share
        self.powers = np.stack([share, share**2, share**3], axis=1)
        # Depth that moves a point by a pixel.
        middle = beside.center + level * rays[-1]
        self.unit = float(along.camera.pixel_size(middle[None])[0])
        end, reach = along.line[-1], FOLD * along.radius + 4
        low = np.clip(np.floor(end - reach).astype(int), 0, np.array(mask.shape[::-1]) - 1)
        high = np.clip(np.ceil(end + reach).astype(int) + 1, 1, mask.shape[::-1])
        window = mask[low[1] : high[1], low[0] : high[0]]
        # All pixels of the fold and beside it; of those that are merely empty, a few.
        compared = ndimage.binary_dilation(window, iterations=BESIDE)
        compared[::SPARSE, ::SPARSE] = True
        row, column = np.nonzero(compared)
        pixels = np.column_stack([column + low[0], row + low[1]]).astype(float)
        drawn = _covered(pixels, body[-round(reach) - round(BACK * along.radius) :], along.radius)
        kept = drawn < 0.99
        self.pixels, self.body = pixels[kept], drawn[kept]
        self.seen: Booleans = window[row, column][kept]

    def points(self, bend: Floats) -> Floats:
        depth = self.level + self.slope * self.share + self.unit * (self.powers @ bend)
        return np.asarray(self.beside.center + depth[:, None] * self.rays)

    def misfit(self, bend: Floats) -> Floats:
        line = self.along.camera.project(self.points(bend))
        covered = np.maximum(_covered(self.pixels, line, self.along.radius), self.body)
        return np.append(covered - self.seen, STIFF * bend)

    def cost(self, bend: Floats) -> float:
        return float(np.sum(self.misfit(bend) ** 2))

    def starts(self) -> list[Floats]:
        """Bends that bring the end to places about the end of the line that is seen."""
        straight = self.along.camera.project(self.points(np.zeros(3)))[-1]
        # How far the end moves along its epipolar line with one unit of depth.
        moved = self.along.camera.project(self.points(np.array([0, 1.0, 0])))[-1] - straight
        there = float((self.along.line[-1] - straight) @ moved) / float(moved @ moved)
        per_px = 1 / float(np.linalg.norm(moved))
        offsets = np.linspace(-FOLD, FOLD, STARTS) * self.along.radius * per_px
        return [np.array([0.0, there + offset, 0.0]) for offset in offsets]

    def settled(self, bend: Floats) -> tuple[float, Floats]:
        """Cost and bend after Levenberg and Marquardt's steps."""
        misfit = self.misfit(bend)
        cost, damping = float(misfit @ misfit), 1e-2
        for _ in range(12):
            slopes = np.stack(
                [(self.misfit(bend + 0.5 * unit) - misfit) / 0.5 for unit in np.eye(3)], axis=1
            )
            normal = slopes.T @ slopes
            step = np.linalg.solve(
                normal + damping * np.diag(np.diag(normal) + 1e-3), -slopes.T @ misfit
            )
            there = self.misfit(bend + step)
            reached = float(there @ there)
            if reached < cost:
                settled = cost - reached < 1e-3 * cost
                bend, misfit, cost, damping = bend + step, there, reached, damping / 4
                if settled:
                    break
            else:
                damping *= 8
                if damping > 1e3:
                    break
        return cost, bend


def _covered(pixels: Floats, line: Floats, radius: float) -> Floats:
    """How far pixels (n, 2) lie within a ribbon, cut flat at its line's last point, 0 to 1."""
    step = np.diff(line, axis=0)
    square = np.maximum((step**2).sum(axis=1), 1e-12)
    apart = pixels[:, None] - line[:-1]
    place = (apart * step).sum(axis=2) / square
    distance = np.linalg.norm(apart - np.clip(place, 0, 1)[..., None] * step, axis=2)
    outside = distance.min(axis=1) - radius
    # What lies nearest to the last point, and beyond it, belongs to nothing.
    beyond = (place[:, -1] - 1) * np.sqrt(square[-1])
    past = (beyond > 0) & (distance.argmin(axis=1) == len(step) - 1)
    across = np.sqrt(np.maximum(distance[past, -1] ** 2 - beyond[past] ** 2, 0))
    outside[past] = np.maximum(across - radius, beyond[past])
    return np.asarray(np.clip(0.5 - outside / (2 * SOFT), 0, 1))
