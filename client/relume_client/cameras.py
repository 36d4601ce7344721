"""Poses of cameras: 4 × 4 matrices that look along their −Z, +Y up, meters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]
_MAX_PITCH = np.radians(89.0)


def look_at(position: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 1.0, 0.0)) -> F64:
    """Pose of a camera at a position that looks at a target.

    Args:
        position, target: world space, meters. (3,)
        up: direction that is up in the image; it need not be perpendicular to the view. (3,)
    Returns:
        Camera to world. (4, 4)
    Raises:
        ValueError: position and target are equal, or `up` is parallel to the view.
    """
    z = np.subtract(position, target).astype(np.float64)
    x = np.cross(np.asarray(up, np.float64), z)
    if not np.linalg.norm(x) > 1e-9 * np.linalg.norm(z) > 0:
        raise ValueError(f"a camera at {position!r} cannot look at {target!r} with {up!r} up")
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3] = np.column_stack([x, np.cross(z, x), z, np.asarray(position, np.float64)])
    return pose


@dataclass(frozen=True)
class Orbit:
    """A camera around a pivot: yaw about +Y from +Z, pitch above the horizon, radians; distance in meters."""

    pivot: tuple[float, float, float]
    yaw: float
    pitch: float
    distance: float

    @classmethod
    def from_pose(cls, to_world: F64, middle: ArrayLike) -> Orbit:
        """The orbit of a camera, about the point of its axis that is nearest to the middle of the scene.

        Args:
            to_world: (4, 4). middle: world space, meters. (3,)
        """
        position, backward = to_world[:3, 3], to_world[:3, 2]
        distance = max(float(np.dot(position - np.asarray(middle), backward)), 1e-3)
        pivot = position - distance * backward
        yaw, pitch = np.arctan2(backward[0], backward[2]), np.arcsin(np.clip(backward[1], -1, 1))
        return cls((float(pivot[0]), float(pivot[1]), float(pivot[2])), float(yaw), float(pitch), distance)

    def turned(self, yaw: float, pitch: float, zoom: float = 1.0) -> Orbit:
        """The orbit after a drag: `yaw` and `pitch` are added, the distance is multiplied by `zoom`."""
        return replace(
            self,
            yaw=self.yaw + yaw,
            pitch=float(np.clip(self.pitch + pitch, -_MAX_PITCH, _MAX_PITCH)),
            distance=self.distance * zoom,
        )

    def pose(self) -> F64:
        """Camera to world. (4, 4)"""
        horizontal = np.cos(self.pitch)
        backward = np.array([np.sin(self.yaw) * horizontal, np.sin(self.pitch), np.cos(self.yaw) * horizontal])
        return look_at(np.asarray(self.pivot) + self.distance * backward, self.pivot)
