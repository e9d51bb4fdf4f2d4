"""How a rig may be wrong: each view turned and moved about the isocenter, and its focal length."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import Floats
from ..camera import Camera, StereoRig, triangulate

# Of each view: turned about the axes of its picture and in it; moved along them; focal length.
PARAMETERS = ("x", "y", "roll", "right", "down", "depth", "focal")
IN_DEGREES = np.tile(np.arange(7) < 3, 2)


@dataclass(frozen=True)
class RigUncertainty:
    """Standard deviations of what a file says about each view.

    Parameters
    ----------
    angle_deg : float
        Of the viewing direction, about each axis of the picture.
    roll_deg : float
        Of the picture in its plane.
    isocenter : float
        Of each view's idea of the isocenter, mm, in each direction.
    distance : float
        Of the distances from the source, as a share of them.
    """

    angle_deg: float = 2.0
    roll_deg: float = 0.5
    isocenter: float = 5.0
    distance: float = 0.01

    def __post_init__(self) -> None:
        if not all(np.isfinite(sd) and sd > 0 for sd in astuple(self)):
            raise ValueError("rig uncertainty: standard deviations must be positive numbers")


def deviations(uncertainty: RigUncertainty, rig: StereoRig, pivot: Floats) -> Floats:
    """Standard deviations of the fourteen parameters, rad, mm and shares of the focal length.

    A wrong distance from the source to the isocenter is a shift along the axis.
    """
    turn, roll = np.radians([uncertainty.angle_deg, uncertainty.roll_deg])
    shift, share = uncertainty.isocenter, uncertainty.distance
    return np.concatenate(
        [
            [turn, turn, roll, shift, shift, np.hypot(shift, share * depth), share]
            for depth in (camera.depth(pivot[None])[0] for camera in (rig.a, rig.b))
        ]
    )


def isocenter(rig: StereoRig) -> Floats:
    """Where both viewing axes come closest, (3,), mm; for parallel ones, between the cameras."""
    if np.linalg.norm(np.cross(rig.a.axis, rig.b.axis)) < 1e-3:
        return np.asarray((rig.a.center + rig.b.center) / 2)
    return np.asarray(triangulate(rig, *(_principal_point(c)[None] for c in (rig.a, rig.b)))[0])


def corrected(rig: StereoRig, parameters: Floats, pivot: Floats) -> StereoRig:
    """Turn, move and scale both views, each by seven parameters (rad, mm, share)."""
    return StereoRig(
        _corrected_camera(rig.a, parameters[:7], pivot),
        _corrected_camera(rig.b, parameters[7:], pivot),
        rig.frame,
    )


def _corrected_camera(camera: Camera, parameters: Floats, pivot: Floats) -> Camera:
    """Move a camera like a C-arm: turned about the pivot, then shifted."""
    left, center = camera.projection[:, :3], _principal_point(camera)
    axes = np.vstack([left[:2] - center[:, None] * left[2], left[2]])
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    turn = Rotation.from_rotvec(parameters[:3] @ axes).as_matrix()
    # A point X stands before the moved camera as turnᵀ (X − pivot − shift) + pivot did before.
    offset = pivot - turn.T @ (pivot + parameters[3:6] @ axes)
    world = np.vstack([np.column_stack([turn.T, offset]), [0, 0, 0, 1]])
    scale = 1 + float(parameters[6])
    zoom = np.diag([scale, scale, 1.0])
    zoom[:2, 2] = (1 - scale) * center
    return Camera(zoom @ camera.projection @ world, camera.image_size)


def _principal_point(camera: Camera) -> Floats:
    """Where the viewing axis meets the picture, (2,), px."""
    return np.asarray(camera.projection[:2, :3] @ camera.axis)
