"""3D Slicer's markups curve, `.mrk.json`: written from a centerline, and read back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from stereosom.arrays import Floats, check_array
from stereosom.backbone import Backbone

from ..centerline import Centerline
from ..errors import InputError
from ..files import write_whole
from .samples import sampled

_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
    "Resources/Schema/markups-schema-v1.0.3.json#"
)
_MEASURED = ("StandardDeviation", "Radius")
_MOST_BYTES, _MOST_POINTS = 8 << 20, 100_000
_FARTHEST_MM = 1e6


def write_markups(line: Centerline, path: str | Path, *, most_points: int = 50) -> None:
    """Write a curve of at most `most_points` control points.

    Slicer splines the points; fifty keep a device's curve to a few micrometres and can still
    be moved by hand. Standard deviation and radius go along as measurements, where known.

    Raises
    ------
    InputError
        Where an array is not finite, or the file cannot be written.
    """
    sample = sampled(line, most_points)
    count = len(sample.points)
    curve = {
        "type": "Curve",
        "coordinateSystem": "LPS",
        "coordinateUnits": "mm",
        "controlPoints": [
            {
                "id": str(number),
                "label": {1: "base", count: "tip"}.get(number, ""),
                "position": position.tolist(),
                "selected": True,
                "locked": False,
                "visibility": True,
                "positionStatus": "defined",
            }
            for number, position in enumerate(sample.points, start=1)
        ],
        "measurements": [
            {
                "name": name,
                "enabled": True,
                "units": "mm",
                "printFormat": "%-#4.4g%s",
                "controlPointValues": sample.arrays[name].tolist(),
            }
            for name in _MEASURED
            if name in sample.arrays
        ],
    }
    text = json.dumps({"@schema": _SCHEMA, "markups": [curve]}, indent=1, allow_nan=False)
    with write_whole(path) as part:
        part.write_text(text, encoding="utf-8")


def read_markups(path: str | Path) -> Centerline:
    """Read the one curve of a `.mrk.json`, as 3D Slicer writes it, as LPS.

    Measurements with a value per control point become arrays. The time and the frame are 0.

    Raises
    ------
    InputError
        Where the file is missing, no JSON, or holds no single curve of finite points in mm.
    """
    try:
        if Path(path).stat().st_size > _MOST_BYTES:
            raise ValueError(f"is larger than {_MOST_BYTES >> 20} MiB")
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        return _curve(content)
    except OSError as error:
        why = f"cannot be read ({error.strerror or error})"
        raise InputError(path, why, "give a .mrk.json that exists") from error
    except RecursionError:
        why = "is nested too deep"
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        why = f"is no markups file ({type(error).__name__}: {error})"
    except ValueError as error:
        why = str(error)
    raise InputError(path, why, "give a markups curve in mm that 3D Slicer has written")


def _curve(content: dict[str, Any]) -> Centerline:
    curves = [markup for markup in content["markups"] if markup["type"] in ("Curve", "Line")]
    if len(curves) != 1:
        raise ValueError(f"holds {len(curves)} curves, not one")
    (curve,) = curves
    if curve.get("coordinateUnits", "mm") not in ("mm", ["mm", "UCUM", "millimeter"]):
        raise ValueError(f"is in {curve['coordinateUnits']!r}, not in mm")
    system = curve.get("coordinateSystem", "LPS")
    if system not in ("LPS", "RAS"):
        raise ValueError(f"has coordinates in {system!r}, neither LPS nor RAS")
    controls = [
        p for p in curve["controlPoints"] if p.get("positionStatus", "defined") == "defined"
    ]
    if not 2 <= len(controls) <= _MOST_POINTS:
        raise ValueError(f"has {len(controls)} control points, not 2 to {_MOST_POINTS}")
    points: Floats = check_array([p["position"] for p in controls], "points", (None, 3))
    if np.abs(points).max() > _FARTHEST_MM:
        raise ValueError("has points a kilometre away")
    points = points * ([-1, -1, 1] if system == "RAS" else [1, 1, 1])
    arrays = {}
    for measurement in curve.get("measurements", []):
        values = measurement.get("controlPointValues")
        if isinstance(values, list) and len(values) == len(points):
            name = str(measurement["name"])
            arrays[name] = check_array(values, name, (None,))
    return Centerline(points, Backbone.through(points), 0.0, 0, arrays, {"SPACE": ("LPS",)})
