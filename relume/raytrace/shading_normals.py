"""How normal maps lean shading normals, and how far these may lean at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relume.raytrace.tangents import project_to_tangent, unit

F32 = NDArray[np.float32]

MIN_FACING = 0.01  # cosine between a shading normal and the way back of its ray


def visible_length(mapped: F32, texels: F32) -> F32:
    """How long the mean of the normals is that a pixel covers: one where it covers no more than a texel, for what is
    between two is turned from one to the other, and covers nothing.

    Args:
        mapped: means of normals. (n, 3) texels: side of the pixel, in those of the map. (n,)
    Returns:
        (n,) float32
    """
    coverage = np.clip(np.log2(np.maximum(texels, 1)), 0, 1)
    return np.asarray(1 - coverage * (1 - np.minimum(np.linalg.norm(mapped, axis=1), 1)), np.float32)


def mapped_normal(mapped: F32, normal: F32, tangents: F32, face_normal: F32) -> F32:
    """Turn tangent-space normals into world space, kept on the outer side of the face.

    Args:
        mapped: means of normals of tangent space. (n, 3) normal: of the surface, unit. (n, 3)
        tangents: not yet across these, with the sign of the bitangent. (n, 4) face_normal: unit. (n, 3)
    """
    tangent = project_to_tangent(tangents[:, :3], normal)
    bitangent = np.cross(normal, tangent) * np.where(tangents[:, 3:] < 0, -1, 1)
    world = mapped[:, :1] * tangent + mapped[:, 1:2] * bitangent + mapped[:, 2:] * normal
    world = unit(world, normal)
    is_below_face = np.einsum("nc,nc->n", world, face_normal)[:, None] <= 0
    return np.where(is_below_face, normal, world).astype(np.float32)


def flip_to_viewer(normal: F32, directions: F32) -> F32:
    """Bend shading normals that face away from the viewer just into view: interpolation must lose no sample.

    Args:
        normal: unit. (n, 3) directions: in which they are seen, unit. (n, 3)
    """
    facing = -np.einsum("nc,nc->n", normal, directions)
    deficit = np.maximum(MIN_FACING - facing, 0)[:, None]
    return unit(normal - deficit * directions, -directions)
