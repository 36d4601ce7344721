"""What cameras are placed by: the scene in plain colours, from anywhere, before anything is baked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.albedo import is_diffuse, reflectances_of, shares_in
from relume.brdf.channels import TEXTURES, images_of
from relume.color import srgb_encode
from relume.images.shelf import texture_of
from relume.look import default_look
from relume.scene.coding import mean_of
from relume.scene.gltf.cameras import framing_camera
from relume.scene.model import Camera, Material, Scene, Texture
from relume.trace.geometry import Geometry, merge
from relume.trace.primary import Hits, camera_directions, trace_from

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_AMBIENT, _HEADLIGHT, _SKY = 0.25, 0.45, 0.4  # shares of what a surface shows at most
_DARKEST = 0.04  # linear; black surfaces would show no shape
_BACKGROUND = 0.03


@dataclass(frozen=True)
class Finder:
    """A scene as cameras are placed in it.

    Attributes:
        colors: of the materials, linear. (materials, 3) float32
        framing: a camera that sees all of it. lowest, highest: its corners, metres. (3,)
    """

    geometry: Geometry
    colors: F32
    framing: Camera
    lowest: F64
    highest: F64

    @classmethod
    def of(cls, scene: Scene) -> Finder:
        """Build the search tree, and find out what is where."""
        geometry = merge(scene)
        terms = default_look(scene.materials, scene.lights)["materials"]
        colors = [_color(material, terms[material.name]["terms"]) for material in scene.materials]
        corners = geometry.positions[geometry.faces.ravel()]
        return cls(
            geometry,
            np.array(colors, np.float32),
            framing_camera(scene.meshes, "framing"),
            corners.min(axis=0).astype(np.float64),
            corners.max(axis=0).astype(np.float64),
        )

    def image(self, camera: Camera, size: tuple[int, int]) -> NDArray[np.uint8]:
        """Draw what a camera sees, lit from the eye and from above.

        Args:
            camera: any. size: width and height in pixels.
        Returns:
            Display values. (height, width, 3) uint8
        """
        width, height = size
        y, x = np.divmod(np.arange(width * height, dtype=np.int64), width)
        directions = camera_directions(camera, size, (x + 0.5).astype(np.float32), (y + 0.5).astype(np.float32))
        hits = self._hits(camera, directions)
        seen = np.flatnonzero(hits.face >= 0)
        shown = np.full((width * height, 3), _BACKGROUND, np.float32)
        shown[seen] = self._shown(hits.face[seen], hits.uv[seen], directions[seen])
        return np.asarray(np.rint(255 * srgb_encode(shown)), np.uint8).reshape(height, width, 3)

    def _shown(self, face: NDArray[np.int32], uv: F32, directions: F32) -> F32:
        """Shade hits by their normals alone; `surface_at` finds more, and takes several times as long. (n, 3)"""
        corners, (u, v) = self.geometry.normals[self.geometry.faces[face]], uv.T[:, :, None]
        normal = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        facing = -np.einsum("nc,nc->n", normal, directions)
        upward = normal[:, 1] * np.sign(facing)  # of the side that is seen
        share = _AMBIENT + _HEADLIGHT * np.abs(facing) + _SKY * (0.5 + 0.5 * upward)
        return np.asarray(self.colors[self.geometry.face_material[face]] * share[:, None], np.float32)

    def place_at(self, camera: Camera, size: tuple[int, int], x: float, y: float) -> F64 | None:
        """Find the place that a position of the picture shows; None where that is the background.

        Args:
            camera: any. size: width and height in pixels. x, y: pixels from the left and from the top.
        Returns:
            World space, metres. (3,)
        """
        directions = camera_directions(camera, size, np.array([x], np.float32), np.array([y], np.float32))
        hits = self._hits(camera, directions)
        if hits.face[0] < 0:
            return None
        return np.asarray(camera.to_world[:3, 3] + float(hits.distance[0]) * directions[0].astype(np.float64))

    def _hits(self, camera: Camera, directions: F32) -> Hits:
        return trace_from(self.geometry.embree, camera.to_world[:3, 3].astype(np.float32), directions)


def _color(material: Material, terms: Sequence[Mapping[str, Any]]) -> F64:
    """About what a material looks like: its diffuse colour, else that of its highlights. (3,)"""
    plain, *textured = shares_in(reflectances_of(list(filter(is_diffuse, terms))))[..., 0].astype(np.float64)
    own = [material.textures.get(channel) for channel in TEXTURES]
    shown = [own[k] if name is None else texture_of(name) for k, name in enumerate(images_of(terms))]
    color = plain + sum(part * _mean(texture) for texture, part in zip(shown, textured, strict=True))
    if color.max() < _DARKEST:
        color = np.max([np.asarray(term["color"], np.float64) for term in terms], axis=0)
    return np.asarray(np.clip(color, _DARKEST, 1.0))


def _mean(texture: Texture | None) -> F64:
    return np.ones(3) if texture is None else mean_of(texture)
