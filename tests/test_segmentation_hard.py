"""Runs that are harder than the studies: faint, low dose, gaps, wires as dark as the device.

The pictures are drawn here: real X-ray frames behind, and over them the chords through a round
body about a projected curve. Nothing of the code under test takes part.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree

from stereosom.camera import Camera, StereoRig
from stereosom_plugin.acquisition import Acquisition
from stereosom_plugin.segmentation import observe

SIZE, FRAMES = 512, 3


@dataclass(frozen=True)
class Case:
    """What makes a run hard."""

    radius_mm: float = 1.0
    absorption: float = 1.6
    photons: float = 4000.0
    wires: float = 0.0
    gap_px: float = 0.0
    motion_px: float = 0.0


CASES = {
    "easy": Case(),
    "faint": Case(absorption=0.35),
    "thin": Case(radius_mm=0.35, absorption=0.8),
    "low dose": Case(photons=150.0),
    "wires": Case(wires=1.0),
    "gap": Case(gap_px=14.0),
    "motion": Case(motion_px=4.0, absorption=0.7),
}


def curve_of(frame):
    """A device that enters from the foot side and bends more from frame to frame, mm."""
    along = np.linspace(0, 90, 400)
    bend = np.clip(along - 30, 0, None) / 60
    sway = (0.45 + 0.08 * frame) * bend**2
    x = np.cumsum(np.sin(sway)) * 90 / 400 - 12
    y = np.cumsum(np.sin(0.7 * sway)) * 90 / 400
    z = np.cumsum(np.cos(sway)) * 90 / 400 - 75
    return np.column_stack([x, y, z])


def projected(curve, matrix):
    x, y, depth = matrix @ np.column_stack([curve, np.ones(len(curve))]).T
    return np.column_stack([x / depth, y / depth]), 1 / depth


def light_of(axis, radius, absorption):
    """Share of light that passes a tube about a line of the picture, cut flat at its end."""
    row, column = np.indices((SIZE, SIZE))
    pixels = np.stack([column, row], axis=-1).reshape(-1, 2)
    distance, nearest = cKDTree(axis).query(pixels, distance_upper_bound=radius + 2)
    nearest = np.minimum(nearest, len(axis) - 1)
    ahead = axis[-1] - axis[-4]
    beyond = (pixels - axis[-1]) @ ahead > 0
    chord = np.sqrt(np.clip(1 - (distance / radius) ** 2, 0, None))
    chord[beyond & (nearest > len(axis) - 8)] = 0
    return np.exp(-absorption * chord).reshape(SIZE, SIZE)


@pytest.fixture(scope="module")
def geometry(shared_data):
    planes = json.loads((shared_data / "biplane_xa/cannula/truth.json").read_text())["planes"]
    return {view: np.array(planes[view][0]) for view in "ab"}


@pytest.fixture(scope="module")
def backgrounds(shared_data):
    pillow = pytest.importorskip("PIL.Image")
    names = ("L_Hop_Cam1_001_UND.0180.tif", "L_Hop_Cam2_001_UND.0180.tif")
    found = {}
    for view, name in zip("ab", names, strict=True):
        picture = pillow.open(shared_data / "xray_backgrounds" / name).resize((SIZE, SIZE))
        found[view] = 0.15 + np.asarray(picture, dtype=float) / 255
    return found


def wires(view, darkness):
    """Two lines across the picture, other ones in each view, as dark as the device."""
    at = np.linspace(-0.1, 1.1, 900)[:, None] * SIZE
    bow = 60 * np.sin(at / 90)
    if view == "a":
        lines = [np.hstack([at, 330 + bow]), np.hstack([120 + 0.4 * at, at])]
    else:
        lines = [np.hstack([at, 60 + 0.1 * at + 0.5 * bow]), np.hstack([430 - 0.5 * at, at])]
    return np.prod([light_of(line, 2.5, 1.2 * darkness) for line in lines], axis=0)


def run_of(case, geometry, backgrounds):
    rng = np.random.default_rng(5)
    frames, axes = [], []
    for frame in range(FRAMES):
        pictures, lines = [], []
        for view in "ab":
            matrix = geometry[view]
            axis, nearness = projected(curve_of(frame), matrix)
            scale = np.linalg.norm(np.cross(matrix[0, :3], matrix[2, :3]))
            radius = case.radius_mm * scale * nearness.mean()
            moved = case.motion_px * np.array([np.sin(frame), np.cos(2 * frame)])
            light = ndimage.shift(backgrounds[view], moved, order=1, mode="nearest")
            if case.wires:
                light = light * wires(view, case.wires)
            device = light_of(axis, radius, case.absorption)
            if case.gap_px:
                middle = axis[len(axis) // 2]
                row, column = np.indices(device.shape)
                hidden = np.hypot(column - middle[0], row - middle[1]) < case.gap_px / 2
                device = np.where(hidden, 1.0, device)
            light = ndimage.gaussian_filter(light * device, 0.8)
            pictures.append(rng.poisson(case.photons * light).astype(np.uint16))
            lines.append(axis)
        frames.append(tuple(pictures))
        axes.append(lines)
    rig = StereoRig(*(Camera(geometry[view], (SIZE, SIZE)) for view in "ab"))
    return Acquisition(lambda index: frames[index], (rig,), np.arange(FRAMES) / 15), axes


def short_of_tip(pixels, axis):
    """Px by which the mask ends before (negative) or beyond the end of the axis, on the axis."""
    ahead = (axis[-1] - axis[-20]) / np.linalg.norm(axis[-1] - axis[-20])
    offset = pixels - axis[-1]
    along, across = offset @ ahead, np.abs(offset @ [-ahead[1], ahead[0]])
    near = (across < 1) & (np.abs(along) < 30)
    return along[near].max() if near.any() else -np.inf


@pytest.mark.parametrize("name", CASES)
def test_hard_run(name, geometry, backgrounds):
    case = CASES[name]
    acquisition, axes = run_of(case, geometry, backgrounds)
    for seen, lines in zip(observe(acquisition), axes, strict=True):
        for pixels, axis in zip((seen.pixels_a, seen.pixels_b), lines, strict=True):
            assert len(pixels), f"frame {seen.index}: nothing found"
            shown = axis[np.all((axis >= 0) & (axis <= SIZE - 1), axis=1)]
            distance, _ = cKDTree(pixels).query(shown)
            assert (distance < 1).mean() > 0.97
            away, _ = cKDTree(axis).query(pixels)
            radius = np.quantile(away, 0.5) * 2
            assert (away > radius + 5).sum() == 0
            assert -2.5 < short_of_tip(pixels, axis) < radius + 3
