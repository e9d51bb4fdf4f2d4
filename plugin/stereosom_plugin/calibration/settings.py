"""What a caller may say where a file is silent."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """See `read_calibration`."""

    units: str | None = None
    image_size: tuple[int, int] | None = None
    rectified: bool = False
    fisheye: bool = False
    pixel_spacing: float | None = None
    pitch: float | None = None
