"""How much less the edges of a mask tell than if each were on its own."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from ...arrays import Floats
from .outline import pieces

# Of the rounding to pixels: higher ones are small.
HARMONICS = 3
# Residuals of so many neighboring points of the outline are taken together, to see how much
# less they know than if each were on its own.
IN_A_ROW = 4


def rounding(
    picture: Floats, normals: Floats, weight: Floats, samples: int, together: int
) -> Floats:
    """Variance that an edge shares with its neighbors, times their number, at each point, px².

    Pixels tell an edge that runs along them no better than to one of them, however many they
    are: the rounding is the same for all. It is a sawtooth of the edge's place x, in px; over
    all places of the grid, its mean over a stretch has the variance Σ |⟨exp 2πihx⟩|² / 2π²h²
    (its Fourier series): 1/12 where x stays, nothing where it runs through whole pixels.

    Parameters
    ----------
    picture, normals, weight
        As in `Look`.
    samples : int
        Of the curve.
    together : int
        So many neighboring points are told apart by nothing.

    Returns
    -------
    (k,) array
    """
    shared = np.zeros(len(weight))
    wide = 2 * (together // 2) + 1
    for number, piece in enumerate(pieces(samples)):
        place, edges = picture[piece], weight[piece]
        step = np.gradient(place, axis=0)
        variance = np.zeros(len(place))
        for axis in (0, 1):
            of_axis = np.zeros(len(place))
            for h in range(1, HARMONICS + 1):
                # Between two points of the outline it runs on.
                phase = np.exp(2j * np.pi * h * place[:, axis]) * np.sinc(h * step[:, axis])
                if number < 2:
                    # Taken twice: a mean with a soft window, about as wide as a bell of that size.
                    mean = uniform_filter1d(phase, wide, mode="nearest")
                    mean = uniform_filter1d(mean, wide, mode="nearest")
                else:
                    crossed = edges * np.abs(normals[piece, axis])
                    mean = np.sum(crossed * phase) / max(float(crossed.sum()), 1e-9)
                of_axis += np.abs(mean) ** 2 / (2 * np.pi**2 * h**2)
            variance = np.maximum(variance, of_axis)
        if number < 2:
            count = uniform_filter1d(edges, together, mode="nearest") * together
        else:
            count = np.full(len(edges), float(edges.sum()))
        shared[piece] = variance * count
    return shared


def likeness(weight: Floats, total: Floats, alone: float, samples: int) -> float:
    """How much more the mean of near residuals varies than if they were independent.

    Parameters
    ----------
    weight, total, alone
        As in `Look`.
    samples : int
        Of the curve.

    Returns
    -------
    float
        At least one, which is independent.
    """
    sums, single = 0.0, 0
    for piece in pieces(samples)[:2]:
        rows = samples // IN_A_ROW
        weights = weight[piece][: rows * IN_A_ROW].reshape(rows, IN_A_ROW).sum(axis=1)
        totals = total[piece][: rows * IN_A_ROW].reshape(rows, IN_A_ROW).sum(axis=1)
        seen = weights > 0
        sums += float(np.sum(totals[seen] ** 2 / weights[seen]))
        single += int(seen.sum())
    if single < 4:
        return 1.0
    return max(1.0, sums / single / max(alone, 1e-12))
