"""Metallic-roughness as `lambert` + `ggx`, with textures as multipliers of the terms.

Base colour b, metallic m: lambert takes b·(1 − m), ggx takes f0 = mix(0.04, b, m). glTF 2.0 specification, appendix B.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import PIL.Image

from relume.errors import SceneError
from relume.scene.gltf.document import Material as GltfMaterial
from relume.scene.gltf.document import TextureInfo
from relume.scene.gltf.images import ImageReader, to_linear
from relume.scene.gltf.names import unique_name
from relume.scene.gltf.uvs import UvUse, uv_use
from relume.scene.model import F32, Material, Texture

DIELECTRIC_F0 = 0.04
MIN_ROUGHNESS = 0.03
MAX_TEXTURE_TEXELS = 150_000_000  # made for the materials of one scene, 12 bytes each


@dataclass(frozen=True)
class Understood:
    """A material and which texture coordinates its meshes must carry."""

    material: Material
    uv_use: UvUse


class MaterialReader:
    """Turns the materials of one file into relume's, counting the texels it makes."""

    def __init__(self, images: ImageReader, warnings: list[str]) -> None:
        self._images = images
        self._warnings = warnings
        self._names: dict[str, int] = {}
        self._texels_left = MAX_TEXTURE_TEXELS

    def read(self, material: GltfMaterial) -> Understood:
        """One material under a name of its own.

        Raises:
            SceneError: a texture cannot be used or there are too many texels.
        """
        name = unique_name(material.name or "material", self._names)
        what = f"material {name!r}"
        pbr = material.pbrMetallicRoughness
        self._warn_of_the_rest(material, what)
        infos = [pbr.baseColorTexture, pbr.metallicRoughnessTexture, material.normalTexture]
        use = uv_use([info for info in infos if info is not None], what, self._warnings)
        if pbr.baseColorTexture is None and pbr.metallicRoughnessTexture is None:
            base = np.array(pbr.baseColorFactor[:3])
            f0 = _mix(base, pbr.metallicFactor)
            terms = _terms(base * (1 - pbr.metallicFactor), pbr.roughnessFactor, f0, None, None)
            textures: dict[str, Texture] = {}
        else:
            terms, textures = self._textured(material, what)
        normal_map = self._normal_map(material.normalTexture, what)
        return Understood(Material(name, terms, textures, normal_map, material.doubleSided), use)

    def _textured(self, material: GltfMaterial, what: str) -> tuple[tuple[dict[str, Any], ...], dict[str, Texture]]:
        pbr = material.pbrMetallicRoughness
        factor = np.array(pbr.baseColorFactor[:3], np.float32)
        texel, wrap = self._base_texels(pbr.baseColorTexture, what)
        metallic, roughness, packed_wrap = self._packed_texels(material, texel, what)
        if pbr.baseColorTexture is None:
            wrap = packed_wrap
            texel = np.broadcast_to(texel, (*np.shape(metallic)[:2], 3)) if np.ndim(metallic) else texel
        diffuse = np.ascontiguousarray(texel * (1 - metallic), np.float32)
        textures = {"diffuse": self._made(diffuse, wrap, what)}
        if not np.any(metallic):
            return _terms(factor, roughness, np.full(3, DIELECTRIC_F0), "diffuse", None), textures
        f0 = DIELECTRIC_F0 + (factor * texel - DIELECTRIC_F0) * metallic
        mean_f0 = np.maximum(f0.mean(axis=(0, 1), dtype=np.float64), 1e-4)
        textures["specular"] = self._made((f0 / mean_f0).astype(np.float32), wrap, what)
        return _terms(factor, roughness, mean_f0, "diffuse", "specular"), textures

    def _base_texels(self, info: TextureInfo | None, what: str) -> tuple[F32, tuple[str, str]]:
        if info is None:
            return np.ones((1, 1, 3), np.float32), ("repeat", "repeat")
        pixels, wrap = self._images.texture(info.index, f"the base colour texture of {what}")
        self._spend(pixels.shape[0] * pixels.shape[1])
        return to_linear(pixels), wrap

    def _packed_texels(
        self, material: GltfMaterial, texel: F32, what: str
    ) -> tuple[F32 | float, float, tuple[str, str]]:
        """Metallic per texel (h, w, 1) in the size of the base texture, one roughness for all, and the wrap."""
        pbr = material.pbrMetallicRoughness
        info = pbr.metallicRoughnessTexture
        if info is None:
            return pbr.metallicFactor, pbr.roughnessFactor, ("repeat", "repeat")
        packed, wrap = self._images.texture(info.index, f"the metallic-roughness texture of {what}")
        roughness = float(packed[..., 1].mean()) / 255 * pbr.roughnessFactor
        if np.ptp(packed[..., 1]) > 2:
            self._warnings.append(f"the roughness texture of {what} is replaced by its mean, {roughness:.2f}")
        blue = PIL.Image.fromarray(np.ascontiguousarray(packed[..., 2]))
        if pbr.baseColorTexture is not None:
            blue = blue.resize((texel.shape[1], texel.shape[0]), PIL.Image.Resampling.BILINEAR)
        if not packed[..., 2].any() or pbr.metallicFactor == 0:
            return 0.0, roughness, wrap
        self._spend(blue.width * blue.height)
        metallic = np.asarray(blue, np.float32)[..., None] / np.float32(255) * np.float32(pbr.metallicFactor)
        return metallic, roughness, wrap

    def _normal_map(self, info: TextureInfo | None, what: str) -> Texture | None:
        if info is None:
            return None
        pixels, wrap = self._images.texture(info.index, f"the normal texture of {what}")
        self._spend(pixels.shape[0] * pixels.shape[1])
        normals = pixels.astype(np.float32) / np.float32(127.5) - np.float32(1)
        normals[..., :2] *= np.float32(np.clip(info.scale, -100, 100))
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        return self._made(np.where(length > 1e-3, normals / np.maximum(length, 1e-3), (0, 0, 1)), wrap, what)

    def _made(self, pixels: Any, wrap: tuple[str, str], what: str) -> Texture:
        self._spend(pixels.shape[0] * pixels.shape[1])
        return Texture(np.ascontiguousarray(pixels, np.float32), wrap)

    def _spend(self, num_texels: int) -> None:
        self._texels_left -= num_texels
        if self._texels_left < 0:
            raise SceneError(f"the scene needs more than {MAX_TEXTURE_TEXELS:,} texels; scale its textures down")

    def _warn_of_the_rest(self, material: GltfMaterial, what: str) -> None:
        if material.emissiveTexture is not None or any(material.emissiveFactor):
            self._warnings.append(f"{what} glows; its emission is not used")
        if material.alphaMode != "OPAQUE":
            self._warnings.append(f"{what} is see-through ({material.alphaMode[:20]!r}); it is opaque here")
        if material.occlusionTexture is not None:
            self._warnings.append(f"the occlusion texture of {what} is not used; relume traces occlusion")
        for extension in sorted(material.extensions):
            self._warnings.append(f"extension {extension[:60]!r} of {what} is not used")


def _mix(base: Any, metallic: float) -> Any:
    return DIELECTRIC_F0 + (base - DIELECTRIC_F0) * metallic


def _terms(
    color: Any, roughness: float, f0: Any, diffuse: str | None, specular: str | None
) -> tuple[dict[str, Any], ...]:
    params = {
        "roughness": round(float(np.clip(roughness, MIN_ROUGHNESS, 1)), 6),
        "f0": [round(float(np.clip(value, 0, 1)), 6) for value in f0],
    }
    return (
        {"model": "lambert", "color": [round(float(value), 6) for value in color], "texture": diffuse},
        {"model": "ggx", "color": [1.0, 1.0, 1.0], "params": params, "texture": specular},
    )
