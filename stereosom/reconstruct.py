"""The two verbs: `reconstruct` one instant, `track` a run of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Protocol

from . import joint_spline
from .baselines import epipolar_search, marker_arcs, needle_fit, point_cloud_som, voxel_carving
from .observation import Observation
from .options import Options
from .reconstruction import HardFrame, Reconstruction
from .stereo_som import METHOD as STEREO_SOM
from .stereo_som import stereo_som


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

    Nothing is kept but the last curve. A frame that fails from the last curve is tried again
    without it before it counts as failed.

    Parameters
    ----------
    observations : iterable of Observation
        In order of time; read one at a time.
    method, options
        As in `reconstruct`; `options.start`, where given, starts the first frame.
    """
    given = options or Options()
    following = given
    for observation in observations:
        result = reconstruct(observation, method=method, options=following)
        if not result.ok and following.start is not None:
            result = reconstruct(observation, method=method, options=replace(given, start=None))
        yield result
        if result.backbone is not None:
            following = replace(given, start=result.backbone)
