"""A guess that is brought onto the masks before it is fitted."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats
from ..observation import Observation
from ..vectors import dot
from .kernels import kernels
from .spline import spline_basis

# The guess is moved as a spline of so many pieces is: a walk along pixels is no smooth curve.
_PIECES = 8
# A walk along less than such a share of the guess lost its way.
_LEAST = 0.5
# A fit finds by itself, and better, what is nowhere so many radii beside the guess.
_NEAR = 1.0


def walked(seen: Observation, guess: Floats, radius: float, rounded: tuple[bool, bool]) -> Floats:
    """A guess (n, 3) at even steps, moved to where the masks have the device, where it is not.

    A fit finds what is near in the pictures. What bends or swings by more than its width from one
    frame to the next is followed from where it lies on both masks, step by step, to its ends.

    Parameters
    ----------
    seen : Observation
        From two sides: views that look the same way do not tell how the device turns.
    guess : (n, 3) array
        mm.
    radius : float
        Of the device, mm.
    rounded : (bool, bool)
        Whether the base, and the tip, is half a ball.
    """
    rig, count = seen.rig, len(guess)
    path, first = kernels().walk(
        rig.a.projection,
        seen.pixels_a,
        rig.b.projection,
        seen.pixels_b,
        guess,
        radius,
        np.array(rounded),
    )
    if len(path) < _LEAST * count:
        return guess
    both = slice(max(first, 0), first + len(path))
    stray = path[max(-first, 0) :][: len(guess[both])] - guess[both]
    if np.all(dot(stray, stray) < (_NEAR * radius) ** 2):
        return guess
    even = kernels().evenly(path, kernels().reach_along(path), count)
    basis = spline_basis(_PIECES, count)
    return np.asarray(guess + basis.values @ basis.through(even - guess))
