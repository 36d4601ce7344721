"""One period of a tileable geometry: over the unit square, repeated without end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.model import Texture

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Terms = tuple[Mapping[str, Any], ...]

COLOR_CHANNELS = ("diffuse", "specular")
"""Textures that multiply the terms that name them."""


class Tile(NamedTuple):
    """A geometry over [0, 1]²: x to the right and y up in its texture, z toward the viewer, the texture at z = 0.

    Triangles may extend over the square's sides, as do those of the neighboring periods.

    Attributes:
        normals: unit. faces: counterclockwise from outside.
        material: material index of each face.
        materials: terms of each, as in look documents; isotropic.
        uvs: UV coordinates, v from the top. textures: images of each material by channel, as in `Material.textures`.
    """

    positions: Shaped[F64, "vertices 3"]
    normals: Shaped[F64, "vertices 3"]
    faces: Shaped[I64, "triangles 3"]
    material: Shaped[I64, " triangles"]
    materials: tuple[Terms, ...]
    uvs: Shaped[F64, "vertices 2"]
    textures: tuple[Mapping[str, Texture], ...]

    @classmethod
    def with_single_material(
        cls,
        positions: Shaped[F64, "vertices 3"],
        normals: Shaped[F64, "vertices 3"],
        faces: Shaped[I64, "triangles 3"],
        terms: Terms,
    ) -> Self:
        """Make a tile from `positions` and `normals` of vertices, with one material of `terms` for all faces."""
        uvs = positions[:, :2] * [1, -1] + [0, 1]
        return cls(positions, normals, faces, np.zeros(len(faces), np.int64), (terms,), uvs, ({},))


def centered_height(tile: Tile) -> Tile:
    """Move the center of the height range to z = 0."""
    z = tile.positions[:, 2]
    shift = np.array([0, 0, 0.5 * (z.min() + z.max())])
    return tile._replace(positions=tile.positions - shift)


def repeat_tile(tile: Tile, num_repeats: int) -> Tile:
    """Add `num_repeats` periods on each side."""
    offsets = [(x, y, 0) for y in range(-num_repeats, num_repeats + 1) for x in range(-num_repeats, num_repeats + 1)]
    count = len(tile.positions)
    return tile._replace(
        positions=np.concatenate([tile.positions + offset for offset in offsets]),
        normals=np.tile(tile.normals, (len(offsets), 1)),
        faces=np.concatenate([tile.faces + k * count for k in range(len(offsets))]),
        material=np.tile(tile.material, len(offsets)),
        uvs=np.tile(tile.uvs, (len(offsets), 1)),
    )


def height_field(
    height: Shaped[F64, "steps_plus_1 steps_plus_1"],
) -> tuple[Shaped[F64, "vertices 3"], Shaped[F64, "vertices 3"], Shaped[I64, "triangles 3"]]:
    """Triangulate a periodic height field over the unit square: positions, normals and faces.

    Args:
        height: heights by y and x, both rising, with the first row and column repeated at the end.
    """
    steps = len(height) - 1
    u, v = np.meshgrid(np.linspace(0, 1, steps + 1), np.linspace(0, 1, steps + 1), indexing="xy")
    positions = np.stack([u, v, height], axis=-1)
    step = 1 / steps
    inner = height[:-1, :-1]  # one period, for periodic differences
    slope = [
        np.pad((np.roll(inner, -1, k) - np.roll(inner, 1, k)) / (2 * step), ((0, 1), (0, 1)), "wrap") for k in (1, 0)
    ]
    normals = np.stack([-slope[0], -slope[1], np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    i, j = np.meshgrid(np.arange(steps), np.arange(steps), indexing="ij")
    a = (i * (steps + 1) + j).ravel()
    b, c, d = a + 1, a + steps + 1, a + steps + 2
    faces = np.concatenate([np.stack([a, b, d], axis=1), np.stack([a, d, c], axis=1)])
    return positions.reshape(-1, 3), normals.reshape(-1, 3), faces


def extruded(
    path: Shaped[F64, "points 3"], radius: float, num_corners: int, flat: float = 1.0
) -> tuple[Shaped[F64, "vertices 3"], Shaped[F64, "vertices 3"], Shaped[I64, "triangles 3"]]:
    """Extrude a yarn along a path: positions, normals and faces.

    Args:
        path: center line, in a plane that contains z; its first and last points only give the direction.
        radius: radius of the yarn across z. num_corners: number of corners of the yarn's cross-section.
        flat: height over width of the cross-section.
    """
    along, path = path[2:] - path[:-2], path[1:-1]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross([0, 0, 1.0], along)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(along, side)
    angle = np.arange(num_corners) * (2 * np.pi / num_corners)
    cosine, sine = np.cos(angle)[None, :, None], np.sin(angle)[None, :, None]
    offset = radius * (cosine * side[:, None] + flat * sine * up[:, None])
    normal = flat * cosine * side[:, None] + sine * up[:, None]
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    positions = path[:, None] + offset
    i, j = np.meshgrid(np.arange(len(path) - 1), np.arange(num_corners), indexing="ij")
    a, b = i * num_corners + j, i * num_corners + (j + 1) % num_corners
    faces = np.concatenate(
        [np.stack([a, b, a + num_corners], -1), np.stack([b, b + num_corners, a + num_corners], -1)]
    ).reshape(-1, 3)
    return positions.reshape(-1, 3), normal.reshape(-1, 3), faces
