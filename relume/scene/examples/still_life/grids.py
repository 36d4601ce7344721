"""Surfaces as grids of points with analytic or finite-difference normals, used by the example scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene.model import Mesh

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


@dataclass(frozen=True)
class GridSurface:
    """Triangles with shading frames, in meters, +Y up.

    Attributes:
        faces: counterclockwise from outside.
    """

    positions: Shaped[F64, "vertices 3"]
    normals: Shaped[F64, "vertices 3"]
    tangents: Shaped[F64, "vertices 3"]
    uvs: Shaped[F64, "vertices 2"]
    faces: Shaped[I64, "triangles 3"]

    def transform(self, rotation: Shaped[F64, "3 3"], offset: Sequence[float] | Shaped[F64, " 3"]) -> GridSurface:
        """Rotate the surface, then translate it by an offset in meters."""
        transposed = rotation.T
        positions = self.positions @ transposed + np.asarray(offset)
        return GridSurface(positions, self.normals @ transposed, self.tangents @ transposed, self.uvs, self.faces)

    def mesh(self, name: str, material: int) -> Mesh:
        """Convert to a scene mesh without degenerate triangles, with tangents orthogonal to the normals."""
        normals = normalize(self.normals)
        tangents = self.tangents - normals * (normals * self.tangents).sum(1, keepdims=True)
        tangents = np.column_stack([normalize(tangents), np.ones(len(tangents))])
        corners = self.positions[self.faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        faces = self.faces[area > 1e-14]
        vertex_arrays = (self.positions, normals, tangents, self.uvs)
        positions32, normals32, tangents32, uvs32 = (np.ascontiguousarray(v, np.float32) for v in vertex_arrays)
        return Mesh(name, positions32, normals32, tangents32, uvs32, faces.astype(np.uint32), material)


def normalize(vectors: Shaped[F64, "*batch k"]) -> Shaped[F64, "*batch k"]:
    """Normalize vectors along the last axis; a zero vector stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def rotation_y(degrees: float) -> Shaped[F64, "3 3"]:
    """Rotation about +Y, counterclockwise from above."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def grid_faces(num_rows: int, num_columns: int) -> Shaped[I64, "triangles 3"]:
    """Return two triangles per cell of a vertex grid; outside is (along a row) × (down a column)."""
    index = np.arange(num_rows * num_columns).reshape(num_rows, num_columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def grid_surface(positions: Shaped[F64, "rows columns 3"], uvs: Shaped[F64, "rows columns 2"]) -> GridSurface:
    """Build an open surface; normals and tangents (along a row) are central differences."""
    along, down = np.gradient(positions, axis=1), np.gradient(positions, axis=0)
    return _from_grid(positions, np.cross(along, down), along, uvs)


def closed_grid_surface(positions: Shaped[F64, "rows columns 3"], uvs: Shaped[F64, "rows columns 2"]) -> GridSurface:
    """Build a surface whose last column repeats the first, with differences across the seam."""
    ring = np.concatenate([positions[:, -2:-1], positions, positions[:, 1:2]], axis=1)
    along, down = (ring[:, 2:] - ring[:, :-2]) / 2, np.gradient(positions, axis=0)
    return _from_grid(positions, np.cross(along, down), along, uvs)


def _from_grid(positions: F64, normals: F64, tangents: F64, uvs: F64) -> GridSurface:
    faces = grid_faces(*positions.shape[:2])
    return GridSurface(
        positions.reshape(-1, 3), normals.reshape(-1, 3), tangents.reshape(-1, 3), uvs.reshape(-1, 2), faces
    )


def revolve(profile: Shaped[F64, "rows 4"], num_columns: int) -> GridSurface:
    """Revolve a profile of (radius, height, outward normal r, normal y), from top to bottom, about +Y."""
    phi = np.linspace(0, 2 * np.pi, num_columns + 1)
    # Azimuth decreases along a row, so that (along) × (down) points away from the axis.
    c, s = np.cos(phi)[None, :], np.sin(phi)[None, :]
    radius, height, normal_r, normal_y = (profile[:, i, None] for i in range(4))
    positions = np.stack([radius * c, height + 0 * c, -radius * s], -1)
    normals = np.stack([normal_r * c, normal_y + 0 * c, -normal_r * s], -1)
    tangents = np.stack([-s + 0 * radius, 0 * radius * c, -c + 0 * radius], -1)
    uvs = np.stack(np.broadcast_arrays(phi[None, :] / (2 * np.pi), np.linspace(0, 1, len(profile))[:, None]), -1)
    surface = _from_grid(positions, normals, tangents, uvs)
    return GridSurface(surface.positions, surface.normals, surface.tangents, surface.uvs, surface.faces[:, ::-1])


def sphere(radius: float, num_latitudes: int) -> GridSurface:
    """Return a sphere about the origin with twice as many longitudes as latitudes."""
    theta = np.linspace(0, np.pi, num_latitudes + 1)
    profile = np.column_stack([radius * np.sin(theta), radius * np.cos(theta), np.sin(theta), np.cos(theta)])
    return revolve(profile, 2 * num_latitudes)


def merge_surfaces(surfaces: Sequence[GridSurface]) -> GridSurface:
    """Join several surfaces into one."""
    starts = np.cumsum([0, *(len(s.positions) for s in surfaces[:-1])])
    faces = np.concatenate([s.faces + start for s, start in zip(surfaces, starts, strict=True)])
    return GridSurface(
        np.concatenate([s.positions for s in surfaces]),
        np.concatenate([s.normals for s in surfaces]),
        np.concatenate([s.tangents for s in surfaces]),
        np.concatenate([s.uvs for s in surfaces]),
        faces,
    )
