"""Points on surfaces: interpolated position, normals, tangent and textures of ray hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.thread_pools import for_ranges
from relume.raytrace.barycentric import FacePoints
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.shading_normals import flip_to_viewer, mapped_normal, mean_normal
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.tangents import project_to_tangent
from relume.raytrace.texture import MipMap
from relume.scene.model import Material

F32 = NDArray[np.float32]

_TEXTURE_NAMES = ("diffuse", "specular", "emission")
_RAYS_PER_RANGE = 16_384


@dataclass(frozen=True)
class SurfaceInteraction:
    """Surface points and texture values at n ray hits.

    Attributes:
        points: points with normals toward the viewer, off the surface as `relume.raytrace.ray_origins` has it; their
            seeds are their indices.
        diffuse, specular: texture channels, 1 without a texture.
        uv: texture coordinates (u, v), side of the pixel's footprint in UV space, angle from the tangent to the u axis
            in radians, −1 if the texture is mirrored, else 1; then the two sides of that footprint, (u, v) each.
            Triangles without UV coordinates use tri-planar mapping in meters.
        roughness: relative to the material's terms, 1 without a roughness map.
        normal_length: length of the mean normal in the pixel, 1 without a normal map.
        emission: relative to the mean of the material's surfaces, 1 without an emission texture.
        surface_normal: normals without normal mapping, the base for overridden normal maps.
    """

    points: SurfacePoints
    diffuse: Shaped[F32, "n 3"]
    specular: Shaped[F32, "n 3"]
    uv: Shaped[F32, "n 9"]
    roughness: Shaped[F32, " n"]
    normal_length: Shaped[F32, " n"]
    emission: Shaped[F32, "n 3"]
    surface_normal: Shaped[F32, "n 3"]

    def rows(self, rows: NDArray[np.integer]) -> SurfaceInteraction:
        """Select points; their seeds become their new indices."""
        points = self.points.rows(rows)._replace(seed=np.arange(len(rows), dtype=np.uint32))
        surface_columns = (
            self.diffuse, self.specular, self.uv, self.roughness, self.normal_length, self.emission,
            self.surface_normal,
        )  # fmt: skip
        return SurfaceInteraction(points, *(column[rows] for column in surface_columns))


def surface_at(
    geometry: SceneBuffers,
    hits: Hits,
    directions: Shaped[F32, "n 3"],
    materials: Sequence[Material] = (),
    pixel_angle: float = 0.0,
) -> SurfaceInteraction:
    """Interpolate the surface at ray hits.

    Args:
        geometry: the triangles. hits: the first hits of n rays.
        directions: directions of the rays, unit.
        materials: if given, textures and normal maps are evaluated, filtered over the pixel.
        pixel_angle: angle of a pixel, radians.
    Returns:
        Points; for rays without a hit the normal faces the viewer and the position is the ray's direction.
    """
    ranges: dict[int, tuple[F32, ...]] = {}

    def interpolate(start: int, stop: int) -> None:
        rows = slice(start, stop)
        ranges[start] = _interpolate_range(geometry, hits.rows(rows), directions[start:stop], materials, pixel_angle)

    for_ranges(interpolate, max(1, len(directions)), _RAYS_PER_RANGE)
    columns = zip(*(ranges[start] for start in sorted(ranges)), strict=True)
    position, normal, tangent, *surface_columns = map(np.concatenate, columns)
    seed = np.arange(len(directions), dtype=np.uint32)
    return SurfaceInteraction(SurfacePoints(position, normal, tangent, seed), *surface_columns)


class _Textured(NamedTuple):
    """Texture values at n points.

    Attributes:
        channels: channels of textures. (n, 3) each, roughness (n, 1).
        length: length of the mean normal in the pixel. (n,)
        normal: after normal mapping. (n, 3)
    """

    channels: dict[str, F32]
    length: F32
    normal: F32

    @classmethod
    def sample(
        cls,
        face_points: FacePoints,
        materials: Sequence[Material],
        material: NDArray[np.integer],
        axes: Shaped[F32, "n 2 2"],
    ) -> _Textured:
        """Look up textures.

        Args:
            material: index, −1 for none. (n,)
            axes: sides of the pixels' footprints in UV space.
        """
        channels = dict(zip(_TEXTURE_NAMES, np.ones((3, *face_points.position.shape), np.float32), strict=True))
        channels["roughness"] = np.ones((len(face_points.uv), 1), np.float32)
        length, normal = np.ones(len(face_points.uv), np.float32), face_points.normal
        for index, scene_material in enumerate(materials):
            rows = np.nonzero(material == index)[0]
            if not len(rows):
                continue
            for name, out in channels.items():
                if name in scene_material.textures:
                    pyramid = MipMap.for_texture(scene_material.textures[name])
                    out[rows] = pyramid.sample_pixels(face_points.uv[rows], axes[rows])
            if scene_material.normal_map is not None:
                mapped, length[rows] = mean_normal(scene_material.normal_map, face_points.uv[rows], axes[rows])
                normal = normal.copy() if normal is face_points.normal else normal
                normal[rows] = mapped_normal(
                    mapped, normal[rows], face_points.tangents[rows], face_points.face_normal[rows]
                )
        return cls(channels, length, normal)


def _interpolate_range(
    geometry: SceneBuffers,
    hits: Hits,
    directions: F32,
    materials: Sequence[Material],
    pixel_angle: float,
) -> tuple[F32, ...]:
    """Interpolate a range of `surface_at`: position, normal, tangent, and the textures of `SurfaceInteraction`."""
    face_points = FacePoints.from_hits(geometry, hits, directions)
    is_hit, distance = face_points.is_hit, np.where(face_points.is_hit, hits.distance, 1.0)
    sides = face_points.pixel_sides(distance, directions, pixel_angle)
    footprint, axes = np.zeros(len(is_hit), np.float32), np.zeros((len(is_hit), 2, 2), np.float32)
    if materials:
        footprint = face_points.footprint(distance, directions, pixel_angle)
        axes = face_points.texture_sides(sides)
    material = np.where(is_hit, geometry.face_material[np.maximum(hits.face, 0)], -1)
    channels, length, mapped = _Textured.sample(face_points, materials, material, axes)
    normal = flip_to_viewer(mapped, directions)
    tangent = project_to_tangent(face_points.tangents[:, :3], normal)
    uv_frame = np.empty((len(is_hit), 9))
    uv_frame[:, :5] = _texture_frame(face_points.p, face_points.uvs, face_points.uv, normal, tangent)
    uv_frame[:, 2], uv_frame[:, 5:] = footprint, axes.reshape(-1, 4)
    lacks_uv = uv_frame[:, 4] == 0
    if lacks_uv.any():
        flat_columns = (
            column[lacks_uv] for column in (face_points.position, face_points.face_normal, normal, tangent, sides)
        )
        uv_frame[lacks_uv] = _triplanar_frame(*flat_columns)
    return (
        np.where(is_hit[:, None], face_points.position, directions).astype(np.float32),
        np.where(is_hit[:, None], normal, -directions).astype(np.float32),
        tangent,
        channels["diffuse"],
        channels["specular"],
        uv_frame.astype(np.float32),
        channels["roughness"][:, 0],
        length,
        channels["emission"],
        face_points.normal.astype(np.float32, copy=False),
    )


def _texture_frame(p: F32, uvs: F32, uv: F32, normal: F32, tangent: F32) -> F32:
    """Texture coordinates and orientation, without the footprint; see `SurfaceInteraction.uv`.

    Args:
        p, uvs: corners of the triangles. (n, 3, 3), (n, 3, 2). uv: UV coordinates of the points. (n, 2)
        normal, tangent: normals and tangents of the points. (n, 3) each
    Returns:
        (n, 5); the last is 0 if a triangle has no area in UV space.
    """
    position_edges, uv_edges = p[:, 1:] - p[:, :1], uvs[:, 1:] - uvs[:, :1]
    area = uv_edges[:, 0, 0] * uv_edges[:, 1, 1] - uv_edges[:, 1, 0] * uv_edges[:, 0, 1]
    sign = np.sign(area)[:, None]
    along_u = sign * (position_edges[:, 0] * uv_edges[:, 1, 1:] - position_edges[:, 1] * uv_edges[:, 0, 1:])
    along_v = sign * (position_edges[:, 1] * uv_edges[:, 0, :1] - position_edges[:, 0] * uv_edges[:, 1, :1])
    x, y = np.einsum("nc,nc->n", along_u, tangent), np.einsum("nc,nc->n", along_u, np.cross(normal, tangent))
    is_upright = np.einsum("nc,nc->n", np.cross(normal, along_u), along_v) < 0  # v runs down
    angle, zeros = np.arctan2(y, x), np.zeros(len(uv))
    return np.asarray(np.column_stack([uv, zeros, angle, np.where(area == 0, 0, np.where(is_upright, 1, -1))]))


def triplanar_axes(
    face_normal: Shaped[F32, "n 3"],
) -> tuple[Shaped[NDArray[np.float64], "n 3"], Shaped[NDArray[np.float64], "n 3"]]:
    """Unit axes along u and against v of the tri-planar mapping, the projection along the dominant axis of a face."""
    axis = np.abs(face_normal).argmax(axis=1)
    sign = np.where(np.take_along_axis(face_normal, axis[:, None], 1)[:, 0] < 0, -1, 1)
    u_axis = np.eye(3)[np.array([2, 0, 0])[axis]] * np.where(axis == 1, 1, np.where(axis == 0, -sign, sign))[:, None]
    return u_axis, np.cross(sign[:, None] * np.eye(3)[axis], u_axis)


def triplanar_uvs(points: Shaped[F32, "faces 3 3"], face_normal: Shaped[F32, "faces 3"]) -> Shaped[F32, "faces 3 2"]:
    """Texture coordinates of tri-planar mapping at the corners of triangles, one repeat per meter.

    Args:
        points: the corners, meters. face_normal: of any length.
    """
    u_axis, v_axis = triplanar_axes(face_normal)
    uv = np.einsum("fkc,fc->fk", points, u_axis), -np.einsum("fkc,fc->fk", points, v_axis)
    return np.stack(uv, axis=-1).astype(np.float32)


def _triplanar_frame(position: F32, face_normal: F32, normal: F32, tangent: F32, sides: F32) -> F32:
    """Texture coordinates of tri-planar mapping, one repeat per meter; see `SurfaceInteraction.uv`.

    Args:
        position, face_normal, normal, tangent: positions, face normals, normals and tangents of n points. (n, 3) each.
        sides: of the pixels there, meters. (n, 2, 3)
    """
    u_axis, v_axis = triplanar_axes(face_normal)
    u, v = np.einsum("nc,nc->n", position, u_axis), -np.einsum("nc,nc->n", position, v_axis)
    x = np.einsum("nc,nc->n", u_axis, tangent)
    y = np.einsum("nc,nc->n", u_axis, np.cross(normal, tangent))
    flat = np.einsum("nsc,nuc->nsu", sides, np.stack([u_axis, -v_axis], axis=1))
    side, angle = np.linalg.norm(sides[:, 0], axis=1), np.arctan2(y, x)
    return np.asarray(np.column_stack([u, v, side, angle, np.ones(len(u)), flat.reshape(-1, 4)]))
