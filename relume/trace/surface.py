"""Points on surfaces: interpolated position, normals, tangent and textures of ray hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_ranges
from relume.points import Points
from relume.scene.model import Material
from relume.scene.roughness import widened, widening_base
from relume.trace.geometry import Geometry
from relume.trace.primary import Hits
from relume.trace.texture import MipMap

F32 = NDArray[np.float32]

_IMAGES = ("diffuse", "specular", "emission")
_RAYS_A_RANGE = 16_384
OFF_EDGES = 1 / 8  # of the distance that ray origins keep from their surface; many times what positions are rounded by
LEAST_FACING = 0.01  # cosine between a shading normal and the way back of its ray


@dataclass(frozen=True)
class Surface:
    """What n rays see: points of surfaces, and the textures there.

    Attributes:
        points: turned to the viewer, moved off the surface by the scene's epsilon; their seeds are their numbers.
        diffuse, specular: texture channels, 1 where the material has none. (n, 3) float32
        uv: places in textures (u, v), side of what a pixel covers there, angle from the tangent to the texture's x axis
            in radians, −1 where the texture is seen mirrored, else 1. Where a triangle has no place in textures, it
            is that of a projection along the axis of the world that it faces most, in metres. (n, 5) float32
        roughness: over what the material's terms say, 1 where it has no map. (n,) float32
        normal_length: of the mean of the normals that a pixel covers, 1 where there are no bumps. (n,) float32
        emission: over the mean of the material's surfaces, 1 where it has no image. (n, 3) float32
        surface_normal: normals without bumps, which images of others lean; the points' own where there are none.
            (n, 3) float32
    """

    points: Points
    diffuse: F32
    specular: F32
    uv: F32
    roughness: F32
    normal_length: F32
    emission: F32
    surface_normal: F32

    def rows(self, chosen: NDArray[np.integer]) -> Surface:
        """Choose some of them; their seeds are their new numbers."""
        points = self.points.rows(chosen)._replace(seed=np.arange(len(chosen), dtype=np.uint32))
        of_surface = (
            self.diffuse, self.specular, self.uv, self.roughness, self.normal_length, self.emission,
            self.surface_normal,
        )  # fmt: skip
        return Surface(points, *(each[chosen] for each in of_surface))


def _unit(v: F32, otherwise: F32) -> F32:
    """Scale vectors (n, 3) to length one; where they have none, take another."""
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.where(length > 1e-12, v / np.maximum(length, 1e-12), otherwise).astype(np.float32)


def any_tangent(normal: F32) -> F32:
    """Find a unit vector across each normal (n, 3) (Duff 2017). (n, 3) float32"""
    x, y, z = normal.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    return np.stack([1.0 + sign * x * x * a, sign * x * y * a, -sign * x], axis=-1).astype(np.float32)


def across(vector: F32, normal: F32) -> F32:
    """Take the part of vectors (n, 3) across normals (n, 3), unit; any direction across where there is none."""
    part = vector - np.sum(vector * normal, axis=-1, keepdims=True) * normal
    return _unit(part, any_tangent(normal))


def turn_between(normal: F32, start: F32, end: F32) -> F32:
    """Find the angles from some vectors to others about normals, radians.

    Args:
        normal: unit. (n, 3) start, end: across these, about. (n, 3) each
    Returns:
        Within [−π, π]. (n,) float32
    """
    y, x = np.einsum("nc,nc->n", np.cross(normal, start), end), np.einsum("nc,nc->n", start, end)
    return np.asarray(np.arctan2(y, x), np.float32)


def surface_at(
    geometry: Geometry,
    hits: Hits,
    directions: F32,
    materials: Sequence[Material] = (),
    pixel_angle: float = 0.0,
) -> Surface:
    """Interpolate the surface at ray hits.

    Args:
        geometry: the triangles. hits: the first hits of n rays.
        directions: unit, of the rays. (n, 3) float32
        materials: where given, textures and normal maps are evaluated, filtered over the pixel.
        pixel_angle: angle that a pixel spans, radians.
    Returns:
        Points; where a ray hit nothing the normal faces the viewer and the position is the ray's direction.
    """
    parts: dict[int, tuple[F32, ...]] = {}

    def interpolate(start: int, stop: int) -> None:
        some = slice(start, stop)
        parts[start] = _surface_at(geometry, hits.rows(some), directions[start:stop], materials, pixel_angle)

    for_ranges(interpolate, max(1, len(directions)), _RAYS_A_RANGE)
    columns = zip(*(parts[start] for start in sorted(parts)), strict=True)
    position, normal, tangent, *of_surface = map(np.concatenate, columns)
    seed = np.arange(len(directions), dtype=np.uint32)
    return Surface(Points(position, normal, tangent, seed), *of_surface)


def places_on(geometry: Geometry, face: NDArray[np.integer], uv: F32, normal: F32) -> F32:
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
    shares = np.stack([1 - uv.sum(axis=1), uv[:, 0], uv[:, 1]], axis=1)
    inside = _off_edges(shares, p, twice_area, OFF_EDGES * geometry.epsilon)
    return np.asarray(_blended(inside, p) + geometry.epsilon * normal, np.float32)


def _blended(shares: F32, corners: F32) -> F32:
    """Interpolate what corners have. shares: barycentric. (n, 3). corners: (n, 3, c). Returns (n, c)"""
    return np.asarray(np.einsum("nk,nkc->nc", shares, corners))


def _surface_at(
    geometry: Geometry,
    hits: Hits,
    directions: F32,
    materials: Sequence[Material],
    pixel_angle: float,
) -> tuple[F32, ...]:
    """Interpolate a range of `surface_at`: position, normal, tangent, and the others of `Surface` in their order."""
    hit = hits.face >= 0
    corners = geometry.faces[np.maximum(hits.face, 0)]
    p = geometry.positions[corners]
    face_normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    twice_area = np.linalg.norm(face_normal, axis=1)
    b = np.stack([1 - hits.uv.sum(axis=1), hits.uv[:, 0], hits.uv[:, 1]], axis=1)
    b = _off_edges(b, p, twice_area, OFF_EDGES * geometry.epsilon)
    face_normal = _unit(face_normal, -directions)
    face_normal *= -np.sign(np.einsum("nc,nc->n", face_normal, directions) + 1e-30)[:, None].astype(np.float32)
    normal = _unit(_blended(b, geometry.normals[corners]), face_normal)
    normal = np.where(np.einsum("nc,nc->n", normal, face_normal)[:, None] < 0, -normal, normal)
    tangents = _blended(b, geometry.tangents[corners])
    uv = _blended(b, geometry.uvs[corners])
    position = _blended(b, p) + geometry.epsilon * face_normal
    channels = dict(zip(_IMAGES, np.ones((3, *position.shape), np.float32), strict=True))
    channels["roughness"] = np.ones((len(uv), 1), np.float32)
    length, smooth = np.ones(len(uv), np.float32), normal
    footprint = np.zeros(len(uv), np.float32)
    if materials:
        (du_0, dv_0), (du_1, dv_1) = np.diff(geometry.uvs[corners], axis=1).transpose(1, 2, 0)
        uv_area = np.abs(du_0 * dv_1 - dv_0 * du_1)
        distance = np.where(hit, hits.distance, 1.0)
        cosine = np.maximum(-np.einsum("nc,nc->n", face_normal, directions), 0.05)
        # side of the pixel's footprint in uv: its area over the triangle's, in texture space
        footprint = distance * pixel_angle * np.sqrt(uv_area / np.maximum(twice_area, 1e-20) / cosine)
        material = np.where(hit, geometry.face_material[np.maximum(hits.face, 0)], -1)
        for index, m in enumerate(materials):
            rows = np.nonzero(material == index)[0]
            for name, out in channels.items():
                if name in m.textures and len(rows):
                    out[rows] = MipMap.of(m.textures[name]).sample(uv[rows], footprint[rows])
            if m.normal_map is not None and len(rows):
                pyramid = MipMap.of(m.normal_map)
                mapped = pyramid.sample(uv[rows], footprint[rows])
                length[rows] = covered_length(mapped, pyramid.texels(footprint[rows]))
                if (own := widening_base(m)) is not None:
                    channels["roughness"][rows, 0] = widened(channels["roughness"][rows, 0], length[rows], own)
                normal = normal.copy() if normal is smooth else normal
                normal[rows] = mapped_normal(mapped, normal[rows], tangents[rows], face_normal[rows])
    normal = towards_viewer(normal, directions)
    tangent = across(tangents[:, :3], normal)
    place = _in_texture(p, geometry.uvs[corners], uv, normal, tangent)
    place[:, 2] = footprint
    is_flat = place[:, 4] == 0
    if is_flat.any():
        side = (np.where(hit, hits.distance, 1.0) * pixel_angle)[is_flat]
        place[is_flat] = _projected(position[is_flat], face_normal[is_flat], normal[is_flat], tangent[is_flat], side)
    return (
        np.where(hit[:, None], position, directions).astype(np.float32),
        np.where(hit[:, None], normal, -directions).astype(np.float32),
        tangent,
        channels["diffuse"],
        channels["specular"],
        place.astype(np.float32),
        channels["roughness"][:, 0],
        length,
        channels["emission"],
        smooth.astype(np.float32, copy=False),
    )


def _in_texture(p: F32, uvs: F32, uv: F32, normal: F32, tangent: F32) -> F32:
    """Where points lie in textures, but for the footprint, and how textures lie there; see `Surface.uv`.

    Args:
        p, uvs: corners of their triangles. (n, 3, 3), (n, 3, 2). uv: of the points. (n, 2)
        normal, tangent: of the points. (n, 3) each
    Returns:
        (n, 5); the last is 0 where a triangle has no area in textures.
    """
    e, d = p[:, 1:] - p[:, :1], uvs[:, 1:] - uvs[:, :1]
    area = d[:, 0, 0] * d[:, 1, 1] - d[:, 1, 0] * d[:, 0, 1]
    sign = np.sign(area)[:, None]
    along_u = sign * (e[:, 0] * d[:, 1, 1:] - e[:, 1] * d[:, 0, 1:])
    along_v = sign * (e[:, 1] * d[:, 0, :1] - e[:, 0] * d[:, 1, :1])
    x, y = np.einsum("nc,nc->n", along_u, tangent), np.einsum("nc,nc->n", along_u, np.cross(normal, tangent))
    is_upright = np.einsum("nc,nc->n", np.cross(normal, along_u), along_v) < 0  # v runs down
    turn, none = np.arctan2(y, x), np.zeros(len(uv))
    return np.asarray(np.column_stack([uv, none, turn, np.where(area == 0, 0, np.where(is_upright, 1, -1))]))


def projected_axes(face_normal: F32) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Axes of a texture that is projected along the axis of the world that faces look along most.

    Args:
        face_normal: of n faces. (n, 3)
    Returns:
        Along u, and against v, unit. (n, 3) each
    """
    axis = np.abs(face_normal).argmax(axis=1)
    sign = np.where(np.take_along_axis(face_normal, axis[:, None], 1)[:, 0] < 0, -1, 1)
    across = np.eye(3)[np.array([2, 0, 0])[axis]] * np.where(axis == 1, 1, np.where(axis == 0, -sign, sign))[:, None]
    return across, np.cross(sign[:, None] * np.eye(3)[axis], across)


