"""Intrinsics and a fundamental matrix: a rig up to scale, and its scale from a grid of dots.

JSON: `{"left": {"intrinsics": 3×3, "distortion": […]}, "right": {…}, "fundamental": 3×3,
"dots_left": [[x, y], …], "dots_right": […]}`; the k-th dots of both lists are one dot.
"""

from __future__ import annotations

import numpy as np
from scipy import optimize
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from stereosom.arrays import Floats
from stereosom.camera import triangulate

from ..lens import Lens
from .content import Content, numbers
from .model import Calibration, View, assemble, lens_of
from .settings import Settings

SOURCE = "intrinsics and fundamental matrix"


def read_two_view(contents: list[Content], settings: Settings) -> Calibration | None:
    """Read a rig from F = K_b⁻ᵀ [t]ₓ R K_a⁻¹ (Hartley and Zisserman, 9.6), scaled by the dots.

    Of the four poses that one F allows, the one is taken that puts the dots before both
    cameras. A fundamental matrix seldom fits the intrinsics to the last pixel: the pose is then
    refined so that the dots meet their epipolar lines.

    It may be that of pixels free of lens distortion or as they are seen; the dots tell which.
    In the second case the lenses are left out: what is bent by them first would miss its line.
    """
    tree = contents[0].tree
    if contents[0].kind != "json" or not {"left", "right", "fundamental"} <= set(tree):
        return None
    matrices, lenses = [], []
    for side in ("left", "right"):
        if not isinstance(tree[side], dict) or "intrinsics" not in tree[side]:
            raise ValueError(f"{side}: has no intrinsics")
        k = numbers(tree[side]["intrinsics"], f"{side} intrinsics", (3, 3))
        matrices.append(k)
        lenses.append(lens_of(k, numbers(tree[side].get("distortion", [0] * 5), "distortion")))
    fundamental = numbers(tree["fundamental"], "fundamental", (3, 3))
    if "dots_left" not in tree or "dots_right" not in tree:
        raise ValueError("has no dots_left and dots_right, so its scale is unknown")
    if settings.pitch is None:
        raise ValueError("has no scale; give the distance of neighboring dots with --pitch MM")
    dots = [numbers(tree[name], name) for name in ("dots_left", "dots_right")]
    if dots[0].shape != dots[1].shape or dots[0].shape[1:] != (2,) or len(dots[0]) < 8:
        raise ValueError("dots_left and dots_right must be two lists of as many points, 8 or more")
    straight = [
        lens.undistort(seen) if lens else seen for lens, seen in zip(lenses, dots, strict=True)
    ]
    notes: tuple[str, ...] = ()
    as_seen, as_straight = (_off_lines(fundamental, each) for each in (dots, straight))
    if as_seen < as_straight:
        notes = (
            f"the fundamental matrix is that of the pixels as seen ({as_seen:.2f} px off the dots, "
            f"{as_straight:.2f} px where undistorted): the lenses are left out",
        )
        lenses, straight = [None, None], dots
    turn, moved = _pose(fundamental, matrices, straight)
    turn, moved = _refined(turn, moved, matrices, straight)
    made = _made(matrices, turn, moved, lenses, settings.image_size)
    points = triangulate(made.rigs[0], *straight)
    nearest = np.asarray(KDTree(points).query(points, k=2)[0])[:, 1]
    pitch = float(np.median(nearest))
    before, after = (
        _off_lines(matrix, straight) for matrix in (fundamental, made.rigs[0].fundamental)
    )
    notes += (
        f"scaled by {len(points)} dots of {settings.pitch:g} mm pitch, "
        f"which vary by {np.std(nearest) / pitch:.1%}",
        f"the fundamental matrix leaves the dots {before:.2f} px off their epipolar "
        f"lines, the refined pose {after:.2f} px (median)",
    )
    made = _made(matrices, turn, moved * (settings.pitch / pitch), lenses, settings.image_size)
    return Calibration(made.rigs, made.lenses, SOURCE, notes)


def _made(
    matrices: list[Floats],
    turn: Floats,
    moved: Floats,
    lenses: list[Lens | None],
    size: tuple[int, int] | None,
) -> Calibration:
    a = View(matrices[0], np.eye(3), np.zeros(3), size, lenses[0])
    return assemble(a, View(matrices[1], turn, moved, size, lenses[1]), SOURCE)


def _pose(fundamental: Floats, matrices: list[Floats], dots: list[Floats]) -> tuple[Floats, Floats]:
    essential = matrices[1].T @ fundamental @ matrices[0]
    u, _, vt = np.linalg.svd(essential)
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    candidates = []
    for q in (quarter, quarter.T):
        turn = u @ q @ vt
        turn = turn * np.sign(np.linalg.det(turn))
        candidates += [(turn, u[:, 2]), (turn, -u[:, 2])]
    front = []
    for turn, moved in candidates:
        rig = _made(matrices, turn, moved, [None, None], (1, 1)).rigs[0]
        try:
            points = triangulate(rig, *dots)
            front.append(int(np.sum((rig.a.depth(points) > 0) & (rig.b.depth(points) > 0))))
        except ValueError:
            front.append(-1)
    return candidates[int(np.argmax(front))]


def _refined(
    turn: Floats, moved: Floats, matrices: list[Floats], dots: list[Floats]
) -> tuple[Floats, Floats]:
    """Pose that brings matched points to their epipolar lines."""
    inverse = [np.linalg.inv(k) for k in matrices]

    def pose(change: Floats) -> tuple[Floats, Floats]:
        shifted = moved + change[3:]
        return (
            Rotation.from_rotvec(change[:3]).as_matrix() @ turn,
            shifted / np.linalg.norm(shifted),
        )

    def gaps(change: Floats) -> Floats:
        r, t = pose(change)
        cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
        return _epipolar_gaps(inverse[1].T @ cross @ r @ inverse[0], dots)

    return pose(optimize.least_squares(gaps, np.zeros(6), loss="soft_l1").x)


def _off_lines(fundamental: Floats, dots: list[Floats]) -> float:
    """Median distance of the dots from their epipolar lines, px."""
    return float(np.median(np.abs(_epipolar_gaps(fundamental, dots))))


def _epipolar_gaps(fundamental: Floats, dots: list[Floats]) -> Floats:
    """Sampson's distance of matched pixels from their epipolar lines, (n,), px (11.4.3)."""
    a, b = (np.column_stack([each, np.ones(len(each))]) for each in dots)
    to_b, to_a = a @ fundamental.T, b @ fundamental
    size = np.sqrt(np.sum(to_b[:, :2] ** 2, axis=1) + np.sum(to_a[:, :2] ** 2, axis=1))
    return np.asarray(np.sum(b * to_b, axis=1) / np.maximum(size, 1e-12))
