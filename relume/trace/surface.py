"""Points on surfaces: interpolated position, normals, tangent and textures of ray hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_ranges
from relume.points import Points
from relume.scene.model import Material
from relume.scene.roughness import widened, widening_base
from relume.trace.geometry import Geometry
from relume.trace.leaning import covered_length, mapped_normal, towards_viewer
from relume.trace.on_faces import OnFaces
from relume.trace.primary import Hits
from relume.trace.tangents import across
from relume.trace.texture import MipMap

F32 = NDArray[np.float32]

_IMAGES = ("diffuse", "specular", "emission")
_RAYS_A_RANGE = 16_384


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


class _Textured(NamedTuple):
    """What textures say of n points.

    Attributes:
        channels: of images. (n, 3) each, roughness (n, 1). length: of the mean of normals that a pixel covers. (n,)
        normal: leant by normal maps. (n, 3)
    """

    channels: dict[str, F32]
    length: F32
    normal: F32

    @classmethod
    def of(cls, on: OnFaces, materials: Sequence[Material], material: NDArray[np.integer], footprint: F32) -> _Textured:
        """Those of points. material: that each is of, −1 for none. (n,) footprint: of a pixel in textures. (n,)"""
        channels = dict(zip(_IMAGES, np.ones((3, *on.position.shape), np.float32), strict=True))
        channels["roughness"] = np.ones((len(on.uv), 1), np.float32)
        length, normal = np.ones(len(on.uv), np.float32), on.normal
        for index, m in enumerate(materials):
            rows = np.nonzero(material == index)[0]
            if not len(rows):
                continue
            for name, out in channels.items():
                if name in m.textures:
                    out[rows] = MipMap.of(m.textures[name]).sample(on.uv[rows], footprint[rows])
            if m.normal_map is not None:
                pyramid = MipMap.of(m.normal_map)
                mapped = pyramid.sample(on.uv[rows], footprint[rows])
                length[rows] = covered_length(mapped, pyramid.texels(footprint[rows]))
                if (own := widening_base(m)) is not None:
                    channels["roughness"][rows, 0] = widened(channels["roughness"][rows, 0], length[rows], own)
                normal = normal.copy() if normal is on.normal else normal
                normal[rows] = mapped_normal(mapped, normal[rows], on.tangents[rows], on.face_normal[rows])
        return cls(channels, length, normal)


def _surface_at(
    geometry: Geometry,
    hits: Hits,
    directions: F32,
    materials: Sequence[Material],
    pixel_angle: float,
) -> tuple[F32, ...]:
    """Interpolate a range of `surface_at`: position, normal, tangent, and the others of `Surface` in their order."""
    on = OnFaces.of(geometry, hits, directions)
    hit, distance = on.hit, np.where(on.hit, hits.distance, 1.0)
    footprint = on.footprint(distance, directions, pixel_angle) if materials else np.zeros(len(hit), np.float32)
    material = np.where(hit, geometry.face_material[np.maximum(hits.face, 0)], -1)
    channels, length, leant = _Textured.of(on, materials, material, footprint)
    normal = towards_viewer(leant, directions)
    tangent = across(on.tangents[:, :3], normal)
    place = _in_texture(on.p, on.uvs, on.uv, normal, tangent)
    place[:, 2] = footprint
    is_flat = place[:, 4] == 0
    if is_flat.any():
        of_flat = (each[is_flat] for each in (on.position, on.face_normal, normal, tangent, distance * pixel_angle))
        place[is_flat] = _projected(*of_flat)
    return (
        np.where(hit[:, None], on.position, directions).astype(np.float32),
        np.where(hit[:, None], normal, -directions).astype(np.float32),
        tangent,
        channels["diffuse"],
        channels["specular"],
        place.astype(np.float32),
        channels["roughness"][:, 0],
        length,
        channels["emission"],
        on.normal.astype(np.float32, copy=False),
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
