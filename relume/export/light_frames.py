"""Coordinate frames of lights that emit along their −Z, as in glTF and USD."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.lights.light_axes import light_axes
from relume.lights.local_lights import rectangle
from relume.lights.shape_triangles import shape_triangles
from relume.look.model import AreaLook, PointLook, RectangleLook, SingleLightLook, SpotLook, TubeLook
from relume.raytrace.tangents import any_tangent

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


def light_frame(light: SingleLightLook) -> Shaped[F64, "4 4"]:
    """Return the transform to world of a light other than an emissive mesh, rigid. A tube lies along its X, C0 of an
    IES file is +X and C90 +Y.
    """
    position = getattr(light, "position", (0.0, 0.0, 0.0))
    if isinstance(light, RectangleLook):
        across, up = rectangle(light.geometry)[1]
        return _frame(-across / np.linalg.norm(across), up / np.linalg.norm(up), position)
    if isinstance(light, PointLook | SpotLook):
        c0, c270, _ = light_axes(light.direction, light.rotation)
        return _frame(c0, -c270, position)
    backward = -np.array(getattr(light, "direction", (0.0, 0.0, -1.0)), np.float64)
    backward /= np.linalg.norm(backward)
    right = any_tangent(backward[None].astype(np.float32))[0].astype(np.float64)
    right -= (right @ backward) * backward
    right /= np.linalg.norm(right)
    if isinstance(light, TubeLook):
        return _frame(-backward, right, position)
    return _frame(right, np.cross(backward, right), position)


def local_triangles(light: AreaLook) -> Shaped[F32, "T 3 3"]:
    """Return the triangles of an area light in its frame, counterclockwise from the emitting side."""
    direction = (1.0, 0.0, 0.0) if isinstance(light, TubeLook) else (0.0, 0.0, -1.0)
    local = light.geometry._replace(position=(0.0, 0.0, 0.0), direction=direction, rotation=0.0)
    triangles = shape_triangles(local)
    if triangles is not None:
        return triangles.corners
    corner, (e, f) = rectangle(local)
    return np.array([[corner, corner + e, corner + e + f], [corner, corner + e + f, corner + f]], np.float32)


def _frame(right: F64, up: F64, position: Sequence[float]) -> Shaped[F64, "4 4"]:
    frame = np.eye(4)
    frame[:3] = np.column_stack([right, up, np.cross(right, up), position])
    return frame
