"""Both views of a run, frame after frame: each helps the other, and the next."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.camera import Camera, StereoRig
from stereosom_plugin.acquisition import Acquisition, FramePair

from .both_views import agreeing
from .end_on import EndFinder
from .faces import filled
from .follow import follow
from .picture import Mask
from .tube import Tube
from .xray import Candidate, View, candidates, fill, fit, prepare, within

# What is found in the band is believed where its length and absorption have changed by less than
# these shares.
LENGTH_CHANGE, ABSORPTION_CHANGE = 0.3, 0.4


class BiplaneSegmenter:
    """Segments both views of a run's frames, in order.

    The first frame is searched whole: of the lines in both views, the two that agree best are
    the device. From then on it is looked for in a band about where it was, and everywhere
    again where it is not found there.

    Parameters
    ----------
    acquisition : Acquisition
        Where the views stood, and their fields.

    Attributes
    ----------
    tubes : pair of Tube or None
        What was seen last.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self.fields: tuple[Any, Any] = acquisition.field_of_view or (None, None)
        self.tubes: tuple[Tube | None, Tube | None] = (None, None)
        self._ends = EndFinder()

    def __call__(self, pair: FramePair, expected: Backbone | None = None) -> tuple[Mask, Mask]:
        """Masks of both views.

        Parameters
        ----------
        pair : FramePair
        expected : Backbone, optional
            Where the device is expected. Default: where it was seen last.
        """
        views = (
            prepare(pair.image_a, field_of_view=self.fields[0]),
            prepare(pair.image_b, field_of_view=self.fields[1]),
        )
        self.tubes = self._followed(views, pair.rig, expected) or _searched(*views, pair.rig)
        tube_a, tube_b = self.tubes
        if tube_a is not None and tube_b is not None:
            masks = filled(pair.rig, views, (tube_a, tube_b), self._ends)
        else:
            masks = (fill(views[0], tube_a), fill(views[1], tube_b))
        return within(views[0], masks[0]), within(views[1], masks[1])

    def _followed(
        self, views: tuple[View, View], rig: StereoRig, expected: Backbone | None
    ) -> tuple[Tube, Tube] | None:
        """Tubes near where they were, or None where they are not to be found there."""
        last_a, last_b = self.tubes
        if last_a is None or last_b is None:
            return None
        seen: list[Tube] = []
        for view, last, camera in zip(views, (last_a, last_b), (rig.a, rig.b), strict=True):
            near = last.line if expected is None else _projected(expected, camera)
            tube = _again(view, last, near)
            if tube is None:
                return None
            seen.append(tube)
        return seen[0], seen[1]


def _searched(view_a: View, view_b: View, rig: StereoRig) -> tuple[Tube | None, Tube | None]:
    """Tubes of the two lines, one of each view, that agree best."""
    with ThreadPoolExecutor() as pool:  # there is nothing else to be done meanwhile
        seen_a, seen_b = pool.map(candidates, (view_a, view_b))
    for _ in range(3):
        pair = agreeing(rig, seen_a, seen_b)
        if pair is None:
            break
        tube_a, tube_b = fit(view_a, pair[0]), fit(view_b, pair[1])
        if tube_a is not None and tube_b is not None:
            return tube_a, tube_b
        seen_a = [one for one in seen_a if tube_a is not None or one is not pair[0]]
        seen_b = [one for one in seen_b if tube_b is not None or one is not pair[1]]
    return None, None


def _again(view: View, last: Tube, near: Floats) -> Tube | None:
    """The tube that was seen last: by the darkest way, or among the lines in the band."""
    line = follow(view, last, near)
    tube = fit(view, line, last.blur) if line is not None else None
    if tube is not None and _goes_on(last, tube):
        return tube
    lines = candidates(view, near, float(np.median(last.radius)))
    if not lines:
        return None
    tube = fit(view, max(lines, key=_likeness_to(last)), last.blur)
    return tube if tube is not None and _goes_on(last, tube) else None


def _likeness_to(last: Tube) -> Any:
    """How likely a line is the tube that was seen last, as a function of the line."""

    def likeness(line: Candidate) -> float:
        quotient = np.log(line.absorption / last.absorption)
        return line.likely * float(np.exp(-((quotient / 0.5) ** 2)))

    return likeness


def _goes_on(last: Tube, tube: Tube) -> bool:
    """Whether a tube can be what was seen last."""
    return (
        abs(np.log(tube.length / last.length)) < LENGTH_CHANGE
        and abs(np.log(tube.absorption / last.absorption)) < ABSORPTION_CHANGE
        and sum(tube.enters) == sum(last.enters)
    )


def _projected(curve: Backbone, camera: Camera) -> Floats:
    """A backbone in a picture, a point per pixel, px."""
    points = camera.project(curve.sample(max(50, int(curve.length * 4))))
    return np.asarray(points)
