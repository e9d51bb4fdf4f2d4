"""What light a round tube takes, across it."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from stereosom.arrays import Floats


def tube_profile(place: Floats, chords: Floats, parameters: Floats) -> tuple[Floats, Floats]:
    """Share of light that a round tube takes at places across it, (n,), and its slopes, (n, 4).

    The profile is a sum of nested boxes, whose blur is a difference of normal distributions.

    Parameters
    ----------
    place : (n,) array
        px.
    chords : (m,) array
        Half-widths of the boxes, as shares of the radius.
    parameters : (4,) array
        Radius, px, absorption on the axis, blur, px, and center, px.
    """
    radius, absorption, blur, center = parameters
    through = np.sqrt(1 - chords**2)
    passes = np.exp(-absorption * through)
    weight = -np.diff(1 - passes, append=0)
    grows = -np.diff(through * passes, append=0)
    wide = chords + 0.5 / len(chords)
    right = (place[:, None] - center + radius * wide) / blur
    left = (place[:, None] - center - radius * wide) / blur
    inside = ndtr(right) - ndtr(left)
    high, low = (np.exp(-(edge**2) / 2) / np.sqrt(2 * np.pi) for edge in (right, left))
    slopes = [
        (high + low) @ (weight * wide) / blur,
        inside @ grows,
        (left * low - right * high) @ weight / blur,
        (low - high) @ weight / blur,
    ]
    return inside @ weight, np.stack(slopes, axis=1)


def fitted_profile(
    place: Floats,
    chords: Floats,
    taken: Floats,
    start: Floats,
    low: Floats,
    high: Floats,
    sure: Floats,
) -> Floats:
    """Parameters of the tube that takes light like this, by Gauss and Newton's steps.

    Parameters
    ----------
    place, chords : (n,), (m,) array
        As in `tube_profile`.
    taken : (n,) array
        Share of light.
    start, low, high : (4,) array
        Parameters to begin with, which are the expected ones too, and their bounds.
    sure : (4,) array
        How well each of them is known beforehand.
    """
    found = start
    for _ in range(12):
        model, slopes = tube_profile(place, chords, found)
        pull = slopes.T @ (taken - model) + sure * (start - found)
        step = np.linalg.solve(slopes.T @ slopes + np.diag(sure + 1e-6), pull)
        step = np.clip(step, -0.4 * np.abs(found) - 0.2, 0.4 * np.abs(found) + 0.2)
        found = np.clip(found + step, low, high)
        if np.abs(step).max() < 2e-3:
            break
    return np.asarray(found)
