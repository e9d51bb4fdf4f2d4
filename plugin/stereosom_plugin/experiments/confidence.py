"""Does the truth lie where a result says that it lies? Squared distances in stated deviations."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from stereosom.arrays import Booleans, Floats, Integers
from stereosom.backbone import Backbone
from stereosom.metrics import closest_on_curve
from stereosom.reconstruction import Reconstruction

# A stated deviation below a nanometer is none.
_LEAST_VARIANCE = 1e-12


@dataclass(frozen=True, eq=False)
class Offsets:
    """Offsets of true points from a result, each beside what the result says of it.

    Parameters
    ----------
    arc_lengths : (n,) array
        Of the true points, mm.
    offset : (n, 3) array
        From the result to the true point, mm: across the result's curve; between the ends, where
        both are ends.
    squared : (n,) array
        The offset's square in units of the stated covariance: χ² distributed if that is right.
    freedom : (n,) array of int
        Its degrees of freedom: two across the curve, three at an end.
    deviation : (n,) array
        The stated `StandardDeviation` there, mm.
    determined : (n,) array of bool
    result : Reconstruction
        The result, running as the truth does.
    turned : bool
        Whether it had to be turned for that.
    """

    arc_lengths: Floats
    offset: Floats
    squared: Floats
    freedom: Integers
    deviation: Floats
    determined: Booleans
    result: Reconstruction
    turned: bool

    @property
    def level(self) -> Floats:
        """Least nominal level whose stated region holds the true point, (n,), 0 to 1."""
        return np.asarray(chi2.cdf(self.squared, self.freedom))

    @property
    def ends(self) -> Booleans:
        """Which points are ends, (n,)."""
        return np.asarray(self.freedom == 3)


def offsets(
    result: Reconstruction,
    truth: Backbone,
    *,
    stretch: tuple[float, float] | None = None,
    count: int = 100,
) -> Offsets:
    """Compare a result with the truth in units of what it states.

    A true point inside is compared with the place of the result that is nearest to it, in the
    plane across the result there; true base and tip are compared with the result's, in full.
    Which end is the base is not judged here: a result that runs the other way is turned.

    Parameters
    ----------
    result : Reconstruction
        With a backbone.
    truth : Backbone
    stretch : (float, float), optional
        Arc lengths of the truth between which it is seen, mm. An end of the stretch inside the
        truth is no end of the device. Default: all of it.
    count : int
        True points, at equal steps of arc length.
    """
    found = result.backbone
    if found is None or result.covariance is None:
        raise ValueError(f"frame {result.index} has no backbone: {result.reason}")
    start, stop = stretch or (0.0, truth.length)
    s = np.linspace(start, stop, count)
    points = truth(s)
    turned = bool(_gap(found.tip, points[0]) + _gap(found.base, points[-1])
                  < _gap(found.base, points[0]) + _gap(found.tip, points[-1]))  # fmt: skip
    if turned:
        # Its covariance follows, as it is by equal steps; so does what is derived of it.
        found = found.reversed()
        result = replace(result, backbone=found, covariance=result.covariance[::-1])
    _, at = closest_on_curve(points, found)
    freedom = np.full(count, 2)
    for place, end, true_end in ((0, 0.0, 0.0), (-1, found.length, truth.length)):
        if np.isclose(s[place], true_end):
            at[place], freedom[place] = end, 3
    offset = points - found(at)
    tangent = found.tangent(at)
    inside = freedom == 2
    offset[inside] -= np.sum(offset * tangent, axis=1)[inside, None] * tangent[inside]
    covariance = result.covariance_at(at) + _LEAST_VARIANCE * np.eye(3)
    # The variance along the curve is no matter where the offset has no such part.
    covariance[inside] += 1e6 * (tangent[:, :, None] * tangent[:, None, :])[inside]
    squared = np.einsum("ni,ni->n", offset, np.linalg.solve(covariance, offset[:, :, None])[..., 0])
    return Offsets(
        s,
        offset,
        squared,
        freedom,
        result.standard_deviation_at(at),
        result.determined_at(at),
        result,
        turned,
    )


def _gap(one: Floats, other: Floats) -> float:
    return float(np.linalg.norm(one - other))
