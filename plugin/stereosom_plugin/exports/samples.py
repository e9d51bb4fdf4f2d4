"""A centerline at few points, with the scalar arrays that other programs show."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from stereosom.arrays import Floats

from ..centerline import Centerline
from ..errors import InputError

# What colors a tube, and its unit.
UNITS = {"Curvature": "1/mm", "StandardDeviation": "mm", "Torsion": "1/mm", "Radius": "mm"}
# Where no radius is known, the tube is this share of the device's length.
_ASSUMED_RADIUS = 1 / 200


@dataclass(frozen=True, eq=False)
class Sample:
    """Points (n, 3) at equal steps of arc length `s` (n,), mm, and arrays (n,) by name."""

    points: Floats
    s: Floats
    arrays: dict[str, Floats]

    @property
    def radius(self) -> Floats:
        """Radius of the tube to draw, (n,), mm: the known one, or a thin one."""
        assumed = np.full(len(self.s), _ASSUMED_RADIUS * self.s[-1])
        return self.arrays.get("Radius", assumed)


def sampled(line: Centerline, most_points: int) -> Sample:
    """Take at most so many points of a centerline; its own, where it has no more.

    Raises
    ------
    InputError
        Where an array along it is not finite.
    """
    known = {name: line.arrays[name] for name in UNITS if name in line.arrays}
    if "Radius" not in known and "MaximumInscribedSphereRadius" in line.arrays:
        known["Radius"] = line.arrays["MaximumInscribedSphereRadius"]
    known = {name: values for name, values in known.items() if values.ndim == 1}
    for name, values in known.items():
        if not np.isfinite(values).all():
            raise InputError(
                f"frame {line.frame}", f"has values in {name} that are not finite", "mend the .vtp"
            )
    # By chords, since files of others may have uneven steps and no array of arc length.
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line.points, axis=0), axis=1))])
    if len(s) <= most_points:
        return Sample(line.points, s, known)
    wanted = np.linspace(0, s[-1], most_points)
    points = line.backbone(line.backbone.arc_lengths(most_points))
    arrays = {name: np.interp(wanted, s, values) for name, values in known.items()}
    return Sample(points, wanted, arrays)


def check_color(lines: Sequence[Centerline], color_by: str | None) -> str | None:
    """Name of the array that colors the tube: the one that is wanted, or curvature if known.

    Raises
    ------
    InputError
        Where a wanted one is missing.
    """
    common = [name for name in UNITS if all(name in line.arrays for line in lines)]
    if color_by is None:
        return common[0] if common else None
    if color_by not in common:
        known = f"choose one of {', '.join(common)}" if common else "leave --color-by out"
        raise InputError("--color-by", f"the centerline holds no {color_by}", known)
    return color_by


def value_range(values: Iterable[Floats]) -> tuple[float, float]:
    """Range that colors span, of all values; a little apart where they are one.

    From the 1st to the 98th percentile: curvature runs away at the very ends of a fit, and
    would leave one color to the rest.
    """
    low, high = (float(v) for v in np.percentile(np.concatenate(list(values)), [1, 98]))
    return (low, high) if high - low > 1e-9 * max(abs(high), 1e-9) else (low, low + 1e-9)
