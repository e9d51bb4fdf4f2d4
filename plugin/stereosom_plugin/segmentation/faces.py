"""The flat faces of free ends, seen obliquely: they reach beyond where the axis ends."""

from __future__ import annotations

from stereosom.arrays import Floats
from stereosom.camera import StereoRig

from .both_views import end_caps
from .end_on import EndFinder, EndView
from .free_ends import roundness
from .picture import Mask
from .tube import Tube, draw_line, end_face
from .xray import View

# A face that reaches less far into the picture, px, changes nothing.
LEAST = 0.2
# Cosine between the end and the ray from which on an end is taken for one that may fold over.
END_ON = 0.75


def add_faces(
    rig: StereoRig,
    views: tuple[View, View],
    tubes: tuple[Tube, Tube],
    masks: tuple[Mask, Mask],
    finder: EndFinder,
) -> None:
    """Add to both masks, in place, the round that flat end faces add to the silhouette.

    Half of the light marks where the axis of a tube ends; its silhouette reaches farther where
    the end is seen obliquely.

    Parameters
    ----------
    rig : StereoRig
    views : pair of View
    tubes : pair of Tube
        The middle lines that were fitted.
    masks : pair of (rows, columns) array of bool
        As drawn from them and the pictures.
    finder : EndFinder
        Of this run.
    """
    reaches = end_caps(rig, *tubes)
    cameras = (rig.a, rig.b)
    done: set[tuple[int, int]] = set()
    for along in (0, 1):
        beside = 1 - along
        for end, reach in zip((0, -1), reaches[along], strict=True):
            if reach < END_ON * tubes[along].radius[end]:
                continue
            other = _same_end(rig, tubes, along, end)
            if other is None or (along, end) in done:
                continue
            found = finder.find(
                rig,
                EndView(cameras[along], tubes[along], end),
                EndView(cameras[beside], tubes[beside], other),
                views[along].picture,
                masks[along],
            )
            if found is None:
                continue
            masks[along][...] |= draw_line(
                cameras[along].project(found.tail),
                float(tubes[along].radius[end]),
                masks[along].shape,
            )
            for side, which in ((along, end), (beside, other)):
                radius = float(tubes[side].radius[which])
                draw_outline(masks[side], found.face(cameras[side], radius))
                done.add((side, which))
    for side in (0, 1):
        for end, reach in zip((0, -1), reaches[side], strict=True):
            if (side, end) in done or reach <= LEAST or tubes[side].enters[end]:
                continue
            flat = 1 - roundness(views[side].picture, tubes[side], end)
            masks[side][...] |= end_face(tubes[side], end, reach * flat, masks[side].shape)


def draw_outline(mask: Mask, outline: Floats) -> None:
    """Set the pixels within an outline (n, 2), px."""
    from skimage.draw import polygon

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
