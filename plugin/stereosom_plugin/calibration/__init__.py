"""Where the views stood and how their lenses bend: every format of file that says so.

`read_calibration` recognizes a file by its content; `read_rig` and `write_rig` are for the
project's own `rig.json`.
"""

from __future__ import annotations

from .model import Calibration, View, assemble
from .reading import read_calibration
from .rig_json import read_rig, write_rig

__all__ = ["Calibration", "View", "assemble", "read_calibration", "read_rig", "write_rig"]
