"""The two verbs: `reconstruct` one instant, `track` a run of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Protocol

from . import joint_spline
from .baselines import epipolar_search, marker_arcs, needle_fit, point_cloud_som, voxel_carving
from .motion import Motion
from .observation import Observation
from .options import Options
from .reconstruction import HardFrame, Reconstruction
from .stereo_som import METHOD as STEREO_SOM
from .stereo_som import stereo_som
from .thickness import Thickness


class Method(Protocol):
    """What every method looks like."""

    def __call__(
        self, observation: Observation, *, options: Options | None = None
    ) -> Reconstruction:
        """Reconstruct one observation, or raise HardFrame."""


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        joint_spline.METHOD: joint_spline.joint_spline,
        STEREO_SOM: stereo_som,
        point_cloud_som.METHOD: point_cloud_som.point_cloud_som,
        epipolar_search.METHOD: epipolar_search.epipolar_search,
        voxel_carving.METHOD: voxel_carving.voxel_carving,
        marker_arcs.METHOD: marker_arcs.marker_arcs,
        needle_fit.METHOD: needle_fit.needle_fit,
    }
)
DEFAULT_METHOD = joint_spline.METHOD

# Frames that a curve is carried over where a view shows nothing.
_CARRIED = 10
_FEWEST_PIXELS = 20


def reconstruct(
    observation: Observation, *, method: str = DEFAULT_METHOD, options: Options | None = None
) -> Reconstruction:
    """Reconstruct the backbone at one instant.

    Parameters
    ----------
    observation : Observation
    method : str
        A name in `METHODS`.
    options : Options, optional
        The method's own, or `Options` with what is known beforehand.

    Returns
    -------
    Reconstruction
        Of status `failed`, with the reason, where the observation does not allow one.

    Raises
    ------
    ValueError
        Where there is no such method.
    """
    if method not in METHODS:
        raise ValueError(f"method: there is no {method!r}; there are {', '.join(METHODS)}")
    try:
        if observation.defect:
            raise HardFrame(observation.defect)
        return METHODS[method](observation, options=options)
    except ValueError as hard:  # HardFrame, and what its parts refuse: this frame, not the run
        return Reconstruction(
            observation.index, observation.time, "failed", reason=str(hard), method=method
        )


def track(
    observations: Iterable[Observation],
    *,
    method: str = DEFAULT_METHOD,
    options: Options | None = None,
) -> Iterator[Reconstruction]:
    """Reconstruct a run, one result per observation, each starting from the one before.

    Nothing is kept but the last curve, its motion, how thick the device is, and what was tried in
    vain to better it. Where a view shows nothing, the curve is carried on for up to ten frames,
    with status `predicted` and an uncertainty that grows; after that it is `lost` until the device
    is seen again. Where the device is not found near where it is expected, it is searched for anew
    in the whole picture, and the result says so.

    Parameters
    ----------
    observations : iterable of Observation
        In order of time; read one at a time.
    method, options
        As in `reconstruct`; `options.start`, where given, starts the first frame.
    """
    given = options or Options()
    motion: Motion | None = None
    thickness = Thickness()
    for observation in observations:
        start = given.start if motion is None else motion.at(observation.time)
        hidden = _hidden(observation)
        if hidden and motion is not None:
            if observation.index - motion.last.index <= _CARRIED:
                yield motion.predicted(observation.index, observation.time, hidden)
            else:
                since = f"no device since frame {motion.last.index}"
                yield Reconstruction(
                    observation.index, observation.time, "lost", f"{hidden}; {since}", method
                )
            continue
        tried = None if motion is None else motion.last.tried
        followed = replace(given, start=start, tried=tried)
        result = reconstruct(observation, method=method, options=followed)
        if not result.ok and start is not None:
            why = result.reason
            base = given.prior.base if motion is None else start.base
            anew = replace(given, start=None, prior=replace(given.prior, base=base))
            result = reconstruct(observation, method=method, options=anew)
            if result.ok:
                result = replace(result, reason=f"lost and found anew: {why}")
            motion = None if result.ok else motion
        if result.ok and given.prior.radius is None:
            rig = observation.rig
            settled = thickness.settled(
                result, rig, partial(_with_radius, observation, method, followed)
            )
            if settled is result:
                thickness = thickness.after(result, rig)
            result = settled
        yield result
        if result.ok:
            motion = Motion.after(result, motion)


def _with_radius(
    observation: Observation, method: str, options: Options, radius: float
) -> Reconstruction:
    known = replace(options, tried=None, prior=replace(options.prior, radius=radius))
    return reconstruct(observation, method=method, options=known)


def _hidden(observation: Observation) -> str:
    """Why nothing can be told of the device: a view that is as good as empty."""
    for view, pixels in (("a", observation.pixels_a), ("b", observation.pixels_b)):
        if len(pixels) < _FEWEST_PIXELS:
            seen = f"{len(pixels)} device pixels are too few to see a shape"
            return f"view {view}: {seen if len(pixels) else 'no device in the picture'}"
    return ""
