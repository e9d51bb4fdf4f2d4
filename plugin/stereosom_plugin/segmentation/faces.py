"""Masks of both views, with the ends as both of them tell: flat faces, folds, rounds."""

from __future__ import annotations

from dataclasses import replace

from stereosom.camera import Camera, StereoRig

from .both_views import end_caps
from .end_on import EndFinder, EndOn, EndView
from .free_ends import roundness, sharpen_end
from .picture import Mask
from .tube import Tube, draw, draw_line, end_face
from .xray import View

# A face that reaches less far into the picture, px, changes nothing.
LEAST = 0.2
# Cosine between the end and the ray from which on an end is taken for one that may fold over.
END_ON = 0.75


def filled(
    rig: StereoRig, views: tuple[View, View], tubes: tuple[Tube, Tube], finder: EndFinder
) -> tuple[Mask, Mask]:
    """Masks of both views of a device.

    Half of the light marks where the axis of a tube ends; its silhouette reaches farther by the
    round of the flat end face, where that is seen obliquely. Where an end points at a source,
    the silhouette is that of the end in space which explains the light.

    Parameters
    ----------
    rig : StereoRig
    views : pair of View
    tubes : pair of Tube
        The middle lines that were fitted.
    finder : EndFinder
        Of this run.
    """
    cameras = (rig.a, rig.b)
    masks = [draw(tube, view.picture.shape) for tube, view in zip(tubes, views, strict=True)]
    reaches = end_caps(rig, *tubes)
    # By view and end: the end in space, and whether it is looked along.
    known: dict[tuple[int, int], tuple[EndOn, bool]] = {}
    for along, beside in ((0, 1), (1, 0)):
        for end, reach in zip((0, -1), reaches[along], strict=True):
            other = _same_end(rig, tubes, along, end)
            oblique = reach >= END_ON * tubes[along].radius[end]
            if other is None or not oblique or (along, end) in known:
                continue
            found = finder.find(
                rig,
                EndView(cameras[along], tubes[along], end),
                EndView(cameras[beside], tubes[beside], other),
                views[along].picture,
                masks[along],
            )
            if found is not None:
                known[along, end] = found, True
                known[beside, other] = found, False
    for side, (tube, view) in enumerate(zip(tubes, views, strict=True)):
        for end in (0, -1):
            if (side, end) in known and known[side, end][1]:
                found = known[side, end][0]
                tube = _without_end(tube, end, found.steps)
                masks[side] = draw(tube, view.picture.shape)
        for end, reach in zip((0, -1), reaches[side], strict=True):
            found, looked_along = known.get((side, end), (None, False))
            if not looked_along:
                sharpen_end(masks[side], view.picture, tubes[side], end)
            if found is not None:
                radius = float(tubes[side].radius[end])
                _add_end(masks[side], cameras[side], found, radius, whole=looked_along)
            elif reach > LEAST and not tube.enters[end]:
                flat = 1 - roundness(view.picture, tube, end)
                masks[side] |= end_face(tube, end, reach * flat, masks[side].shape)
    return masks[0], masks[1]


def _without_end(tube: Tube, end: int, steps: int) -> Tube:
    """A tube up to so many steps from its other end."""
    kept = slice(0, steps + 1) if end == -1 else slice(len(tube.line) - 1 - steps, None)
    return replace(tube, line=tube.line[kept], radius=tube.radius[kept])


def _add_end(mask: Mask, camera: Camera, found: EndOn, radius: float, *, whole: bool) -> None:
    """Draw the face at an end, and the whole tail before it, of a radius in px."""
    from skimage.draw import polygon

    if whole:
        mask |= draw_line(camera.project(found.tail), radius, mask.shape)
    for outline in (
        found.rims(camera, radius)[::-2] if whole else found.rims(camera, radius, most=1)
    ):
        mask[polygon(outline[:, 1], outline[:, 0], mask.shape)] = True


def _same_end(rig: StereoRig, tubes: tuple[Tube, Tube], along: int, end: int) -> int | None:
    """Which end (0 or -1) of the tube in the other view is this one; None where none may be."""
    beside = 1 - along
    free = [one for one in (0, -1) if not tubes[beside].enters[one]]
    if not free or tubes[along].enters[end]:
        return None
    cameras = (rig.a, rig.b)
    here = float(rig.epipolar_angle(cameras[along], tubes[along].line[[end]])[0])
    there = [
        float(rig.epipolar_angle(cameras[beside], tubes[beside].line[[one]])[0]) for one in free
    ]
    return min(zip(free, there, strict=True), key=lambda one: abs(one[1] - here))[0]
