"""As `reference.lengths`."""

from __future__ import annotations

import numpy as np

from ...numba_options import compiled


@compiled
def reach_along(points):  # type: ignore[no-untyped-def]
    """As `reference.reach_along`."""
    reach = np.zeros(len(points))
    for i in range(1, len(points)):
        squared = 0.0
        for axis in range(3):
            squared += (points[i, axis] - points[i - 1, axis]) ** 2
        reach[i] = reach[i - 1] + np.sqrt(squared)
    return reach


@compiled
def evenly(points, reach, count):  # type: ignore[no-untyped-def]
    """As `reference.evenly`."""
    found = np.empty((count, 3))
    last = len(points) - 1
    place = 0
    for k in range(count):
        at = reach[last] / (count - 1) * k
        while place < last and reach[place + 1] <= at:
            place += 1
        if place == last:
            found[k] = points[last]
            continue
        share = (at - reach[place]) / (reach[place + 1] - reach[place])
        for axis in range(3):
            found[k, axis] = (1 - share) * points[place, axis] + share * points[place + 1, axis]
    return found


@compiled
def steps_in_picture(projection, curve):  # type: ignore[no-untyped-def]
    """As `reference.steps_in_picture`."""
    n = len(curve)
    steps = np.empty(n - 1)
    depth, before_x, before_y = 0.0, 0.0, 0.0
    place = np.empty(3)
    for i in range(n):
        for row in range(3):
            place[row] = projection[row, 3]
            for axis in range(3):
                place[row] += projection[row, axis] * curve[i, axis]
        x, y = place[0] / place[2], place[1] / place[2]
        if i > 0:
            steps[i - 1] = np.sqrt((x - before_x) ** 2 + (y - before_y) ** 2)
        before_x, before_y = x, y
        depth += place[2]
    return steps, depth / n


@compiled
def reach_in_pictures(projection_a, focal_a, projection_b, focal_b, curve):  # type: ignore[no-untyped-def]
    """As `reference.reach_in_pictures`."""
    steps_a, depth_a = steps_in_picture(projection_a, curve)
    steps_b, depth_b = steps_in_picture(projection_b, curve)
    reach = np.zeros(len(curve))
    for i in range(len(steps_a)):
        step = max(steps_a[i] * depth_a / focal_a, steps_b[i] * depth_b / focal_b)
        reach[i + 1] = reach[i] + step
    return reach
