"""Normal mapping: tangent-space normals to shading normals, and limits of their tilt."""

from __future__ import annotations

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.tangents import project_to_tangent, unit
from relume.raytrace.texture import MipMap
from relume.scene.model import Texture

F32 = NDArray[np.float32]

_LOOKUPS = ((1, 16), (2, 8), (4, 4), (8, 2), (16, 1))  # of normal maps, along both sides of a pixel, by its shape
_UP = np.array([[0, 0, 1]], np.float32)
MIN_FACING = 0.01  # minimum cosine between a shading normal and the direction to the viewer


def visible_length(mapped: Shaped[F32, "n 3"], texels: Shaped[F32, " n"]) -> Shaped[F32, " n"]:
    """Length of the mean normal in a pixel; one if the pixel covers no more than a texel, because interpolation between
    two texels shortens the mean without spreading the normals.

    Args:
        mapped: mean normals. texels: side of the pixel in texels of the map.
    """
    coverage = np.clip(np.log2(np.maximum(texels, 1)), 0, 1)
    return np.asarray(1 - coverage * (1 - np.minimum(np.linalg.norm(mapped, axis=1), 1)), np.float32)


def mean_normal(
    texture: Texture, uv: Shaped[F32, "n 2"], sides: Shaped[F32, "n 2 2"]
) -> tuple[Shaped[F32, "n 3"], Shaped[F32, " n"]]:
    """Mean of a normal map over the pixels of points, and its length: one where a pixel has one normal.

    A MIP map alone would average over twice the pixel, and wash highlights out.

    Args:
        texture: the normal map. uv: v from the top. sides: of each pixel's parallelogram in UV space.
    """
    pyramid = MipMap.for_texture(texture)
    extent = np.linalg.norm(sides, axis=2).astype(np.float32)
    is_wide = pyramid.texels(extent.max(axis=1)) > 1
    # the ratio of numbers is that of the sides: each lookup averages about a square
    shape = np.rint(0.5 * np.log2(np.maximum(extent[:, 0], 1e-9) / np.maximum(extent[:, 1], 1e-9))) + 2
    shape = np.where(is_wide, np.clip(shape, 0, len(_LOOKUPS) - 1), -1)
    mean = np.empty((len(uv), 3), np.float32)
    for k, nums in ((-1, (1, 1)), *enumerate(_LOOKUPS)):
        rows = np.flatnonzero(shape == k)
        total, footprint = np.zeros((len(rows), 3), np.float32), (extent[rows] / np.array(nums, np.float32)).max(axis=1)
        for s, t in np.ndindex(*nums):
            offset = ((s + 0.5) / nums[0] - 0.5) * sides[rows, 0] + ((t + 0.5) / nums[1] - 0.5) * sides[rows, 1]
            mapped = pyramid.sample(np.asarray(uv[rows] + offset, np.float32), footprint)
            length = visible_length(mapped, pyramid.texels(footprint))
            total += unit(mapped, _UP) * length[:, None]
        mean[rows] = total / (nums[0] * nums[1])
    return mean, np.minimum(np.linalg.norm(mean, axis=1), 1)


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
