"""`Camera`: a central projection, world mm to pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Floats, check_array, check_image_size


@dataclass(frozen=True, eq=False)
class Camera:
    """A central projection, world mm to pixels.

    Parameters
    ----------
    projection : (3, 4) array
        Homogeneous projection matrix. It is scaled so that its third row gives the depth
        in mm; its sign is kept, and says which side is in front. A mirroring matrix
        (an X-ray detector seen from behind) is as good as any other.
    image_size : (int, int)
        Width and height of the picture in pixels.

    Raises
    ------
    ValueError
        Where the matrix is not 3×4, not finite, or projects no space onto no plane.

    Examples
    --------
    A camera with a focal length of 1000 px looks along z from 500 mm before the origin:

    >>> camera = Camera([[1000, 0, 320, 160000], [0, 1000, 240, 120000], [0, 0, 1, 500]], (640, 480))
    >>> camera.project([[0, 0, 0], [10, 0, 0]])
    array([[320., 240.],
           [340., 240.]])
    """  # noqa: E501

    projection: Floats
    image_size: tuple[int, int]

    def __post_init__(self) -> None:
        projection = check_array(self.projection, "projection", (3, 4))
        rows = projection[:, :3]
        norms = np.linalg.norm(rows, axis=1)
        if np.any(norms == 0) or abs(np.linalg.det(rows / norms[:, None])) < 1e-9:
            raise ValueError(
                "projection: its left 3×3 part is singular, so it is no central projection; "
                "give K [R | t] with a finite camera centre"
            )
        projection = projection / norms[2]
        projection.setflags(write=False)
        object.__setattr__(self, "projection", projection)
        object.__setattr__(self, "image_size", check_image_size(self.image_size))

    @classmethod
    def from_pose(
        cls, intrinsics: Any, rotation: Any, translation: Any, image_size: tuple[int, int]
    ) -> Camera:
        """Make the camera K [R | t].

        Parameters
        ----------
        intrinsics : (3, 3) array
            K, in pixels.
        rotation : (3, 3) array
            R, world axes to camera axes (x right, y down, z forward).
        translation : (3,) array
            t, mm: where the world's origin lies in camera axes.
        image_size : (int, int)
            Width and height in pixels.
        """
        k = check_array(intrinsics, "intrinsics", (3, 3))
        r = check_array(rotation, "rotation", (3, 3))
        t = check_array(translation, "translation", (3,))
        return cls(k @ np.column_stack([r, t]), image_size)

    @cached_property
    def center(self) -> Floats:
        """Projection centre (X-ray source, pinhole) in the world, (3,), mm."""
        return np.asarray(np.linalg.solve(self.projection[:, :3], -self.projection[:, 3]))

    @property
    def axis(self) -> Floats:
        """Unit vector in which depth grows, (3,)."""
        return self.projection[2, :3]

    @cached_property
    def focal_length(self) -> float:
        """Focal length in pixels, the mean over both picture axes."""
        x, y, z = self.projection[:, :3]
        return float(np.linalg.norm(np.cross(x, z)) + np.linalg.norm(np.cross(y, z))) / 2

    @cached_property
    def pixel_to_ray(self) -> Floats:
        """(3, 3) matrix from homogeneous pixels to world directions of depth 1 mm."""
        return np.asarray(np.linalg.inv(self.projection[:, :3]))

    def project(self, points: Any) -> Floats:
        """Project (n, 3) world points, mm, to (n, 2) pixels."""
        homogeneous = _world_points(points) @ self.projection[:, :3].T + self.projection[:, 3]
        return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])

    def depth(self, points: Any) -> Floats:
        """Depth of (n, 3) world points before the camera, (n,), mm; positive in front."""
        return np.asarray(_world_points(points) @ self.axis + self.projection[2, 3])

    def jacobian(self, points: Any) -> Floats:
        """How pixels move with the world point: (n, 2, 3) derivatives, px/mm."""
        points = _world_points(points)
        pixels, depth = self.project(points), self.depth(points)
        rows = self.projection[:2, :3] - pixels[:, :, None] * self.axis
        return np.asarray(rows / depth[:, None, None])

    def rays(self, pixels: Any) -> Floats:
        """World directions in which (n, 2) pixels look, (n, 3), of unit length."""
        pixels = np.asarray(pixels, dtype=float)
        directions = pixels @ self.pixel_to_ray[:, :2].T + self.pixel_to_ray[:, 2]
        return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))

    def pixel_size(self, points: Any) -> Floats:
        """Millimetres in space that one pixel spans at (n, 3) world points, (n,)."""
        return self.depth(points) / self.focal_length


def _world_points(points: Any) -> Floats:
    array: Floats = np.asarray(points, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"points: must be n×3, is {'×'.join(map(str, array.shape))}")
    return array
