"""AOVs: values of the surfaces that camera rays meet, beside the image's radiance.

Rays stop at the first surface: glass is one, holes are not, and a blended surface is one as often as its opacity says.
Values that must not be mixed (depth, position, texture coordinates) are those of the ray nearest to the pixel's center;
normals, albedo and emission are means over the pixel, in which the background is zero.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import directional_albedo
from relume.brdf.texture_slots import TEXTURES, texture_slot
from relume.look import Look
from relume.output.exr.cryptomatte import (
    BACKGROUND,
    cryptomatte_attributes,
    cryptomatte_channels,
    id_of,
    ranked_coverage,
)
from relume.raytrace.camera_rays import Hits, camera_directions, near_distances, trace_rays
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.raytrace.surface_interaction import SurfaceInteraction, surface_at
from relume.reference.emitters import emitted_radiance, emitters
from relume.reference.textures import surface_textures, with_overrides
from relume.scene.model import Camera, Scene

F32 = NDArray[np.float32]
U32 = NDArray[np.uint32]

SAMPLES = 16  # rays of a pixel
_MAX_RAYS = 1 << 19  # traced at once: bounds the memory


@dataclass(frozen=True)
class AovTracer:
    """Traces the AOVs of one look.

    Attributes:
        scene: with the look's maps. geometry: its triangles.
        albedos: directional albedo of each material, for each texture slot: θo, and values. See `directional_albedo`.
        emission: radiance of each material's surfaces.
    """

    scene: Scene
    geometry: SceneBuffers
    look: Look
    albedos: tuple[tuple[tuple[Shaped[NDArray[np.float64], " n"], Shaped[NDArray[np.float64], "n 3"]], ...], ...]
    emission: Shaped[NDArray[np.float64], "materials 3"]

    @classmethod
    def from_look(cls, scene: Scene, look: Look) -> AovTracer:
        """Prepare a scene. Raises NotFoundError and SceneError for missing images of the look."""
        scene = with_overrides(scene, look)
        geometry = build_scene_buffers(scene)
        lights = emitters(scene, geometry, look)
        names = [material.name for material in scene.materials]
        return cls(
            scene,
            geometry,
            look,
            tuple(_albedos(look.materials[name].terms) for name in names),
            np.array([emitted_radiance(lights, name) for name in names]).reshape(-1, 3),
        )

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of a file with these channels."""
        objects, materials = (cryptomatte_attributes(*names) for names in self._names().items())
        return {**objects, **materials, "relume:offset": json.dumps(self.scene.offset)}

    def bands(self, camera: Camera, size: tuple[int, int]) -> Iterator[tuple[slice, dict[str, F32]]]:
        """Trace an image from the top; yield rows and their channels by name, (rows, width).

        Args:
            camera: any. size: width and height, pixels.
        """
        ids = {layer: np.array([id_of(name) for name in names], np.uint32) for layer, names in self._names().items()}
        for rows in _bands(size):
            channels = self._band(camera, size, rows, ids)
            yield (
                slice(rows.start, rows.stop),
                {name: values.reshape(len(rows), size[0]) for name, values in channels.items()},
            )

    def _names(self) -> dict[str, list[str]]:
        """Names that have ids, by the layer of their Cryptomatte."""
        return {
            "CryptoObject": [mesh.name for mesh in self.scene.meshes],
            "CryptoMaterial": [material.name for material in self.scene.materials],
        }

    def _band(self, camera: Camera, size: tuple[int, int], rows: range, ids: Mapping[str, U32]) -> dict[str, F32]:
        """Channels of the pixels in some rows, by name. ids: of objects and of materials"""
        rays = _CameraRays.through(camera, size, rows)
        hits = rays.trace(self.geometry, camera)
        angle = 2 * np.tan(camera.yfov / 2) / size[1]
        surface = surface_at(self.geometry, hits, rays.directions, self.scene.materials, angle)
        is_hit = hits.face >= 0
        face = np.maximum(hits.face, 0)
        channels = _central(rays, hits, surface, camera) | self._means(rays, surface, hits)
        indices = self.geometry.face_mesh[face], self.geometry.face_material[face]
        for (layer, layer_ids), index in zip(ids.items(), indices, strict=True):
            sample_ids = np.where(is_hit, layer_ids[index], BACKGROUND)
            channels |= cryptomatte_channels(layer, *ranked_coverage(sample_ids.reshape(-1, SAMPLES)))
        return channels

    def _means(self, rays: _CameraRays, surface: SurfaceInteraction, hits: Hits) -> dict[str, F32]:
        """Means of normals, albedo and emission over each pixel; the background counts as zero."""
        is_hit, face = hits.face >= 0, np.maximum(hits.face, 0)
        material, normal = self.geometry.face_material[face], surface.points.normal
        albedo = self._albedo(surface, material, -np.einsum("nc,nc->n", normal, rays.directions))
        is_front = np.einsum("nc,nc->n", self.geometry.face_normals[face], rays.directions) < 0
        emits = is_front | np.array([m.double_sided for m in self.scene.materials])[material]
        emission = self.emission[material] * surface.emission * emits[:, None]
        normals, albedos, emissions = (
            (values * is_hit[:, None]).reshape(-1, SAMPLES, 3).mean(axis=1) for values in (normal, albedo, emission)
        )
        return _named("N", "XYZ", normals) | _named("albedo", "RGB", albedos) | _named("emission", "RGB", emissions)

    def _albedo(
        self, surface: SurfaceInteraction, material: Shaped[NDArray[np.int32], " n"], cosine: Shaped[F32, " n"]
    ) -> Shaped[F32, "n 3"]:
        """Directional albedo of all terms toward the camera."""
        textures = surface_textures(self.scene, self.look, surface, material)
        factors = np.ones_like(surface.diffuse), *(textures[name] for name in TEXTURES)
        theta, albedo = np.arccos(np.clip(cosine, 0, 1)), np.zeros_like(surface.diffuse)
        for index, slots in enumerate(self.albedos):
            rows = np.flatnonzero(material == index)
            for (theta_o, values), factor in zip(slots, factors, strict=True):
                for channel in range(3):
                    albedo[rows, channel] += factor[rows, channel] * np.interp(theta[rows], theta_o, values[:, channel])
        return albedo


