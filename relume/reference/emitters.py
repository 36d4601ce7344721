"""Local lights of the reference: random points on each light, with shadow rays.

It shares no kernel with interactive rendering: float64, formulas of docs/direct-light.md#local-lights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped
from numpy.typing import ArrayLike, NDArray

from relume.look import Look
from relume.look.model import DirectionalLook, MeshLook, PointLook, RectangleLook, SingleLightLook, SpotLook
from relume.look.single_lights import single_lights
from relume.raytrace.camera_rays import trace_rays
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE
from relume.raytrace.texture import MipMap
from relume.reference.directional_intensity import directional_intensity
from relume.reference.links import lit_meshes, shadow_casters
from relume.reference.shape_samples import sample_shape, sample_sun, strata
from relume.scene.model import Scene, Texture

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_DIRECTIONAL_DISTANCE = 1e9  # meters to a directional light
_RAYS_PER_BATCH = 8192  # larger batches would be split among threads that already wait for this one
_DISTANCE_SLACK, _POSITION_SLACK = 1e-5, 1e-6  # at the ends of shadow rays: of their length and of its coordinates


@dataclass(frozen=True)
class LocalLightSamples:
    """Samples of one light at points. direction: unit. power: irradiance facing the light, 0 if occluded."""

    direction: Shaped[F64, "n m 3"]
    power: Shaped[F64, "n m 3"]


@dataclass(frozen=True)
class ReferenceEmitter:
    """A light of a look in a scene.

    Attributes:
        triangles: triangles of a mesh light. is_two_sided: emits to both sides.
        uvs: texture coordinates of their corners. image: emission relative to its mean; None if uniform.
        casters: the triangles that cast its shadows. lit_meshes: those that it lights; None: all.
    """

    look: SingleLightLook
    triangles: Shaped[F64, "T 3 3"]
    is_two_sided: bool
    uvs: Shaped[F64, "T 3 2"]
    image: Texture | None
    casters: SceneBuffers
    lit_meshes: Sequence[bool] | None

    def sample(
        self,
        position: Shaped[F64, "n 3"],
        num: int,
        rng: np.random.Generator,
        alpha_sample: Shaped[F32, " #n"] = FIXED_ALPHA_SAMPLE,
    ) -> LocalLightSamples:
        """Sample the light at points: random positions on its surface, or its only position.

        Args:
            position: positions of the points, meters.
            num: number of samples per point.
            rng: random number generator.
            alpha_sample: alpha samples for the rays of each point, or for all; see
                `relume.raytrace.surface_points.SurfacePoints`.
        """
        to_light, factor = self._sample_vectors(position, num, rng)
        distance = np.linalg.norm(to_light, axis=2)
        direction = to_light / distance[..., None]
        flat = direction.reshape(-1, 3).astype(np.float32)
        start = np.repeat(position, direction.shape[1], axis=0).astype(np.float32)
        ray_alpha_sample = alpha_sample if len(alpha_sample) == 1 else np.repeat(alpha_sample, direction.shape[1])
        ray_length = hit_distance(self.casters, start, flat, ray_alpha_sample).reshape(distance.shape)
        largest = np.abs(position[:, None] + to_light).max(axis=2)
        is_visible = ray_length > distance - _DISTANCE_SLACK * distance - _POSITION_SLACK * largest
        return LocalLightSamples(direction, factor * is_visible[..., None] * np.array(self.look.gain))

    def _sample_vectors(self, position: F64, num: int, rng: np.random.Generator) -> tuple[F64, F64]:
        """Vectors to points of the light (n, m, 3), and irradiance per unit of emission. (n, m, 1 or 3)"""
        light = self.look
        if isinstance(light, DirectionalLook) and light.angle > 0:
            direction, irradiance = sample_sun(light, len(position), num, rng)
            return _DIRECTIONAL_DISTANCE * direction, np.full((*direction.shape[:2], 1), irradiance)
        if isinstance(light, DirectionalLook):
            to_light = np.broadcast_to(-_DIRECTIONAL_DISTANCE * _unit(light.direction), (len(position), 1, 3))
            return to_light, np.ones((len(position), 1, 1))
        if isinstance(light, RectangleLook):
            return self._surface_factor(position, *_sample_rectangle(light, len(position), num, rng))
        if (samples := sample_shape(light, len(position), num, rng)) is not None:
            return self._surface_factor(position, *samples)
        if isinstance(light, MeshLook):
            light_samples = _sample_triangles(self.triangles, self.uvs, len(position), num, rng)
            to_light, factor = self._surface_factor(position, *light_samples[:3])
            return to_light, factor if self.image is None else factor * _sample_texels(self.image, light_samples[3])
        assert isinstance(light, PointLook | SpotLook)
        to_light = (np.array(light.position) - position)[:, None]
        distance_squared = (to_light**2).sum(axis=2)
        direction = -to_light / np.sqrt(distance_squared)[..., None]
        intensity = directional_intensity(light, direction) / distance_squared[..., None]
        if not isinstance(light, SpotLook):
            return to_light, intensity
        inner, outer = np.cos(np.radians(light.cone))
        falloff = np.clip((direction @ _unit(light.direction) - outer) / max(1e-3, inner - outer), 0, 1)
        return to_light, falloff[..., None] ** 2 * intensity

    def _surface_factor(self, position: F64, light_position: F64, normal: F64, area: float) -> tuple[F64, F64]:
        to_light = light_position - position[:, None]
        distance_squared = np.maximum((to_light**2).sum(axis=2), 1e-20)
        cosine = -(to_light * normal).sum(axis=2) / np.sqrt(distance_squared)
        facing = np.abs(cosine) if self.is_two_sided else np.maximum(cosine, 0)
        return to_light, (area * facing / distance_squared / light_position.shape[1])[..., None]


def emitters(scene: Scene, geometry: SceneBuffers, look: Look) -> list[ReferenceEmitter]:
    """Collect the local lights of a look that emit light. geometry: triangles of the scene"""
    local_lights = []
    for light in single_lights(scene, look).values():
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
            casters, lit = shadow_casters(scene, geometry, light.shadow_link), lit_meshes(scene, light.link)
            local_lights.append(ReferenceEmitter(light, triangles, is_two_sided, uvs, image, casters, lit))
    return local_lights


def hit_distance(
    geometry: SceneBuffers,
    start: Shaped[F32, "n 3"],
    direction: Shaped[F32, "n 3"],
    alpha_sample: Shaped[F32, " #n"] = FIXED_ALPHA_SAMPLE,
) -> Shaped[F32, " n"]:
    """Distances to the first hits of rays, meters; infinite if nothing is hit.

    Args:
        geometry: the triangles. start: origins, meters. direction: unit vectors.
        alpha_sample: alpha sample for blended surfaces; see `relume.raytrace.surface_points.SurfacePoints`.
    """
    batches = (slice(k, k + _RAYS_PER_BATCH) for k in range(0, len(direction), _RAYS_PER_BATCH))
    return np.concatenate([
        trace_rays(
            geometry.embree, start[rows], direction[rows],
            alpha_sample if len(alpha_sample) == 1 else alpha_sample[rows]
        ).distance
        for rows in batches
    ])  # fmt: skip


def emitted_radiance(local_lights: Sequence[ReferenceEmitter], material: str) -> Shaped[F64, " 3"]:
    """Radiance emitted by the surfaces of a material."""
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
    """Stratified points on a rectangle (n, m, 3); normals; the area."""
    facing, rotation = _unit(light.direction), np.radians(light.rotation)
    reference = (0.0, 1.0, 0.0) if np.hypot(facing[0], facing[2]) > 1e-3 else (0.0, 0.0, 1.0)
    across = _unit(np.cross(reference, facing))
    up = np.cross(facing, across)
    width = np.cos(rotation) * across + np.sin(rotation) * up
    height = np.cos(rotation) * up - np.sin(rotation) * across
    u, v = strata(num_points, num, rng)
    offset = light.size[0] * (u - 0.5) * width + light.size[1] * (v - 0.5) * height
    return np.array(light.position) + offset, facing, light.size[0] * light.size[1]


def _sample_texels(image: Texture, uv: F64) -> F64:
    """Bilinear lookup of an image at texture coordinates (n, m, 2), without further filtering. (n, m, 3)"""
    flat = uv.reshape(-1, 2).astype(np.float32)
    texels = MipMap.for_texture(image).sample(flat, np.zeros(len(flat), np.float32))
    return np.asarray(texels.reshape(*uv.shape[:2], 3), np.float64)


def _sample_triangles(
    triangles: F64, uvs: F64, num_points: int, num: int, rng: np.random.Generator
) -> tuple[F64, F64, float, F64]:
    """Random points (n, m, 3), uniform by area; their normals (n, m, 3); the area; their UV coordinates (n, m, 2)."""
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
