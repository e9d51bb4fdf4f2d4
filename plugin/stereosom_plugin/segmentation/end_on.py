"""A free end that points at one of the sources: where it is, from what the other view shows.

There the device folds over itself, and no middle line follows it to its end. The other view
sees the same stretch from the side: its middle line leaves only the depth along each ray open.
That depth is fitted to the light in the view that is looked along, fold and all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from stereosom.arrays import Floats
from stereosom.camera import Camera, StereoRig, triangulate
from stereosom.matching import match_monotone
from stereosom.vectors import cross

from .end_pictures import Additive, Axis, Covering, EndPicture, Window
from .loops import loops
from .picture import Gray, Mask
from .tube import Tube

# So far before its end, in radii, the middle line of the view that is looked along is believed;
# over so many before that the depth is begun.
BACK, BEGUN = 4.0, 8.0
# Reach of the fold, radii.
FOLD = 5.5
# Points along the tail, ends that are tried at first, and how many of those are followed up.
STEPS, STARTS, FOLLOWED = 20, 11, 2
# How smooth the depth is known to be, and how well the absorption is: per deviation.
KNOWN = np.array([0.16, 0.04, 0.16, 20.0])
# Deviations of the noise beyond which a pixel counts no more.
MOST_OFF = 6.0
# A fit that was begun at the last frame's is believed up to this many times its misfit; all
# starts are tried again after so many frames.
WORSE, ANEW = 1.3, 8
# An account of the light whose costs, over so many searches, are that much higher than another's,
# is tried no more.
MEMORY, REFUTED = 3, 1.25
# A fit has settled where a step wins less than this share of the cost, and takes no more tries.
SETTLED, TRIES = 0.01, 24

# Steps of a bend by which slopes are told at first.
_UNITS = np.diag([0.4, 0.4, 0.4, 0.03])

Make = Callable[[Window, Axis, float], EndPicture]
ACCOUNTS: dict[str, Make] = {
    "additive": Additive,
    "covering": lambda window, body, blur: Covering(window, body, blur, face=True),
    "flat": lambda window, body, blur: Covering(window, body, blur, face=False),
}


@dataclass(frozen=True, eq=False)
class EndView:
    """One view of an end: its camera, and the tube there with which of its ends, 0 or -1."""

    camera: Camera
    tube: Tube
    end: int

    @property
    def line(self) -> Floats:
        """Middle line (n, 2), px, up to the end."""
        return self.tube.line if self.end == -1 else self.tube.line[::-1]

    @property
    def radius(self) -> float:
        """Half the width at the end, px."""
        return float(self.tube.radius[self.end])


@dataclass(frozen=True, eq=False)
class EndOn:
    """An end in space.

    `tail` (n, 3), mm, is the axis of the stretch before it, which begins `steps` along the line
    of the view that looks along; `misfit` the mean square deviation of the light from what such
    an end gives, in units of its noise.
    """

    tail: Floats
    steps: int
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

    def rims(self, camera: Camera, radius: float, most: int = STEPS) -> Floats:
        """Outlines (n, 40, 2), px, of the last sections of the tail, the last one its face."""
        tail = self.tail[-most:]
        heading = np.gradient(self.tail, axis=0)[-most:]
        heading /= np.linalg.norm(heading, axis=1, keepdims=True)
        helper = np.eye(3)[np.argmin(np.abs(self.heading))]
        first = cross(heading, np.broadcast_to(helper, heading.shape))
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = cross(heading, first)
        around = np.linspace(0, 2 * np.pi, 40, endpoint=False)[:, None]
        rim = np.cos(around) * first[:, None] + np.sin(around) * second[:, None]
        scale = radius * float(camera.pixel_size(self.place[None])[0])
        points = tail[:, None] + scale * rim
        return np.asarray(camera.project(points.reshape(-1, 3)).reshape(len(points), -1, 2))


@dataclass(frozen=True, eq=False)
class _Fit:
    """Depth and absorption that fit: `bend` (4,), its end beyond the line's end, px, the cost."""

    bend: Floats
    beyond: float
    cost: float


