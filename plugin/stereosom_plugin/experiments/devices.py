"""Devices of random shape before the rigs that they are seen by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from stereosom.arrays import Floats
from stereosom.backbone import Backbone
from stereosom.camera import StereoRig
from stereosom.synthetic import converging_rig

from . import mockup
from .table1_figures import epipolar_curve


@dataclass(frozen=True, eq=False)
class Device:
    """A tube, and the two cameras before it; radius in mm."""

    curve: Backbone
    radius: float
    rig: StereoRig


def _mockup(convergence_deg: float) -> Callable[[int], Device]:
    def make(seed: int) -> Device:
        pose = mockup.poses(1, seed=seed, reach=8.0)[0]
        return Device(pose.of(mockup.backbone()), mockup.RADIUS, converging_rig(convergence_deg))

    return make


def _cannula(seed: int) -> Device:
    """Three sections, each an arc in a plane of its own, 110 mm in all."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 110, 600)
    section = np.minimum((s / 110 * 3).astype(int), 2)
    bend = np.array([0.002, 0.012, 0.02]) * rng.uniform(0.5, 1.5, 3)
    turn = rng.uniform(0, 2 * np.pi, 3)
    speed = (bend * np.exp(1j * turn))[section]
    rig = converging_rig(75, distance=650, focal_length=3000, target=(0, 0, 50))
    return Device(_integrated(s, speed), 0.6, rig)


def _loop(seed: int) -> Device:
    """A turn and a bit, which crosses itself in a view."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, 300)[:, None]
    angle = 2 * np.pi * rng.uniform(1.1, 1.25) * share
    around = [32 * np.sin(angle), 75 - 50 * np.cos(angle) * (1 - 0.3 * share)]
    curve = Backbone.through(np.hstack([rng.uniform(40, 70) * share, *around]))
    shifted = curve.transformed(np.eye(3), rng.uniform(-8, 8, 3))
    return Device(shifted, 1.5, converging_rig(70, focal_length=2600))


def _epipolar(seed: int) -> Device:
    """A stretch of 40 mm that runs along a baseline, or up to 10° beside it."""
    rng = np.random.default_rng(seed)
    rig = mockup.overhead_rig(60)
    curve = epipolar_curve()
    tilt = np.radians(rng.uniform(-10, 10))
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    middle = curve(curve.length / 2)
    curve = curve.transformed(turn, middle - turn @ middle + rng.uniform(-8, 8, 3))
    return Device(curve, 1.5, rig)


def random_curve(seed: int, length: float = 150.0) -> Backbone:
    """A smooth curve that winds at random about the z axis, its middle at z = 75 mm.

    Its direction leans up to some 45° away from z, in waves of half its length and longer.
    """
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, 400)
    lean = np.zeros((400, 2))
    for wave in range(1, 5):
        phase = rng.uniform(0, 2 * np.pi, 2)
        lean += rng.normal(0, 0.45, 2) / wave * np.sin(np.pi * wave * share[:, None] + phase)
    way = np.column_stack([lean, np.ones(400)])
    points = np.cumsum(way / np.linalg.norm(way, axis=1, keepdims=True), axis=0) * length / 400
    return Backbone.through(points - points.mean(axis=0) + [0, 0, 75])


def _random(seed: int) -> Device:
    return Device(random_curve(seed), 1.5, converging_rig(60))


def _integrated(s: Floats, bending: np.ndarray) -> Backbone:
    """The curve of given bending (1/mm, as complex numbers in a frame that does not twist)."""
    frame, point, points = np.eye(3), np.zeros(3), []
    for step, bend in zip(np.diff(s, append=2 * s[-1] - s[-2]), bending, strict=True):
        points.append(point)
        point = point + step * frame[2]
        tangent = frame[2] + step * (bend.real * frame[0] + bend.imag * frame[1])
        tangent /= np.linalg.norm(tangent)
        first = frame[0] - (frame[0] @ tangent) * tangent
        first /= np.linalg.norm(first)
        frame = np.stack([first, np.cross(tangent, first), tangent])
    # Sections meet at a corner of curvature: a spline through every tenth point follows it.
    return Backbone.through(points[::10])


FAMILIES: MappingProxyType[str, Callable[[int], Device]] = MappingProxyType(
    {
        "mock-up 45°": _mockup(45),
        "mock-up 20°": _mockup(20),
        "mock-up 90°": _mockup(90),
        "cannula 75°": _cannula,
        "loop 70°": _loop,
        "epipolar 60°": _epipolar,
        "random 60°": _random,
    }
)
"""A device of each family for each seed."""
