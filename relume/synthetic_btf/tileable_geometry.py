"""One period of a small geometry: what lies over the unit square, and repeats beside it without end."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
Terms = tuple[Mapping[str, Any], ...]


class Tile(NamedTuple):
    """A geometry over [0, 1]², x to the right and y up in its texture, z towards the eye; z = 0 is the texture's plane.

    Triangles may reach over the square's sides: what is beside it does so too.

    Attributes:
        positions: (n, 3). normals: unit. (n, 3). faces: counter-clockwise seen from outside. (m, 3)
        material: of each face. (m,)
        materials: terms of each, in the form of look documents; isotropic.
    """

    positions: F64
    normals: F64
    faces: I64
    material: I64
    materials: tuple[Terms, ...]

    @classmethod
    def with_single_material(cls, positions: F64, normals: F64, faces: I64, terms: Terms) -> Self:
        """One whose faces all have the same material.

        Args:
            positions, normals, faces: see the class. terms: of the material.
        """
        return cls(positions, normals, faces, np.zeros(len(faces), np.int64), (terms,))


def centered_height(tile: Tile) -> Tile:
    """Put the middle of its heights to z = 0."""
    z = tile.positions[:, 2]
    shift = np.array([0, 0, 0.5 * (z.min() + z.max())])
    return tile._replace(positions=tile.positions - shift)


def repeat_tile(tile: Tile, num_repeats: int) -> Tile:
    """Put as many periods beside it, on each side."""
    offsets = [(x, y, 0) for y in range(-num_repeats, num_repeats + 1) for x in range(-num_repeats, num_repeats + 1)]
    count = len(tile.positions)
    return tile._replace(
        positions=np.concatenate([tile.positions + offset for offset in offsets]),
        normals=np.tile(tile.normals, (len(offsets), 1)),
        faces=np.concatenate([tile.faces + k * count for k in range(len(offsets))]),
        material=np.tile(tile.material, len(offsets)),
    )


def extruded(path: F64, radius: float, num_corners: int, flat: float = 1.0) -> tuple[F64, F64, I64]:
    """A yarn along a path: its positions, normals and faces.

    Args:
        path: of its middle, in a plane that z lies in; the yarn lacks its first and its last place, which say how it
            goes on. (n, 3). radius: across z.
        num_corners: corners of its cross-section. flat: its height over its width.
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
