"""Points on triangles at ray hits, moved off edges and off the plane, without textures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.raytrace.camera_rays import Hits
from relume.raytrace.ray_origins import ray_origins
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.tangents import any_tangent, unit

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MIN_AREA = 1e-60  # m²; of a triangle without an area


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
    twice_area: Shaped[F64, " n"]
    face_normal: Shaped[F32, "n 3"]
    position: Shaped[F32, "n 3"]
    normal: Shaped[F32, "n 3"]
    tangents: Shaped[F32, "n 4"]
    uv: Shaped[F32, "n 2"]

    @classmethod
    def from_hits(cls, geometry: SceneBuffers, hits: Hits, directions: Shaped[F32, "n 3"]) -> FacePoints:
        """Compute the points of hits. geometry: the triangles. directions: directions of the rays"""
        face = np.maximum(hits.face, 0)
        corners = geometry.faces[face]
        p, uvs, face_normal = geometry.positions[corners], geometry.uvs[corners], geometry.face_normals[face]
        is_inner = np.einsum("nc,nc->n", face_normal, directions) > 0
        face_normal = np.where(is_inner[:, None], -face_normal, face_normal)
        position, barycentrics = ray_origins(geometry.origins, face, hits.uv, is_inner)
        normal = unit(_interpolate(barycentrics, geometry.normals[corners]), face_normal)
        normal = np.where(np.einsum("nc,nc->n", normal, face_normal)[:, None] < 0, -normal, normal)
        tangents, uv = _interpolate(barycentrics, geometry.tangents[corners]), _interpolate(barycentrics, uvs)
        twice_area = np.maximum(2 * geometry.face_areas[face], _MIN_AREA)
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
        return np.asarray(distance * pixel_angle * np.sqrt(uv_area / self.twice_area / cosine), np.float32)

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
        p, uvs = self.p.astype(np.float64), self.uvs
        edges, uv_edges = p[:, 1:] - p[:, :1], uvs[:, 1:] - uvs[:, :1]
        across_edges = np.cross(edges[:, 0], edges[:, 1])
        area_squared = np.maximum(np.einsum("nc,nc->n", across_edges, across_edges), _MIN_AREA**2)[:, None]
        out = np.empty((len(sides), 2, 2), np.float32)
        for k in range(2):
            first = np.einsum("nc,nc->n", np.cross(sides[:, k], edges[:, 1]), across_edges)[:, None]
            second = np.einsum("nc,nc->n", np.cross(edges[:, 0], sides[:, k]), across_edges)[:, None]
            out[:, k] = (first * uv_edges[:, 0] + second * uv_edges[:, 1]) / area_squared
        return out


def positions_on_faces(
    geometry: SceneBuffers,
    face: Shaped[NDArray[np.integer], " n"],
    uv: Shaped[F32, "n 2"],
    toward: Shaped[NDArray[np.floating], "n 3"],
) -> Shaped[F32, "n 3"]:
    """Points on faces with the same offsets as in `surface_at`, and no other surface data.

    Args:
        geometry: the triangles. face: face indices.
        uv: barycentric coordinates of the second and third corner.
        toward: directions to the side of the points.
    """
    is_inner = np.einsum("nc,nc->n", geometry.face_normals[face], toward) < 0
    return ray_origins(geometry.origins, face, uv, is_inner).position


def _interpolate(barycentrics: F32, corners: F32) -> F32:
    """Interpolate corner values. barycentrics: (n, 3). corners: (n, 3, c). Returns (n, c)"""
    return np.asarray(np.einsum("nk,nkc->nc", barycentrics, corners))
