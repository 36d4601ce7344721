"""Local lights of the reference: points of each drawn at random, their shadows found by what a ray hits first.

It shares no kernel with pictures: float64, formulas as docs/lights.md states them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relume.look import LightLook, Look
from relume.look.model import DirectionalLook, MeshLook, RectangleLook, SpotLook
from relume.points import ALIKE
from relume.scene.model import Scene, Texture
from relume.trace.geometry import Geometry
from relume.trace.primary import trace_from
from relume.trace.texture import MipMap

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_BEHIND = 1e9  # metres: where directional light comes from
_RAYS_AT_ONCE = 8192  # more would be shared out to threads that wait for this one already
_SLACK = 4.0  # times the geometry's epsilon: a ray that ends on a surface may find it so much sooner


@dataclass(frozen=True)
class Arriving:
    """Light of one lamp at points. direction: unit, (n, m, 3). power: irradiance across it, 0 if hidden, (n, m, 3)"""

    direction: F64
    power: F64


@dataclass(frozen=True)
class LocalLamp:
    """A light of a look in a scene.

    Attributes:
        triangles: of one of kind "mesh". (T, 3, 3) float64. is_two_sided: whether they shine to both sides.
        uvs: of their corners. (T, 3, 2) image: of what they shine, over its mean; None where that is even.
    """

    look: LightLook
    triangles: F64
    is_two_sided: bool
    uvs: F64
    image: Texture | None

    def arriving(
        self, geometry: Geometry, position: F64, num: int, rng: np.random.Generator, chance: F32 = ALIKE
    ) -> Arriving:
        """Light that arrives at points from places of the lamp's surface, or from the one place that it has.

        Args:
            geometry: in which shadow rays are traced.
            position: of the points, metres. (n, 3) float64
            num: places that are drawn for each point.
            rng: where they are drawn from.
            chance: of the rays of each point, or of all; see `relume.points.Points`. (n,) or (1,)
        """
        away, factor = self._towards(position, num, rng)
        distance = np.linalg.norm(away, axis=2)
        direction = away / distance[..., None]
        flat = direction.reshape(-1, 3).astype(np.float32)
        start = np.repeat(position, direction.shape[1], axis=0).astype(np.float32)
        of_rays = chance if len(chance) == 1 else np.repeat(chance, direction.shape[1])
        free = free_distance(geometry, start, flat, of_rays).reshape(distance.shape)
        is_seen = free > distance - _SLACK * geometry.epsilon - 1e-5 * distance
        return Arriving(direction, factor * is_seen[..., None] * np.array(self.look.gain))

    def _towards(self, position: F64, num: int, rng: np.random.Generator) -> tuple[F64, F64]:
        """Vectors to places of the lamp (n, m, 3), and what a unit of emission gives from there. (n, m, 1 or 3)"""
        light = self.look
        if isinstance(light, DirectionalLook):
            away = np.broadcast_to(-_BEHIND * _unit(light.direction), (len(position), 1, 3))
            return away, np.ones((len(position), 1, 1))
        if isinstance(light, RectangleLook):
            return self._from_surface(position, *_places_of_rectangle(light, len(position), num, rng))
        if isinstance(light, MeshLook):
            places = _places_of_triangles(self.triangles, self.uvs, len(position), num, rng)
            away, factor = self._from_surface(position, *places[:3])
            return away, factor if self.image is None else factor * _looked_up(self.image, places[3])
        away = (np.array(light.position) - position)[:, None]
        squared = (away**2).sum(axis=2)
        if not isinstance(light, SpotLook):
            return away, 1 / squared[..., None]
        inner, outer = np.cos(np.radians(light.cone))
        cosine = -(away @ _unit(light.direction)) / np.sqrt(squared)
        falloff = np.clip((cosine - outer) / max(1e-3, inner - outer), 0, 1)
        return away, (falloff**2 / squared)[..., None]

    def _from_surface(self, position: F64, place: F64, normal: F64, area: float) -> tuple[F64, F64]:
        away = place - position[:, None]
        squared = np.maximum((away**2).sum(axis=2), 1e-20)
        cosine = -(away * normal).sum(axis=2) / np.sqrt(squared)
        facing = np.abs(cosine) if self.is_two_sided else np.maximum(cosine, 0)
        return away, (area * facing / squared / place.shape[1])[..., None]


def lamps_of(scene: Scene, look: Look) -> list[LocalLamp]:
    """The local lights of a look that give any light."""
    lamps = []
    for light in look.lights.values():
        triangles, uvs, is_two_sided, image = np.zeros((0, 3, 3)), np.zeros((0, 3, 2)), False, None
        if isinstance(light, MeshLook):
            material = next(k for k, m in enumerate(scene.materials) if m.name == light.material)
            meshes = [mesh for mesh in scene.meshes if mesh.material == material]
            corners = [mesh.positions[mesh.faces].astype(np.float64) for mesh in meshes]
            triangles, is_two_sided = np.concatenate([triangles, *corners]), scene.materials[material].double_sided
            uvs = np.concatenate([uvs, *(mesh.uvs[mesh.faces].astype(np.float64) for mesh in meshes)])
            image = scene.materials[material].textures.get("emission")
        is_dark = isinstance(light, MeshLook) and not _areas(triangles).any()
        if any(light.gain) and not is_dark:
            lamps.append(LocalLamp(light, triangles, is_two_sided, uvs, image))
    return lamps


def free_distance(geometry: Geometry, start: F32, direction: F32, chance: F32 = ALIKE) -> F32:
    """How far rays fly until they hit anything.

    Args:
        geometry: that is traced.
        start: origins, metres. (n, 3) float32
        direction: unit vectors. (n, 3) float32
        chance: of the rays at surfaces that blend; see `relume.points.Points`. (n,) or (1,) float32
    Returns:
        Metres, infinite where nothing is hit. (n,) float32
    """
    some = (slice(k, k + _RAYS_AT_ONCE) for k in range(0, len(direction), _RAYS_AT_ONCE))
    return np.concatenate([
        trace_from(
            geometry.embree, start[rows], direction[rows], chance if len(chance) == 1 else chance[rows]
        ).distance
        for rows in some
    ])  # fmt: skip


def emission_of(lamps: Sequence[LocalLamp], material: str) -> F64:
    """Radiance that the surfaces of a material send out themselves. (3,)"""
    gains = [lamp.look.gain for lamp in lamps if isinstance(lamp.look, MeshLook) and lamp.look.material == material]
    return np.asarray(np.array(gains, np.float64).reshape(-1, 3).sum(axis=0))


def _unit(direction: ArrayLike) -> F64:
    vector = np.asarray(direction, np.float64)
    return np.asarray(vector / np.linalg.norm(vector))


def _areas(triangles: F64) -> F64:
    a, b, c = triangles.transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _places_of_rectangle(
    light: RectangleLook, num_points: int, num: int, rng: np.random.Generator
) -> tuple[F64, F64, float]:
    """Places (n, m, 3), one in each cell of a grid; normals; the area."""
    facing, turn = _unit(light.direction), np.radians(light.rotation)
    reference = (0.0, 1.0, 0.0) if np.hypot(facing[0], facing[2]) > 1e-3 else (0.0, 0.0, 1.0)
    across = _unit(np.cross(reference, facing))
    up = np.cross(facing, across)
    width = np.cos(turn) * across + np.sin(turn) * up
    height = np.cos(turn) * up - np.sin(turn) * across
    side = max(1, round(np.sqrt(num)))
    cell = np.arange(side * side)
    u, v = (np.stack([cell % side, cell // side]) + rng.random((num_points, 2, side * side))).transpose(1, 0, 2) / side
    offset = light.size[0] * (u - 0.5)[..., None] * width + light.size[1] * (v - 0.5)[..., None] * height
    return np.array(light.position) + offset, facing, light.size[0] * light.size[1]


def _looked_up(image: Texture, uv: F64) -> F64:
    """The texels of an image at places (n, m, 2), unfiltered but for the nearest four. (n, m, 3)"""
    flat = uv.reshape(-1, 2).astype(np.float32)
    found = MipMap.of(image).sample(flat, np.zeros(len(flat), np.float32))
    return np.asarray(found.reshape(*uv.shape[:2], 3), np.float64)


def _places_of_triangles(
    triangles: F64, uvs: F64, num_points: int, num: int, rng: np.random.Generator
) -> tuple[F64, F64, float, F64]:
    """Places (n, m, 3), evenly by area; their normals (n, m, 3); the area; their places in images (n, m, 2)."""
    areas = _areas(triangles)
    strata = (np.arange(num) + rng.random((num_points, num))) / num
    chosen = np.minimum(np.searchsorted(np.cumsum(areas) / areas.sum(), strata, side="right"), len(areas) - 1)
    u, v = rng.random((2, num_points, num, 1))
    root = np.sqrt(u)
    a, b, c = triangles[chosen].transpose(2, 0, 1, 3)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    weights = 1 - root, root * (1 - v), root * v
    place = sum(weight * corner for weight, corner in zip(weights, (a, b, c), strict=True))
    uv = sum(weight * uvs[chosen][:, :, k] for k, weight in enumerate(weights))
    return np.asarray(place), normal, float(areas.sum()), np.asarray(uv)
