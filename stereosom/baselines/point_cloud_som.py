"""The conventional self-organizing map: a point cloud in space in, an ordered curve out.

Section II-A of J. M. Croom, D. C. Rucker, J. M. Romano, R. J. Webster III, "Visual sensing of
continuum robot shape using self-organizing maps", IEEE ICRA 2010, after G. S. Kumar,
P. K. Kalra, S. G. Dhande, Applied Soft Computing 5, 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Floats, check_array
from ..observation import Observation
from ..options import Options, check_whole
from ..reconstruction import HardFrame, Reconstruction
from ..som import Trainer, adjacency_matrix, best_two_units, order_by_adjacency
from .epipolar_search import check_search, matched_cloud
from .ordering import begin, finish

METHOD = "point-cloud-som"

_BOUNDS = {
    "reference_vectors": (3, 1000),
    "epochs": (1, 100),
    "passes": (1, 100),
    "neighborhood": (0, 1000),
    "seed": (0, 2**32 - 1),
}


@dataclass(frozen=True, eq=False)
class PointCloudSomOptions(Options):
    """Options of the map.

    Parameters
    ----------
    reference_vectors : int
        The paper's k.
    epochs : int
        Of batch training after each ordering.
    passes : int
        How often the reference vectors are ordered and trained.
    neighborhood : int
        The range n of equation (2).
    points_per_view : int, optional
        Pixels drawn from each view for the cloud; None takes all.
    tolerance : float
        How far a pixel's partner may lie from its epipolar line, px.
    seed : int
        Of the random sample of the cloud that the map starts from.

    Raises
    ------
    ValueError
        Where a number is out of range.
    """

    reference_vectors: int = 50
    epochs: int = 10
    passes: int = 3
    neighborhood: int = 1
    points_per_view: int | None = 800
    tolerance: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        for name, (least, most) in _BOUNDS.items():
            check_whole(getattr(self, name), name, least, most)
        check_search(self.points_per_view, self.tolerance)


def point_cloud_som(observation: Observation, *, options: Options | None = None) -> Reconstruction:
    """Reconstruct the backbone by a map trained on the cloud that epipolar matching gives.

    Parameters
    ----------
    observation : Observation
    options : PointCloudSomOptions, optional

    Raises
    ------
    HardFrame
        Where the pixels of this observation do not allow it.

    Examples
    --------
    A quarter circle of radius 60 mm is 94 mm long:

    >>> from stereosom.synthetic import arc, converging_rig, observe
    >>> result = point_cloud_som(observe(arc(60, 90), radius=1.0, rig=converging_rig(60)))
    >>> 92 < result.backbone.length < 98
    True
    """
    if not isinstance(options, PointCloudSomOptions):
        shared = options or Options()
        options = PointCloudSomOptions(prior=shared.prior, start=shared.start)
    seen, ends = begin(observation, options)
    cloud, _ = matched_cloud(seen, ends, options.points_per_view, options.tolerance)
    if len(cloud) < options.reference_vectors:
        raise HardFrame(
            f"the views agree on {len(cloud)} points, fewer than the "
            f"{options.reference_vectors} reference vectors"
        )
    references = order_cloud(
        cloud,
        reference_vectors=options.reference_vectors,
        epochs=options.epochs,
        passes=options.passes,
        neighborhood=options.neighborhood,
        start=None if options.start is None else options.start.sample(options.reference_vectors),
        seed=options.seed,
    )
    return finish(seen, references, ends, options, METHOD)


def order_cloud(
    points: Any,
    reference_vectors: int = 50,
    epochs: int = 10,
    passes: int = 3,
    neighborhood: int = 1,
    start: Floats | None = None,
    seed: int = 0,
) -> Floats:
    """Train a string of reference vectors on a point cloud, in order along it.

    Parameters
    ----------
    points : (n, 3) array
        In no order, mm.
    reference_vectors, epochs, passes, neighborhood, seed : int
        As in `PointCloudSomOptions`.
    start : (k, 3) array, optional
        Where to start, such as the curve of the frame before. Default: a random sample.

    Returns
    -------
    (m, 3) array
        From one end or the other, mm; m ≤ k, as those without a point leave.

    Raises
    ------
    ValueError
        Where there are fewer points than reference vectors, or all lie in one place.

    Examples
    --------
    Points of a line in any order come out in its order:

    >>> line = np.random.default_rng(0).permutation(np.linspace(0, 10, 200))
    >>> x = order_cloud(np.outer(line, [1, 0, 0]), reference_vectors=10)[:, 0]
    >>> bool(np.all(np.diff(x) > 0) or np.all(np.diff(x) < 0))
    True
    """
    points = check_array(points, "points", (None, 3))
    if len(points) < reference_vectors:
        raise ValueError(
            f"points: {len(points)} cannot train {reference_vectors} reference vectors"
        )
    if not np.ptp(points, axis=0).any():
        raise ValueError("points: all lie in one place")
    trainer = Trainer(points)
    if start is None:
        ordered = points[np.lexsort(points.T)]  # the sample must not depend on their order
        sample = np.random.default_rng(seed).choice(len(points), reference_vectors, replace=False)
        references = ordered[sample]
        # Without neighbors the sample only spreads out evenly, which makes for a clear order.
        references = _train(trainer, references, epochs, 0)
    else:
        references = check_array(start, "start", (None, 3))
    for _ in range(passes):
        best, second = best_two_units(points, references)
        adjacency = adjacency_matrix(best, second, len(references))
        references = references[order_by_adjacency(adjacency)]
        references = _train(trainer, references, epochs, neighborhood)
    return references


def _train(trainer: Trainer, references: Floats, epochs: int, neighborhood: int) -> Floats:
    """Batch training; reference vectors without points are removed, as in the paper."""
    for _ in range(epochs):
        references, counts = trainer.epoch(references, neighborhood)
        references = references[counts > 0]
        if len(references) < 2:
            raise ValueError("points: too few different places for a curve")
    return references
