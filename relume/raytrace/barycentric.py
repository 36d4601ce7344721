"""Places on triangles, off their edges and off their plane: where rays meet them, textures left out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.tangents import unit

F32 = NDArray[np.float32]

# of the distance that ray origins keep from their surface; many times what positions are rounded by
EDGE_OFFSET_FRACTION = 1 / 8


class FacePoints(NamedTuple):
    """Where n rays meet their triangles, textures left out.

    Attributes:
        is_hit: whether a ray meets any; else what follows is that of the first triangle. (n,)
        p, uvs: corners. (n, 3, 3), (n, 3, 2). twice_area: (n,)
        face_normal: to the side that is seen. (n, 3)
        position: off the surface. normal: shading normals. (n, 3) each
        tangents: with the sign of the bitangent. (n, 4)
        uv: places in textures. (n, 2)
    """

    is_hit: NDArray[np.bool_]
    p: F32
    uvs: F32
    twice_area: F32
    face_normal: F32
    position: F32
    normal: F32
    tangents: F32
    uv: F32

    @classmethod
    def from_hits(cls, geometry: SceneBuffers, hits: Hits, directions: F32) -> FacePoints:
        """Those of rays. geometry: the triangles. hits: the first of each. directions: of the rays. (n, 3)"""
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

    def footprint(self, distance: F32, directions: F32, pixel_angle: float) -> F32:
        """Side of a pixel's footprint in textures: its area over the triangle's, in texture space. (n,)

        Args:
            distance: that rays go. (n,) directions: of these. (n, 3) pixel_angle: that a pixel spans, radians.
        """
        (du_0, dv_0), (du_1, dv_1) = np.diff(self.uvs, axis=1).transpose(1, 2, 0)
        uv_area = np.abs(du_0 * dv_1 - dv_0 * du_1)
        cosine = np.maximum(-np.einsum("nc,nc->n", self.face_normal, directions), 0.05)
        return np.asarray(distance * pixel_angle * np.sqrt(uv_area / np.maximum(self.twice_area, 1e-20) / cosine))


def positions_on_faces(geometry: SceneBuffers, face: NDArray[np.integer], uv: F32, normal: F32) -> F32:
    """Points of faces, moved off them, as `surface_at` has them, and nothing else of what is there.

    Args:
        geometry: the triangles. face: numbers of n faces.
        uv: places on them, barycentric, of the second and third corner. (n, 2)
        normal: of the faces, unit, to the side that the points are on. (n, 3)
    Returns:
        (n, 3) float32
    """
    p = geometry.positions[geometry.faces[face]]
    twice_area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    barycentrics = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    inner_barycentrics = _move_off_edges(barycentrics, p, twice_area, EDGE_OFFSET_FRACTION * geometry.epsilon)
    return np.asarray(_interpolate(inner_barycentrics, p) + geometry.epsilon * normal, np.float32)


def _interpolate(barycentrics: F32, corners: F32) -> F32:
    """Interpolate what corners have. shares: barycentric. (n, 3). corners: (n, 3, c). Returns (n, c)"""
    return np.asarray(np.einsum("nk,nkc->nc", barycentrics, corners))


def _move_off_edges(barycentrics: F32, p: F32, twice_area: F32, epsilon: float) -> F32:
    """Move points that lie on an edge of their triangle inside.

    Where two walls meet, a point on the one would lie in the other's plane, and see what is behind it.

    Args:
        barycentrics: barycentric coordinates. (n, 3). p: corners. (n, 3, 3). epsilon: least distance from the edges,
            metres, but that a tenth of a height is enough.
    """
    moved = np.maximum(barycentrics, min_barycentrics(p, twice_area, epsilon))
    return np.asarray(moved / moved.sum(axis=1, keepdims=True), np.float32)


def min_barycentrics(p: F32, twice_area: F32, epsilon: float) -> F32:
    """Find the least barycentric coordinates of points off triangles' edges. See `_move_off_edges`. (n, 3) float32"""
    edges = np.linalg.norm(p[:, [1, 2, 0]] - p[:, [2, 0, 1]], axis=2)  # opposite to each corner
    minimum = np.minimum(epsilon * edges, 0.1 * twice_area[:, None]) / np.maximum(twice_area, 1e-20)[:, None]
    return np.asarray(minimum, np.float32)
