"""Which picture of the left eye belongs to which of the right one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stereosom.arrays import Floats

Numbers = npt.NDArray[np.intp]


def pair_by_time(left: Floats, right: Floats) -> tuple[Numbers, Numbers, tuple[str, ...]]:
    """Pair frames by their times; each is used once at most.

    Parameters
    ----------
    left, right : (n,), (m,) array
        Seconds, increasing.

    Returns
    -------
    numbers_left, numbers_right : (k,) array
        Frames that make a pair: each the other's nearest, less than half a frame apart.
    notes : tuple of str
        What did not go as it should, one sentence each.

    Examples
    --------
    >>> pair_by_time(np.array([0, 0.1, 0.2, 0.3]), np.array([0.0, 0.2]))[:2]
    (array([0, 2]), array([0, 1]))
    """
    steps = [float(np.median(np.diff(each))) for each in (left, right) if len(each) > 1]
    reach = 0.5 * min(steps) if steps else np.inf
    to_right, to_left = _nearest(left, right), _nearest(right, left)
    numbers = np.arange(len(left))
    mutual = to_left[to_right] == numbers
    near = np.abs(left - right[to_right]) <= reach + 1e-9
    chosen = numbers[mutual & near]
    partners = to_right[chosen]
    return chosen, partners, _notes(left, right, chosen, partners, steps)


def _notes(
    left: Floats, right: Floats, chosen: Numbers, partners: Numbers, steps: list[float]
) -> tuple[str, ...]:
    notes = []
    if len(steps) == 2 and abs(steps[0] - steps[1]) > 1e-3 * max(steps):
        rates = " and ".join(f"{1 / step:.4g}" for step in steps)
        notes.append(f"left and right eye have {rates} frames per second; paired by time")
    if len(left) != len(right):
        notes.append(
            f"left eye has {len(left)} frames, the right one {len(right)}: "
            f"{len(chosen)} pairs by time"
        )
    ends = [float(each[-1]) + (steps[0] if steps else 0) for each in (left, right)]
    if steps and abs(ends[0] - ends[1]) > 1.5 * max(steps):
        eye = "left" if ends[0] < ends[1] else "right"
        notes.append(
            f"the {eye} eye's film ends at {min(ends):.2f} s, {abs(ends[0] - ends[1]):.2f} s "
            "before the other's: what follows has no pair"
        )
    if len(chosen):
        apart = float(np.abs(left[chosen] - right[partners]).max())
        if apart > 1e-3:
            notes.append(f"paired frames are up to {apart * 1e3:.0f} ms apart")
    return tuple(notes)


def _nearest(of: Floats, among: Floats) -> Numbers:
    """For each time, the number of the nearest among others."""
    after = np.clip(np.searchsorted(among, of), 1, max(len(among) - 1, 1))
    if len(among) == 1:
        return np.zeros(len(of), dtype=np.intp)
    return np.asarray(after - (of - among[after - 1] <= among[after] - of), dtype=np.intp)