def _projected(position: F32, face_normal: F32, normal: F32, tangent: F32, side: F32) -> F32:
    """Places of a texture that is projected along the axes of the world, a metre wide; see `Surface.uv`.

    Args:
        position, face_normal, normal, tangent: of n points. (n, 3) each. side: of a pixel there, metres. (n,)
    """
    across, up = projected_axes(face_normal)
    u, v = np.einsum("nc,nc->n", position, across), -np.einsum("nc,nc->n", position, up)
    x = np.einsum("nc,nc->n", across, tangent)
    y = np.einsum("nc,nc->n", across, np.cross(normal, tangent))
    return np.asarray(np.column_stack([u, v, side, np.arctan2(y, x), np.ones(len(u))]))


def _off_edges(b: F32, p: F32, twice_area: F32, epsilon: float) -> F32:
    """Move points that lie on an edge of their triangle inside.

    Where two walls meet, a point on the one would lie in the other's plane, and see what is behind it.

    Args:
        b: barycentric coordinates. (n, 3). p: corners. (n, 3, 3). epsilon: least distance from the edges, metres, but
            that a tenth of a height is enough.
    """
    moved = np.maximum(b, least_shares(p, twice_area, epsilon))
    return np.asarray(moved / moved.sum(axis=1, keepdims=True), np.float32)


