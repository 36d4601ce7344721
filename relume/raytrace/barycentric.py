"""Points on triangles at ray hits, moved off edges and off the plane, without textures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.tangents import any_tangent, unit

F32 = NDArray[np.float32]

# relative to the offset of ray origins from their surface; many times the rounding of positions
EDGE_OFFSET_FRACTION = 1 / 8


class FacePoints(NamedTuple):
    """Points where n rays hit their triangles, without textures.

    Attributes:
        is_hit: false if a ray hits nothing; the other fields are then of the first triangle.
        p, uvs: positions and UV coordinates of the triangles' corners.
        face_normal: toward the visible side.
        position: positions, offset from the surface. normal: shading normals.
        tangents: tangents with the sign of the bitangent.
        uv: texture coordinates.
    """

    is_hit: Shaped[NDArray[np.bool_], " n"]
    p: Shaped[F32, "n 3 3"]
    uvs: Shaped[F32, "n 3 2"]
    twice_area: Shaped[F32, " n"]
    face_normal: Shaped[F32, "n 3"]
    position: Shaped[F32, "n 3"]
    normal: Shaped[F32, "n 3"]
    tangents: Shaped[F32, "n 4"]
    uv: Shaped[F32, "n 2"]

    @classmethod
    def from_hits(cls, geometry: SceneBuffers, hits: Hits, directions: Shaped[F32, "n 3"]) -> FacePoints:
        """Compute the points of hits. geometry: the triangles. directions: directions of the rays"""
        corners = geometry.faces[np.maximum(hits.face, 0)]
        p, uvs = geometry.positions[corners], geometry.uvs[corners]
        face_normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        twice_area = np.linalg.norm(face_normal, axis=1)
        barycentrics = np.stack([1 - hits.uv.sum(axis=1), hits.uv[:, 0], hits.uv[:, 1]], axis=1)
        barycentrics = _move_off_edges(barycentrics, p, twice_area, EDGE_OFFSET_FRACTION * geometry.epsilon)
        face_normal = unit(face_normal, -directions)
        face_normal *= -np.sign(np.einsum("nc,nc->n", face_normal, directions) + 1e-30)[:, None].astype(np.float32)
        normal = unit(_interpolate(barycentrics, geometry.normals[corners]), face_normal)
        normal = np.where(np.einsum("nc,nc->n", normal, face_normal)[:, None] < 0, -normal, normal)
        position = _interpolate(barycentrics, p) + geometry.epsilon * face_normal
        tangents, uv = _interpolate(barycentrics, geometry.tangents[corners]), _interpolate(barycentrics, uvs)
        return cls(hits.face >= 0, p, uvs, twice_area, face_normal, position, normal, tangents, uv)

    def footprint(
        self, distance: Shaped[F32, " n"], directions: Shaped[F32, "n 3"], pixel_angle: float
    ) -> Shaped[F32, " n"]:
        """Side of a pixel's footprint in texture space, from the ratio of the triangle's areas there and in the world.

        Args:
            distance, directions: distances and directions of the rays. pixel_angle: angle of a pixel, radians.
        """
        (du_0, dv_0), (du_1, dv_1) = np.diff(self.uvs, axis=1).transpose(1, 2, 0)
        uv_area = np.abs(du_0 * dv_1 - dv_0 * du_1)
        cosine = np.maximum(-np.einsum("nc,nc->n", self.face_normal, directions), 0.05)
        return np.asarray(distance * pixel_angle * np.sqrt(uv_area / np.maximum(self.twice_area, 1e-20) / cosine))

    def pixel_sides(
        self, distance: Shaped[F32, " n"], directions: Shaped[F32, "n 3"], pixel_angle: float
    ) -> Shaped[F32, "n 2 3"]:
        """Two sides of a pixel's footprint on the surface, meters: across the view direction, and the longer along it.

        Args:
            distance, directions, pixel_angle: as for `footprint`.
        """
        slant = np.einsum("nc,nc->n", self.face_normal, directions)[:, None]
        along_view = unit(directions - slant * self.face_normal, any_tangent(self.face_normal))
        across_view = np.cross(self.face_normal, along_view)
        side = distance[:, None] * pixel_angle
        return np.stack([side * across_view, side / np.maximum(-slant, 0.05) * along_view], axis=1).astype(np.float32)

    def texture_sides(self, sides: Shaped[F32, "n 2 3"]) -> Shaped[F32, "n 2 2"]:
        """Sides of pixels' footprints in texture space, as rows of u and v; zero for a triangle without an area.

        Args:
            sides: from `pixel_sides`.
        """
        edges, uv_edges = self.p[:, 1:] - self.p[:, :1], self.uvs[:, 1:] - self.uvs[:, :1]
        across_edges = np.cross(edges[:, 0], edges[:, 1])
        area_squared = np.maximum(np.einsum("nc,nc->n", across_edges, across_edges), 1e-30)[:, None]
        out = np.empty((len(sides), 2, 2), np.float32)
        for k in range(2):
            first = np.einsum("nc,nc->n", np.cross(sides[:, k], edges[:, 1]), across_edges)[:, None]
            second = np.einsum("nc,nc->n", np.cross(edges[:, 0], sides[:, k]), across_edges)[:, None]
            out[:, k] = (first * uv_edges[:, 0] + second * uv_edges[:, 1]) / area_squared
        return out


def positions_on_faces(
    geometry: SceneBuffers, face: Shaped[NDArray[np.integer], " n"], uv: Shaped[F32, "n 2"], normal: Shaped[F32, "n 3"]
) -> Shaped[F32, "n 3"]:
    """Points on faces with the same offsets as in `surface_at`, and no other surface data.

    Args:
        geometry: the triangles. face: face indices.
        uv: barycentric coordinates of the second and third corner.
        normal: face normals, unit, on the side of the points.
    """
    p = geometry.positions[geometry.faces[face]]
    twice_area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    barycentrics = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    inner_barycentrics = _move_off_edges(barycentrics, p, twice_area, EDGE_OFFSET_FRACTION * geometry.epsilon)
    return np.asarray(_interpolate(inner_barycentrics, p) + geometry.epsilon * normal, np.float32)


def _interpolate(barycentrics: F32, corners: F32) -> F32:
    """Interpolate corner values. barycentrics: (n, 3). corners: (n, 3, c). Returns (n, c)"""
    return np.asarray(np.einsum("nk,nkc->nc", barycentrics, corners))


def _move_off_edges(barycentrics: F32, p: F32, twice_area: F32, epsilon: float) -> F32:
    """Move points on an edge of their triangle inside.

    A point on the edge of two walls would lie in the plane of the other wall and see behind it.

    Args:
        barycentrics: barycentric coordinates. (n, 3). p: corners. (n, 3, 3). epsilon: least distance from the edges,
            meters, but at most a tenth of the triangle's height.
    """
    moved = np.maximum(barycentrics, min_barycentrics(p, twice_area, epsilon))
    return np.asarray(moved / moved.sum(axis=1, keepdims=True), np.float32)


def min_barycentrics(p: Shaped[F32, "n 3 3"], twice_area: Shaped[F32, " n"], epsilon: float) -> Shaped[F32, "n 3"]:
    """Least barycentric coordinates of points off the edges of triangles. See `_move_off_edges`."""
    edges = np.linalg.norm(p[:, [1, 2, 0]] - p[:, [2, 0, 1]], axis=2)  # opposite to each corner
    minimum = np.minimum(epsilon * edges, 0.1 * twice_area[:, None]) / np.maximum(twice_area, 1e-20)[:, None]
    return np.asarray(minimum, np.float32)
