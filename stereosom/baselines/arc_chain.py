"""Circular arcs in a row, tangent-continuous, and their least-squares fit to points.

The piecewise constant curvature of M. W. Hannan, I. D. Walker, "Real-time shape estimation for
continuum robots using vision", Robotica 23, 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ..arrays import Floats, check_array
from ..backbone import Backbone

# Samples of each arc, when the nearest point of the chain is looked for.
_PER_ARC = 100


@dataclass(frozen=True, eq=False)
class ArcChain:
    """Circular arcs in a row, each leaving in the direction in which the one before ends.

    Parameters
    ----------
    base : (3,) array
        Where it begins, mm.
    frame : Rotation
        At the base; its third column is the tangent.
    bends : (m, 2) array
        Of each arc its angle, rad, as a vector in the plane across its beginning: the
        direction is the one it bends to.
    lengths : (m,) array
        mm.
    """

    base: Floats
    frame: Rotation
    bends: Floats
    lengths: Floats

    @property
    def curvatures(self) -> Floats:
        """Curvature of each arc, (m,), 1/mm."""
        return np.asarray(np.linalg.norm(self.bends, axis=1) / self.lengths)

    def sample(self, per_arc: int = _PER_ARC) -> tuple[Floats, Floats]:
        """Points and unit tangents at equal steps of each arc, (m · per_arc + 1, 3) each."""
        share = np.linspace(0, 1, per_arc + 1)
        base, frame = self.base, self.frame
        points, tangents = [base[None]], [frame.apply([[0.0, 0.0, 1.0]])]
        for bend, length in zip(self.bends, self.lengths, strict=True):
            angle = float(np.linalg.norm(bend))
            # sin(ta)/a and (1 − cos ta)/a², both fit for an arc that is straight.
            forward = share * np.sinc(share * angle / np.pi)
            aside = (share * np.sinc(share * angle / (2 * np.pi))) ** 2 / 2
            local = length * np.column_stack([aside * bend[0], aside * bend[1], forward])
            turned = share * np.sinc(share * angle / np.pi)
            local_tangent = np.column_stack(
                [turned * bend[0], turned * bend[1], np.cos(share * angle)]
            )
            points.append(base + frame.apply(local[1:]))
            tangents.append(frame.apply(local_tangent[1:]))
            base = points[-1][-1]
            frame = frame * Rotation.from_rotvec([-bend[1], bend[0], 0.0])
        return np.concatenate(points), np.concatenate(tangents)

    def backbone(self) -> Backbone:
        """The chain as a curve."""
        return Backbone.through(self.sample()[0])


def fit_arcs(points: Any, arcs: int) -> ArcChain:
    """Least-squares chain of tangent-continuous arcs from the first point to the last.

    Parameters
    ----------
    points : (n, 3) array
        Along the device, mm; at least four.
    arcs : int
        Lowered to what the points determine: 2n + 2 numbers for 3 arcs + 5 unknowns.

    Raises
    ------
    ValueError
        Where there are fewer than four points, or they lie in one place.

    Examples
    --------
    A half circle of radius 10 mm is one arc of curvature 0.1/mm:

    >>> angle = np.linspace(0, np.pi, 9)
    >>> around = 10 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)])
    >>> fit_arcs(around, 1).curvatures.round(3)
    array([0.1])
    """
    points = check_array(points, "points", (None, 3))
    if len(points) < 4:
        raise ValueError(f"points: {len(points)} are too few for arcs; give at least 4")
    arcs = max(1, min(arcs, (2 * len(points) - 3) // 3))
    rough = Backbone.through(points)  # refuses points in one place
    heading = rough.tangent(rough.arc_lengths(arcs + 1))
    across = np.linalg.svd(heading[:1])[2][1]
    frame = Rotation.from_matrix(
        np.column_stack([across, np.cross(heading[0], across), heading[0]])
    )
    bends, turned = np.empty((arcs, 2)), frame
    for arc in range(arcs):
        x, y, z = turned.inv().apply(heading[arc + 1])
        aside = float(np.hypot(x, y))
        bends[arc] = np.arctan2(aside, z) / max(aside, 1e-12) * np.array([x, y])
        turned = turned * Rotation.from_rotvec([-bends[arc, 1], bends[arc, 0], 0.0])

    def chain(unknowns: Floats) -> ArcChain:
        turn = Rotation.from_rotvec([unknowns[3], unknowns[4], 0.0])
        return ArcChain(
            base=points[0] + rough.length * unknowns[:3],
            frame=frame * turn,
            bends=unknowns[5 : 5 + 2 * arcs].reshape(arcs, 2),
            lengths=rough.length / arcs * np.exp(unknowns[5 + 2 * arcs :]),
        )

    def residuals(unknowns: Floats) -> Floats:
        samples, tangents = chain(unknowns).sample()
        nearest = np.asarray(cKDTree(samples).query(points[1:-1])[1])
        offset = points[1:-1] - samples[nearest]
        along = np.sum(offset * tangents[nearest], axis=1, keepdims=True)
        ends = points[[0, -1]] - samples[[0, -1]]
        return np.concatenate([(offset - along * tangents[nearest]).ravel(), ends.ravel()])

    begin = np.concatenate([np.zeros(5), bends.ravel(), np.zeros(arcs)])
    return chain(least_squares(residuals, begin, max_nfev=60).x)
