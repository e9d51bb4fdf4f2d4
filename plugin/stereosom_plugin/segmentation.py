"""From a picture to a mask: which pixels show the device.

Any function that maps an image to a boolean mask of its size can stand in for
`segment_xray` in `observe`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from stereosom.arrays import Floats, check_array
from stereosom.observation import Observation

from .acquisition import Acquisition, Image
from .errors import InputError, require
from .lens import Lens, undistorted_field, undistorted_mask_pixels

Mask = npt.NDArray[np.bool_]
Segment = Callable[[Image], Mask]

# A metal tube takes three quarters of the light that meets its axis; blur leaves a thin one more
# than half. Bone edges and the leads of electrodes stay below the second of these.
LEAST_PIXEL, LEAST_AXIS = 0.4, 0.5
# Absorption is a share, so it is the same before air and bone: it varies along a device by less
# than this share of itself, along wires, clips and circuits by more.
GREATEST_VARIATION = 0.07
# Shares of the absorption on the axis. At the edge of an unblurred round tube lies less than a
# half, at that of a blurred thin one more. What is fainter than the core is no tube by itself.
EDGE, CORE = 0.45, 0.7


def segment_xray(
    image: Any, *, field_of_view: Any | None = None, width_px: float | None = None
) -> Mask:
    """Find the pixels of one dark tube, metal in an X-ray picture.

    The share of light that thin things absorb is one minus the picture over its
    morphological closing (the black top-hat transform, as a quotient because absorption
    multiplies: P. Soille, "Morphological Image Analysis", 2nd edition, chapter 4). Of what
    stands out of the noise, the device is the longest piece that is thin and absorbs evenly.
    Its edges are where it absorbs about half of what its axis does.

    Parameters
    ----------
    image : (rows, columns) array
        In proportion to the light: dark where much is absorbed.
    field_of_view : (m, 2) array, optional
        Corners (x, y), px, of the region in which the picture shows anything.
    width_px : float, optional
        Greatest width that the device may have. Default: 12 px per 512 px of picture.

    Returns
    -------
    (rows, columns) array of bool
        True on the device, filled to its edges; all False where none is seen.

    Raises
    ------
    InputError
        Where the image has no two dimensions or holds values that are not finite.

    Examples
    --------
    >>> picture = np.full((200, 200), 1000)
    >>> picture[50:, 98:103] = 250  # enters from below, 5 pixels wide
    >>> mask = segment_xray(picture)
    >>> mask[100].nonzero()[0]
    array([ 98,  99, 100, 101, 102])
    """
    picture = np.maximum(_checked(image), 0)
    side = max(picture.shape)
    if width_px is None:
        width_px = 12 * side / 512
    if field_of_view is not None:
        picture = np.where(_inside(field_of_view, picture.shape), picture, 0)
    absorption, field = _absorption(picture, width_px)
    if not field.any():
        return np.zeros(picture.shape, dtype=bool)
    usual = np.median(absorption[field])
    noise = 1.4826 * np.median(np.abs(absorption[field] - usual))
    dark = absorption > max(LEAST_PIXEL, usual + 5 * noise)

    # One wide: pieces that touch at corners, or are torn by a noisy pixel, are one.
    labels = _label(dark)
    axes = require("skimage.morphology", "fluoroscopy").skeletonize(dark)
    length = np.bincount(labels[axes], minlength=labels.max() + 1)
    width = np.bincount(labels.ravel()) / np.maximum(length, 1)
    enters = np.bincount(labels[_rim(field)], minlength=len(length)) > 0
    # A device comes from outside. One that does not must be long to be believed.
    plausible = (length >= np.where(enters, side / 12, side / 4)) & (length >= 6 * width)
    plausible &= width <= 1.3 * width_px
    for label in np.argsort(-length):
        if label == 0 or not plausible[label]:
            continue
        along = absorption[axes & (labels == label)]
        typical = np.median(along)
        variation = np.median(np.abs(along - typical))
        even = variation <= GREATEST_VARIATION * typical + noise / 3
        if even and typical >= LEAST_AXIS:
            return _fill(absorption, labels == label, float(typical))
    return np.zeros(picture.shape, dtype=bool)


def binary(image: Any) -> Mask:
    """Take the pixels above half of the picture's range; a constant picture has none.

    Parameters
    ----------
    image : (rows, columns) array
        A mask as a picture: device bright.

    Returns
    -------
    (rows, columns) array of bool

    Raises
    ------
    InputError
        Where the image has no two dimensions or holds values that are not finite.

    Examples
    --------
    >>> binary([[0, 255], [127, 128]])
    array([[False,  True],
           [False,  True]])
    """
    picture = _checked(image)
    return np.asarray(picture > (picture.min() + picture.max()) / 2)


def observe(
    acquisition: Acquisition,
    segment: Segment = segment_xray,
    *,
    frames: Iterable[int] | None = None,
) -> Iterator[Observation]:
    """Yield what both views saw, one frame at a time.

    Parameters
    ----------
    acquisition : Acquisition
    segment : callable, optional
        Image to mask, for both views. `segment_xray` is told each view's field.
    frames : iterable of int, optional
        Numbers of the frames that are wanted. Default: all.

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
    segment_a = segment_b = segment
    if segment is segment_xray and acquisition.field_of_view is not None:
        segment_a, segment_b = (
            partial(segment_xray, field_of_view=corners) for corners in acquisition.field_of_view
        )
    for index in range(len(acquisition)) if frames is None else frames:
        rig = acquisition.rig(index)
        mask_a, mask_b = (
            np.zeros(camera.image_size[::-1], dtype=bool) for camera in (rig.a, rig.b)
        )
        defect = ""
        try:
            pair = acquisition[index]
            mask_a, mask_b = segment_a(pair.image_a), segment_b(pair.image_b)
        except InputError as error:
            defect = str(error)
        seen = Observation.from_masks(
            mask_a,
            mask_b,
            rig,
            time=float(acquisition.times[index]),
            index=index,
            field_of_view=acquisition.field_of_view,
            defect=defect,
        )
        yield _undistorted(seen, (mask_a, mask_b), acquisition.lenses)


