"""Camera placement viewport: the scene in plain colors, from any camera, before anything is baked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.albedo import material_reflectance, scatters_diffusely
from relume.brdf.texture_slots import TEXTURES, user_images
from relume.core.color import srgb_encode
from relume.images.image_store import load_texture
from relume.look import default_look
from relume.math.bounding_box import bounding_box
from relume.output.clay import clay_image
from relume.raytrace.camera_rays import Hits, camera_directions, near_distances, trace_rays
from relume.raytrace.interior import first_obstacle, interior_camera, sees_only_outside
from relume.raytrace.scene_buffers import SceneBuffers, build_scene_buffers
from relume.scene.model import Camera, Material, Scene, Texture
from relume.scene.texture_encoding import mean_value
from relume.scene_io.gltf.cameras import framing_camera

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_AMBIENT, _HEADLIGHT, _SKYLIGHT = 0.25, 0.45, 0.4  # maximum shading by each light
_MIN_COLOR = 0.04  # linear; black surfaces would show no shape
_BACKGROUND = 0.03


@dataclass(frozen=True)
class Viewport:
    """A scene for camera placement.

    Attributes:
        colors: colors of the materials, linear. material_names: of the scene.
        default_camera: a camera that frames the scene.
        first_camera: the scene's own; None without one.
    """

    geometry: SceneBuffers
    colors: Shaped[F32, "materials 3"]
    material_names: Sequence[str]
    default_camera: Camera
    first_camera: Camera | None

    @classmethod
    def from_scene(cls, scene: Scene) -> Viewport:
        """Build the acceleration structure, and compute colors."""
        geometry = build_scene_buffers(scene)
        terms = default_look(scene.materials, scene.lights)["materials"]
        colors = [_color(material, terms[material.name]["terms"]) for material in scene.materials]
        return cls(
            geometry,
            np.array(colors, np.float32),
            [material.name for material in scene.materials],
            framing_camera(scene.meshes, "framing"),
            next(iter(scene.cameras), None),
        )

    @cached_property
    def _bounds(self) -> Sequence[Shaped[F64, " 3"]]:
        return [
            corner.astype(np.float64) for corner in bounding_box(self.geometry.positions[self.geometry.faces.ravel()])
        ]

    @property
    def bounds_min(self) -> Shaped[F64, " 3"]:
        """Lowest coordinates of its triangles, meters."""
        return self._bounds[0]

    @property
    def bounds_max(self) -> Shaped[F64, " 3"]:
        """Highest coordinates of its triangles, meters."""
        return self._bounds[1]

    @cached_property
    def interior_camera(self) -> Camera | None:
        """A camera in the largest room; None if no place is enclosed."""
        return interior_camera(self.geometry.embree, self.geometry.face_normals, self._bounds, "inside")

    @cached_property
    def opens_inside(self) -> bool:
        """True for a closed room whose first camera is outside."""
        rays = self.geometry.embree, self.geometry.face_normals
        return sees_only_outside(*rays, self.first_camera, self.interior_camera)

    def clay(self, camera: Camera, size: tuple[int, int]) -> Shaped[NDArray[np.uint8], "height width"]:
        """Render the clay picture of a camera; see `clay_image`."""
        return clay_image(self.geometry, camera, size)

    def image(self, camera: Camera, size: tuple[int, int]) -> Shaped[NDArray[np.uint8], "height width 3"]:
        """Render display values for a camera, with light from the camera and from above.

        Args:
            camera: any. size: width and height in pixels.
        """
        width, height = size
        y, x = np.divmod(np.arange(width * height, dtype=np.int64), width)
        directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
        hits = self._trace(camera, directions)
        visible = np.flatnonzero(hits.face >= 0)
        colors = np.full((width * height, 3), _BACKGROUND, np.float32)
        colors[visible] = self._shade(hits.face[visible], hits.uv[visible], directions[visible])
        return np.asarray(np.rint(255 * srgb_encode(colors)), np.uint8).reshape(height, width, 3)

    def _shade(self, face: NDArray[np.int32], uv: F32, directions: F32) -> F32:
        """Shade hits by their normals alone. (n, 3)"""
        normal = self.geometry.smooth_normals(face, uv)
        cosine = -np.einsum("nc,nc->n", normal, directions)
        upward = normal[:, 1] * np.sign(cosine)  # of the visible side
        shading = _AMBIENT + _HEADLIGHT * np.abs(cosine) + _SKYLIGHT * (0.5 + 0.5 * upward)
        return np.asarray(self.colors[self.geometry.face_material[face]] * shading[:, None], np.float32)

    def point_at(self, camera: Camera, size: tuple[int, int], x: float, y: float) -> Shaped[F64, " 3"] | None:
        """Find the surface point at an image position, in world space, meters; None for the background.

        Args:
            camera: any. size: width and height in pixels. x, y: pixels from the left and from the top.
        """
        directions = camera_directions(camera, size, np.array([x], np.float32), np.array([y], np.float32))
        hits = self._trace(camera, directions)
        if hits.face[0] < 0:
            return None
        return np.asarray(camera.to_world[:3, 3] + float(hits.distance[0]) * directions[0].astype(np.float64))

    def first_obstacle(
        self, path: Sequence[Sequence[float]]
    ) -> tuple[float | None, str | None, tuple[float, float, float] | None]:
        """Return the length of a path to its first surface, meters, its material and unit normal; None if it is free.

        Args:
            path: corners of a polyline, meters.
        """
        obstacle = first_obstacle(self.geometry.embree, self.geometry.origins, np.array(path, np.float64))
        if obstacle is None:
            return None, None, None
        x, y, z = self.geometry.face_normals[obstacle.face].tolist()
        return obstacle.length, self.material_names[int(self.geometry.face_material[obstacle.face])], (x, y, z)

    def _trace(self, camera: Camera, directions: F32) -> Hits:
        position, start = camera.to_world[:3, 3].astype(np.float32), near_distances(camera, directions)
        return trace_rays(self.geometry.embree, position, directions, start=start)


def _color(material: Material, terms: Sequence[Mapping[str, Any]]) -> F64:
    """Approximate color of a material: its diffuse color, else that of its highlights. (3,)"""
    diffuse = material_reflectance(list(filter(scatters_diffusely, terms)))
    constant, *textured_reflectances = diffuse.matrix[..., 0].astype(np.float64)
    scene_textures = [material.textures.get(channel) for channel in TEXTURES]
    textures = [scene_textures[k] if name is None else load_texture(name) for k, name in enumerate(user_images(terms))]
    color = constant + sum(
        reflectance * _mean(texture) for texture, reflectance in zip(textures, textured_reflectances, strict=True)
    )
    if color.max() < _MIN_COLOR:
        color = np.max([np.asarray(term["color"], np.float64) for term in terms], axis=0)
    return np.asarray(np.clip(color, _MIN_COLOR, 1.0))


def _mean(texture: Texture | None) -> F64:
    return np.ones(3) if texture is None else mean_value(texture)