class EndFinder:
    """Finds ends that point at a source, or away from it, frame after frame of a run.

    Two folds may explain a silhouette equally well; the light within and time tell them apart.
    Which account of the light holds (`end_pictures`) is decided over the frames.

    Attributes
    ----------
    costs : dict of str to float
        Of each account, over the frames that were searched: the least is believed.
    """

    def __init__(self) -> None:
        self.costs = dict.fromkeys(ACCOUNTS, 0.0)
        self._searches = 0
        self._last: dict[tuple[int, int], tuple[_Fit, int]] = {}

    def find(
        self, rig: StereoRig, along: EndView, beside: EndView, picture: Gray, mask: Mask
    ) -> EndOn | None:
        """Find the end of a device that points at the source of one view, or away from it.

        Parameters
        ----------
        rig : StereoRig
        along : EndView
            The view that looks along the end; its line may stop at the fold.
        beside : EndView
            The view that sees it from the side.
        picture : (rows, columns) array
            Of the view that looks along, in proportion to the light.
        mask : (rows, columns) array of bool
            Its device, more or less.

        Returns
        -------
        EndOn or None
            None where the views do not match before the end.
        """
        trusted = len(along.line) - 1 - round(BACK * along.radius)
        begun = _matched(rig, along, beside, trusted)
        if begun is None:
            return None
        window = Window(picture, mask, along.tube, along.end, FOLD * along.radius + 4)
        model = _Tail(along, beside, begun, window)
        which = (0 if along.camera is rig.a else 1, along.end)
        best = self._fitted(model, which)
        misfit = best.cost / np.count_nonzero(window.compared)
        return EndOn(model.points(best.bend), begun.last, misfit)

    def _fitted(self, model: _Tail, which: tuple[int, int]) -> _Fit:
        """Fit by the account that is believed; by all of them at first, and now and then."""
        blur = model.along.tube.blur / model.window.factor

        def picture(name: str) -> EndPicture:
            return ACCOUNTS[name](model.window, model.body, blur)

        believed = min(self.costs, key=self.costs.__getitem__)
        last, age = self._last.get(which, (None, ANEW))
        if last is not None and age < ANEW:
            fit = model.settled(model.moved(last), picture(believed))
            if fit.cost < WORSE * last.cost:
                self._last[which] = fit, age + 1
                return fit
        starts = [np.array([0.0, end, 0.0, 0.0]) for end in model.ends()]
        fits = {}
        for name in self._left():
            see = picture(name)
            first = sorted((model.cost(start, see), tuple(start)) for start in starts)
            tried = [np.array(start) for _, start in first[:FOLLOWED]]
            if last is not None:
                tried.append(model.moved(last))
            fits[name] = min((model.settled(one, see) for one in tried), key=lambda fit: fit.cost)
            self.costs[name] += fits[name].cost
        self._searches += 1
        best = fits[min(fits, key=self.costs.__getitem__)]
        self._last[which] = best, 0
        return best

    def _left(self) -> list[str]:
        """Accounts that are not refuted."""
        if self._searches < MEMORY:
            return list(self.costs)
        least = min(self.costs.values())
        return [name for name, cost in self.costs.items() if cost <= REFUTED * least]


@dataclass(frozen=True, eq=False)
class _Begin:
    """Where the tail begins, and the body before it.

    `step` of the line beside and `last` of the line along, `depth` there and `slope` of it, mm;
    `body` are the points of the line along, px, and `way` that to each of them in space, mm.
    """

    step: float
    last: int
    depth: float
    slope: float
    body: Floats
    way: Floats


def _matched(rig: StereoRig, along: EndView, beside: EndView, trusted: int) -> _Begin | None:
    """Begin the tail at the last trusted step of the line along."""
    thin = 3
    first = max(0, trusted - round(BEGUN * along.radius))
    if trusted - first < 3 * thin:
        return None
    angle = [
        rig.epipolar_angle(view.camera, view.line[::thin]) * view.camera.focal_length
        for view in (along, beside)
    ]
    matching = match_monotone(angle[0], angle[1])
    far = max(0, trusted - round((BACK + FOLD) * along.radius))
    known = (matching.in_a * thin >= far) & (matching.in_a * thin <= trusted)
    in_along, in_beside = matching.in_a[known] * thin, matching.in_b[known] * thin
    near = in_along >= first
    if np.count_nonzero(near) < 4:
        return None
    seen = along.line[in_along], beside.line[in_beside]
    points = triangulate(rig, *(seen if along.camera is rig.a else seen[::-1]))
    depth = np.linalg.norm(points - beside.camera.center, axis=1)
    at = float(in_beside[-1])
    if len(beside.line) - 1 - at < 3 or np.ptp(in_beside[near]) < 2:
        return None
    slope, level = np.polyfit(in_beside[near] - at, depth[near], 1)
    # The way in space along the body, its depth a parabola.
    parabola = np.poly1d(np.polyfit(in_beside - at, depth, 2))
    rays = beside.camera.rays(beside.line[in_beside])
    body = parabola(in_beside - at)[:, None] * rays
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(body, axis=0), axis=1)))
    steps = np.arange(in_along[0], in_along[-1] + 1)
    smooth = np.poly1d(np.polyfit(in_along - steps[0], way, 2))(steps - steps[0])
    longest = np.maximum.accumulate(smooth - smooth[0])
    return _Begin(at, int(steps[-1]), float(level), float(slope), along.line[steps], longest)