class _CameraRays(NamedTuple):
    """The rays of some pixels, `SAMPLES` of each in sequence, with their alpha samples."""

    directions: Shaped[F32, "n 3"]
    alpha_sample: Shaped[F32, " n"]

    @staticmethod
    def through(camera: Camera, size: tuple[int, int], rows: range) -> _CameraRays:
        y, x = np.divmod(np.arange(rows.start * size[0], rows.stop * size[0], dtype=np.int64), size[0])
        offset_x, offset_y = POSITIONS.T
        directions = camera_directions(
            camera, size, (x[:, None] + offset_x).ravel().astype(np.float32),
            (y[:, None] + offset_y).ravel().astype(np.float32),
        )  # fmt: skip
        return _CameraRays(directions, np.tile(_ALPHA_SAMPLES, len(x)))

    def trace(self, geometry: SceneBuffers, camera: Camera) -> Hits:
        origin, near = camera.to_world[:3, 3].astype(np.float32), near_distances(camera, self.directions)
        return trace_rays(geometry.embree, origin, self.directions, self.alpha_sample, near)


def _central(rays: _CameraRays, hits: Hits, surface: SurfaceInteraction, camera: Camera) -> dict[str, F32]:
    """Depth, position and texture coordinates at the ray nearest to each pixel's center."""
    center = slice(_CENTRAL, None, SAMPLES)
    distance, direction = hits.distance[center], rays.directions[center]
    is_hit = np.isfinite(distance)
    along = direction @ -camera.to_world[:3, 2].astype(np.float32)
    length = np.where(is_hit, distance, 0).astype(np.float64)[:, None]
    position = (camera.to_world[:3, 3] + length * direction) * is_hit[:, None]
    u, v = surface.uv[center, :2].T
    z = np.where(is_hit, distance * along, np.inf).astype(np.float32)
    return {"Z": z} | _named("P", "XYZ", position) | {"UV.U": u * is_hit, "UV.V": (1 - v) * is_hit}


def _positions() -> Shaped[NDArray[np.float64], "samples 2"]:
    """A lattice in a pixel: no two positions share a row or a column."""
    k = np.arange(SAMPLES)
    return (np.stack([k, 7 * k % SAMPLES], axis=1) + 0.5) / SAMPLES


POSITIONS = _positions()
"""Positions of the rays in a pixel."""
_CENTRAL = int(np.argmin(((POSITIONS - 0.5) ** 2).sum(axis=1)))
_ALPHA_SAMPLES = ((11 * np.arange(SAMPLES) % SAMPLES + 0.5) / SAMPLES).astype(np.float32)


def _bands(size: tuple[int, int]) -> Iterator[range]:
    rows = max(1, _MAX_RAYS // (SAMPLES * size[0]))
    return (range(start, min(start + rows, size[1])) for start in range(0, size[1], rows))


def _albedos(terms: Any) -> tuple[Any, ...]:
    """Directional albedo of the terms of each texture slot."""
    return tuple(
        directional_albedo([term for term in terms if texture_slot(term) == slot]) for slot in range(1 + len(TEXTURES))
    )


def _named(layer: str, names: str, values: Shaped[NDArray[np.floating], "n 3"]) -> dict[str, F32]:
    return {f"{layer}.{name}": values[:, channel].astype(np.float32) for channel, name in enumerate(names)}