def least_shares(p: F32, twice_area: F32, epsilon: float) -> F32:
    """Find the least barycentric coordinates of places off the edges of triangles. See `_off_edges`. (n, 3) float32"""
    edges = np.linalg.norm(p[:, [1, 2, 0]] - p[:, [2, 0, 1]], axis=2)  # opposite to each corner
    least = np.minimum(epsilon * edges, 0.1 * twice_area[:, None]) / np.maximum(twice_area, 1e-20)[:, None]
    return np.asarray(least, np.float32)


def covered_length(mapped: F32, texels: F32) -> F32:
    """How long the mean of the normals is that a pixel covers: one where it covers no more than a texel, for what is
    between two is turned from one to the other, and covers nothing.

    Args:
        mapped: means of normals. (n, 3) texels: side of the pixel, in those of the map. (n,)
    Returns:
        (n,) float32
    """
    covers = np.clip(np.log2(np.maximum(texels, 1)), 0, 1)
    return np.asarray(1 - covers * (1 - np.minimum(np.linalg.norm(mapped, axis=1), 1)), np.float32)


def mapped_normal(mapped: F32, normal: F32, tangents: F32, face_normal: F32) -> F32:
    """Turn tangent-space normals into world space, kept on the outer side of the face.

    Args:
        mapped: means of normals of tangent space. (n, 3) normal: of the surface, unit. (n, 3)
        tangents: not yet across these, with the sign of the bitangent. (n, 4) face_normal: unit. (n, 3)
    """
    tangent = across(tangents[:, :3], normal)
    bitangent = np.cross(normal, tangent) * np.where(tangents[:, 3:] < 0, -1, 1)
    world = mapped[:, :1] * tangent + mapped[:, 1:2] * bitangent + mapped[:, 2:] * normal
    world = _unit(world, normal)
    below = np.einsum("nc,nc->n", world, face_normal)[:, None] <= 0
    return np.where(below, normal, world).astype(np.float32)


def towards_viewer(normal: F32, directions: F32) -> F32:
    """Bend shading normals that face away from the viewer just into view: interpolation must lose no sample.

    Args:
        normal: unit. (n, 3) directions: in which they are seen, unit. (n, 3)
    """
    facing = -np.einsum("nc,nc->n", normal, directions)
    lacking = np.maximum(LEAST_FACING - facing, 0)[:, None]
    return _unit(normal - lacking * directions, -directions)