def _undistorted(
    seen: Observation, masks: tuple[Mask, Mask], lenses: tuple[Lens, Lens] | None
) -> Observation:
    """The observation of ideal cameras: the device's pixels, and where the views end."""
    if lenses is None or seen.defect:
        return seen
    assert seen.field_of_view is not None
    try:
        pixels = [undistorted_mask_pixels(*pair) for pair in zip(masks, lenses, strict=True)]
    except ValueError as error:
        return replace(
            seen, pixels_a=np.empty((0, 2)), pixels_b=np.empty((0, 2)), defect=str(error)
        )
    field_a, field_b = (
        undistorted_field(*view) for view in zip(seen.field_of_view, lenses, masks, strict=True)
    )
    return replace(seen, pixels_a=pixels[0], pixels_b=pixels[1], field_of_view=(field_a, field_b))


def _checked(image: Any) -> Floats:
    """Return the image as floats, (rows, columns), or say what is wrong with it."""
    array = np.asarray(image)
    if array.ndim != 2 or array.size == 0:
        shape = "×".join(map(str, array.shape)) or "a single number"
        raise InputError("image", f"is {shape}, not rows × columns", "give one gray picture")
    try:
        picture: Floats = array.astype(np.float64)
    except (TypeError, ValueError):
        raise InputError("image", "does not hold numbers", "give one gray picture") from None
    if not np.isfinite(picture).all():
        raise InputError("image", "holds values that are not finite", "give every pixel a value")
    return picture


def _inside(corners: Any, shape: tuple[int, ...]) -> Mask:
    corners = check_array(corners, "field of view", (None, 2))
    draw = require("skimage.draw", "fluoroscopy")
    return np.asarray(draw.polygon2mask(shape, corners[:, ::-1]))


def _absorption(picture: Floats, width: float) -> tuple[Floats, Mask]:
    """Share of light absorbed by what is thinner than twice `width`, and where light came.

    Around the picture lies darkness: a strip between its border and the round edge of an
    image intensifier is then part of that, not thin.
    """
    smooth = ndimage.gaussian_filter(picture.astype(np.float32), 0.7)
    window = 2 * round(width) + 1
    padded = np.pad(smooth, window)
    closed = ndimage.minimum_filter(ndimage.maximum_filter(padded, window), window)
    light = closed[window:-window, window:-window]
    field = light > 0.01 * light.max()
    return np.where(field, 1 - smooth / np.where(field, light, 1), 0), field


def _label(dark: Mask) -> npt.NDArray[np.int32]:
    """Number the pieces of a mask from one; gaps of two pixels do not divide."""
    square = np.ones((3, 3), dtype=bool)
    labels, _ = ndimage.label(ndimage.binary_dilation(dark, square), square)
    return np.asarray(labels * dark, dtype=np.int32)


def _rim(field: Mask) -> Mask:
    """Pixels of the field within three of its end."""
    inner = ndimage.minimum_filter(np.pad(field, 1), 7)[1:-1, 1:-1]
    return np.asarray(field & ~inner)


def _fill(absorption: Floats, piece: Mask, typical: float) -> Mask:
    """Fill the tube to its edges, without the fainter things that touch it."""
    labels = _label(piece & (absorption > CORE * typical))
    core = labels == 1 + np.argmax(np.bincount(labels.ravel())[1:])
    near = ndimage.binary_dilation(core, np.ones((3, 3), dtype=bool), iterations=2)
    return np.asarray(near & (absorption > EDGE * typical))