class _Tail:
    """The stretch before the end, its depth along the rays of the view beside a cubic.

    A `bend` (4,) holds the powers of the depth, in px of the view along, and the logarithm by
    which the absorption differs from the tube's.
    """

    def __init__(self, along: EndView, beside: EndView, begin: _Begin, window: Window) -> None:
        self.along, self.beside, self.window = along, beside.camera, window
        tail = np.linspace(begin.step, len(beside.line) - 1, STEPS)
        steps = np.arange(len(beside.line))
        pixels = np.column_stack([np.interp(tail, steps, beside.line[:, i]) for i in (0, 1)])
        self.rays = beside.camera.rays(pixels)
        share = np.linspace(0, 1, STEPS)
        self.straight = begin.depth + begin.slope * (tail[-1] - tail[0]) * share
        self.powers = np.stack([share, share**2, share**3], axis=1)
        self.projection = window.projection(along.camera)
        middle = self.beside.center + begin.depth * self.rays[-1]
        # Depth that moves a point by a pixel.
        self.unit = float(along.camera.pixel_size(middle[None])[0])
        self.body = Axis(window.inside(begin.body), begin.way / self.unit / window.factor)
        self.seen = window.root[window.compared]
        # Where the end is along its epipolar line, px beyond the line's end, in the mean depth.
        straight, moved = (
            along.camera.project(self.points(np.array([0, end, 0, 0])))[-1] for end in (0.0, 1.0)
        )
        self._per_unit = float(np.linalg.norm(moved - straight))
        self._there = float((along.line[-1] - straight) @ (moved - straight)) / self._per_unit**2

    def points(self, bend: Floats) -> Floats:
        depth = self.straight + self.unit * (self.powers @ bend[:3])
        return np.asarray(self.beside.center + depth[:, None] * self.rays)

    def misfit(self, bend: Floats, picture: EndPicture) -> Floats:
        line, way = loops().tail(
            bend[:3], self.straight, self.unit, self.beside.center, self.rays, self.projection
        )
        tail = Axis(line, way / self.window.factor)
        light = picture(tail, self.along.tube.absorption * float(np.exp(bend[3])))
        off = loops().deviations(light, self.seen, self.window.noise, MOST_OFF, KNOWN * bend)
        return np.asarray(off)

    def cost(self, bend: Floats, picture: EndPicture) -> float:
        return float(np.sum(self.misfit(bend, picture) ** 2))

    def ends(self) -> Floats:
        """Depths of the end, px, that bring it to places about the end of the line seen."""
        offsets = np.linspace(-FOLD, FOLD, STARTS) * self.along.radius / self._per_unit
        return np.asarray(self._there + offsets)

    def moved(self, last: _Fit) -> Floats:
        """The bend of another frame, its end as far beyond the line's end as it was there."""
        bend = last.bend.copy()
        bend[1] += self._there + last.beyond - bend[:3].sum()
        return bend

    def settled(self, bend: Floats, picture: EndPicture) -> _Fit:
        """Least cost near a bend, by Levenberg and Marquardt's steps with Broyden's slopes."""
        misfit = self.misfit(bend, picture)
        cost, damping = float(misfit @ misfit), 1e-2
        columns = [(self.misfit(bend + unit, picture) - misfit) / unit.sum() for unit in _UNITS]
        slopes = np.stack(columns, axis=1)
        little = 0
        for _ in range(TRIES):
            step = loops().damped_step(slopes, misfit, damping)
            there = self.misfit(bend + step, picture)
            # The slopes as this step has shown them, whether it was a good one or not.
            loops().learn_slopes(slopes, there - misfit, step)
            won = cost - float(there @ there)
            if won > 0:
                bend, misfit, cost, damping = bend + step, there, cost - won, damping / 4
            else:
                damping *= 4
            little = little + 1 if won < SETTLED * cost else 0
            if little == 3:
                break
        return _Fit(bend, float(bend[:3].sum()) - self._there, cost)
