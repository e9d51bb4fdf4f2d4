"""`observe`: from an acquisition to what both views saw of the device, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np

from stereosom.backbone import Backbone
from stereosom.observation import Kind, Observation
from stereosom_plugin.acquisition import Acquisition, FramePair, Image
from stereosom_plugin.errors import InputError
from stereosom_plugin.lens import undistorted_observation

from .biplane import BiplaneSegmenter
from .mask_files import MaskFiles
from .picture import Mask
from .xray import segment_xray

Segment = Callable[[Image], Mask]
Segmentation = Segment | tuple[Segment, Segment] | MaskFiles
Expected = Callable[[], Backbone | None]
Show = Callable[[int, FramePair, Mask, Mask], None]


def observe(
    acquisition: Acquisition,
    segment: Segmentation = segment_xray,
    *,
    kind: Kind = "filled",
    frames: Iterable[int] | None = None,
    expected: Expected | None = None,
    show: Show | None = None,
) -> Iterator[Observation]:
    """Yield what both views saw, one frame at a time.

    With the default `segment_xray`, both views and the frames before are used too: a line in
    one view must have its partner in the other, and is looked for near where it was
    (`BiplaneSegmenter`).

    Parameters
    ----------
    acquisition : Acquisition
    segment : callable, pair of callables or MaskFiles, optional
        Image to mask, for both views, or one for each; or masks that are files.
    kind : {'filled', 'edges'}
        Whether the masks fill the device or trace its edges.
    frames : iterable of int, optional
        Numbers of the frames that are wanted. Default: all.
    expected : callable, optional
        Asked before each frame where the device is expected: a backbone, mm, or None. Default:
        where it was seen last.
    show : callable, optional
        Given each frame's number, pictures, and masks of view a and view b.

    Yields
    ------
    Observation
        One per frame, in that order, free of lens distortion. A view in which no device was
        found has no pixels; where a frame cannot be read or segmented, its `defect` says why,
        and the next one follows.

    Raises
    ------
    ValueError
        Where a mask has another size than its camera's picture: then all of them have.
    """
    both = BiplaneSegmenter(acquisition) if segment is segment_xray else None
    for index in range(len(acquisition)) if frames is None else frames:
        rig = acquisition.rig(index)
        mask_a, mask_b = (
            np.zeros(camera.image_size[::-1], dtype=bool) for camera in (rig.a, rig.b)
        )
        described: dict[str, Any] = {"field_of_view": acquisition.field_of_view, "kind": kind}
        try:
            pair = acquisition[index]
            if both is not None:
                mask_a, mask_b = both(pair, expected() if expected else None)
            elif isinstance(segment, MaskFiles):
                mask_a, mask_b = segment.masks(index)
            else:
                segment_a, segment_b = segment if isinstance(segment, tuple) else (segment,) * 2
                mask_a, mask_b = segment_a(pair.image_a), segment_b(pair.image_b)
            if show is not None:
                show(index, pair, mask_a, mask_b)
        except InputError as error:
            described["defect"] = str(error)
        described |= {"time": float(acquisition.times[index]), "index": index}
        if acquisition.lenses and "defect" not in described:
            yield undistorted_observation((mask_a, mask_b), acquisition.lenses, rig, **described)
        else:
            yield Observation.from_masks(mask_a, mask_b, rig, **described)
