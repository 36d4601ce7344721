"""Normal mapping: tangent-space normals to shading normals, and limits of their tilt."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.tangents import project_to_tangent, unit

F32 = NDArray[np.float32]

MIN_FACING = 0.01  # minimum cosine between a shading normal and the direction to the viewer


def visible_length(mapped: Shaped[F32, "n 3"], texels: Shaped[F32, " n"]) -> Shaped[F32, " n"]:
    """Length of the mean normal in a pixel; one if the pixel covers no more than a texel, because interpolation between
    two texels shortens the mean without spreading the normals.

    Args:
        mapped: mean normals. texels: side of the pixel in texels of the map.
    """
    coverage = np.clip(np.log2(np.maximum(texels, 1)), 0, 1)
    return np.asarray(1 - coverage * (1 - np.minimum(np.linalg.norm(mapped, axis=1), 1)), np.float32)


def mapped_normal(
    mapped: Shaped[F32, "n 3"],
    normal: Shaped[F32, "n 3"],
    tangents: Shaped[F32, "n 4"],
    face_normal: Shaped[F32, "n 3"],
) -> Shaped[F32, "n 3"]:
    """Transform tangent-space normals to world space; a normal below the face is replaced by `normal`.

    Args:
        mapped: mean tangent-space normals. normal: normal of the surface, unit.
        tangents: not yet orthogonal to `normal`, with the sign of the bitangent. face_normal: unit.
    """
    tangent = project_to_tangent(tangents[:, :3], normal)
    bitangent = np.cross(normal, tangent) * np.where(tangents[:, 3:] < 0, -1, 1)
    world = mapped[:, :1] * tangent + mapped[:, 1:2] * bitangent + mapped[:, 2:] * normal
    world = unit(world, normal)
    is_below_face = np.einsum("nc,nc->n", world, face_normal)[:, None] <= 0
    return np.where(is_below_face, normal, world).astype(np.float32)


def flip_to_viewer(normal: Shaped[F32, "n 3"], directions: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Bend shading normals that face away from the viewer just into view, so that no sample is lost.

    Args:
        normal: unit. directions: directions of the camera rays, unit.
    """
    facing = -np.einsum("nc,nc->n", normal, directions)
    deficit = np.maximum(MIN_FACING - facing, 0)[:, None]
    return unit(normal - deficit * directions, -directions)
