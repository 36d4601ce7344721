"""Local lights of the reference: points of each drawn at random, their shadows found by what a ray hits first.

It shares no kernel with pictures: float64, formulas as docs/direct-light.md#local-lights states them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relume.look import LightLook, Look
from relume.look.model import DirectionalLook, MeshLook, RectangleLook, SpotLook
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.texture import MipMap
from relume.scene.model import Scene, Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_DIRECTIONAL_DISTANCE = 1e9  # metres: where directional light comes from
_RAYS_PER_BATCH = 8192  # more would be shared out to threads that wait for this one already
_SLACK = 4.0  # times the geometry's epsilon: a ray that ends on a surface may find it so much sooner


@dataclass(frozen=True)
class LocalLightSamples:
    """Light of one lamp at points. direction: unit, (n, m, 3). power: irradiance across it, 0 if hidden, (n, m, 3)"""

    direction: F64
    power: F64


@dataclass(frozen=True)
class ReferenceEmitter:
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

    def sample(
        self,
        geometry: SceneBuffers,
        position: F64,
        num: int,
        rng: np.random.Generator,
        alpha_sample: F32 = FIXED_ALPHA_SAMPLE,
    ) -> LocalLightSamples:
        """Light that arrives at points from places of the lamp's surface, or from the one place that it has.

        Args:
            geometry: in which shadow rays are traced.
            position: of the points, metres. (n, 3) float64
            num: places that are drawn for each point.
            rng: where they are drawn from.
            alpha_sample: of the rays of each point, or of all; see `relume.raytrace.surface_points.SurfacePoints`. (n,)
                or (1,)
        """
        to_light, factor = self._sample_vectors(position, num, rng)
        distance = np.linalg.norm(to_light, axis=2)
        direction = to_light / distance[..., None]
        flat = direction.reshape(-1, 3).astype(np.float32)
        start = np.repeat(position, direction.shape[1], axis=0).astype(np.float32)
        ray_alpha_sample = alpha_sample if len(alpha_sample) == 1 else np.repeat(alpha_sample, direction.shape[1])
        ray_length = hit_distance(geometry, start, flat, ray_alpha_sample).reshape(distance.shape)
        is_visible = ray_length > distance - _SLACK * geometry.epsilon - 1e-5 * distance
        return LocalLightSamples(direction, factor * is_visible[..., None] * np.array(self.look.gain))

    def _sample_vectors(self, position: F64, num: int, rng: np.random.Generator) -> tuple[F64, F64]:
        """Vectors to places of the lamp (n, m, 3), and what a unit of emission gives from there. (n, m, 1 or 3)"""
        light = self.look
        if isinstance(light, DirectionalLook):
            to_light = np.broadcast_to(-_DIRECTIONAL_DISTANCE * _unit(light.direction), (len(position), 1, 3))
            return to_light, np.ones((len(position), 1, 1))
        if isinstance(light, RectangleLook):
            return self._surface_factor(position, *_sample_rectangle(light, len(position), num, rng))
        if isinstance(light, MeshLook):
            light_samples = _sample_triangles(self.triangles, self.uvs, len(position), num, rng)
            to_light, factor = self._surface_factor(position, *light_samples[:3])
            return to_light, factor if self.image is None else factor * _sample_texels(self.image, light_samples[3])
        to_light = (np.array(light.position) - position)[:, None]
        distance_squared = (to_light**2).sum(axis=2)
        if not isinstance(light, SpotLook):
            return to_light, 1 / distance_squared[..., None]
        inner, outer = np.cos(np.radians(light.cone))
        cosine = -(to_light @ _unit(light.direction)) / np.sqrt(distance_squared)
        falloff = np.clip((cosine - outer) / max(1e-3, inner - outer), 0, 1)
        return to_light, (falloff**2 / distance_squared)[..., None]

    def _surface_factor(self, position: F64, light_position: F64, normal: F64, area: float) -> tuple[F64, F64]:
        to_light = light_position - position[:, None]
        distance_squared = np.maximum((to_light**2).sum(axis=2), 1e-20)
        cosine = -(to_light * normal).sum(axis=2) / np.sqrt(distance_squared)
        facing = np.abs(cosine) if self.is_two_sided else np.maximum(cosine, 0)
        return to_light, (area * facing / distance_squared / light_position.shape[1])[..., None]


def emitters(scene: Scene, look: Look) -> list[ReferenceEmitter]:
    """The local lights of a look that give any light."""
    local_lights = []
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
            local_lights.append(ReferenceEmitter(light, triangles, is_two_sided, uvs, image))
    return local_lights


def hit_distance(geometry: SceneBuffers, start: F32, direction: F32, alpha_sample: F32 = FIXED_ALPHA_SAMPLE) -> F32:
    """How far rays fly until they hit anything.

    Args:
        geometry: that is traced.
        start: origins, metres. (n, 3) float32
        direction: unit vectors. (n, 3) float32
        alpha_sample: of the rays at surfaces that blend; see `relume.raytrace.surface_points.SurfacePoints`. (n,) or
            (1,) float32
    Returns:
        Metres, infinite where nothing is hit. (n,) float32
    """
    batches = (slice(k, k + _RAYS_PER_BATCH) for k in range(0, len(direction), _RAYS_PER_BATCH))
    return np.concatenate([
        trace_rays(
            geometry.embree, start[rows], direction[rows],
            alpha_sample if len(alpha_sample) == 1 else alpha_sample[rows]
        ).distance
        for rows in batches
    ])  # fmt: skip


def emitted_radiance(local_lights: Sequence[ReferenceEmitter], material: str) -> F64:
    """Radiance that the surfaces of a material send out themselves. (3,)"""
    gains = [
        local_light.look.gain
        for local_light in local_lights
        if isinstance(local_light.look, MeshLook) and local_light.look.material == material
    ]
    return np.asarray(np.array(gains, np.float64).reshape(-1, 3).sum(axis=0))


def _unit(direction: ArrayLike) -> F64:
    vector = np.asarray(direction, np.float64)
    return np.asarray(vector / np.linalg.norm(vector))


def _areas(triangles: F64) -> F64:
    a, b, c = triangles.transpose(1, 0, 2)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def _sample_rectangle(
    light: RectangleLook, num_points: int, num: int, rng: np.random.Generator
) -> tuple[F64, F64, float]:
    """Places (n, m, 3), one in each cell of a grid; normals; the area."""
    facing, rotation = _unit(light.direction), np.radians(light.rotation)
    reference = (0.0, 1.0, 0.0) if np.hypot(facing[0], facing[2]) > 1e-3 else (0.0, 0.0, 1.0)
    across = _unit(np.cross(reference, facing))
    up = np.cross(facing, across)
    width = np.cos(rotation) * across + np.sin(rotation) * up
    height = np.cos(rotation) * up - np.sin(rotation) * across
    side = max(1, round(np.sqrt(num)))
    stratum = np.arange(side * side)
    u, v = (np.stack([stratum % side, stratum // side]) + rng.random((num_points, 2, side * side))).transpose(
        1, 0, 2
    ) / side
    offset = light.size[0] * (u - 0.5)[..., None] * width + light.size[1] * (v - 0.5)[..., None] * height
    return np.array(light.position) + offset, facing, light.size[0] * light.size[1]


def _sample_texels(image: Texture, uv: F64) -> F64:
    """The texels of an image at places (n, m, 2), unfiltered but for the nearest four. (n, m, 3)"""
    flat = uv.reshape(-1, 2).astype(np.float32)
    texels = MipMap.for_texture(image).sample(flat, np.zeros(len(flat), np.float32))
    return np.asarray(texels.reshape(*uv.shape[:2], 3), np.float64)


def _sample_triangles(
    triangles: F64, uvs: F64, num_points: int, num: int, rng: np.random.Generator
) -> tuple[F64, F64, float, F64]:
    """Places (n, m, 3), evenly by area; their normals (n, m, 3); the area; their places in images (n, m, 2)."""
    areas = _areas(triangles)
    strata = (np.arange(num) + rng.random((num_points, num))) / num
    triangle_index = np.minimum(np.searchsorted(np.cumsum(areas) / areas.sum(), strata, side="right"), len(areas) - 1)
    u, v = rng.random((2, num_points, num, 1))
    root = np.sqrt(u)
    a, b, c = triangles[triangle_index].transpose(2, 0, 1, 3)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    weights = 1 - root, root * (1 - v), root * v
    position = sum(weight * corner for weight, corner in zip(weights, (a, b, c), strict=True))
    uv = sum(weight * uvs[triangle_index][:, :, k] for k, weight in enumerate(weights))
    return np.asarray(position), normal, float(areas.sum()), np.asarray(uv)
