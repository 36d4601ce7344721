"""Materials of a glTF file for the peer's BSDF, factors times images. See `relume_bench.gltf_plain`.

Glass is the peer's own dielectric: thin if the file has no thickness, otherwise solid with an absorbing medium.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume_bench.gltf_plain import File, linear

F32 = NDArray[np.float32]
Description = dict[str, Any]

_FINER = 4  # texels of an alpha mask per texel of the image
_LEAST_SHEEN = 0.07**2
_CLEAR, _LEAST_FROST = 0.1, 0.03  # roughness up to which glass is smooth; the least of frosted texels
_LEAST_FROSTED_IOR = 1.01
_NEAREST = {"filter_type": "nearest"}


class Materials:
    """Describes the materials of one file.

    Attributes:
        arrays: images for the descriptions.
    """

    def __init__(self, file: File) -> None:
        self._file = file
        self.arrays: dict[str, F32] = {}

    def uv_set(self, number: int | None) -> int:
        """Set of texture coordinates that a material's textures use. Raises ValueError if they use several."""
        description = {} if number is None else self._file.json["materials"][number]
        sets = set(_uv_sets(description))
        if len(sets) > 1:
            raise ValueError("materials with several sets of texture coordinates are not in these files")
        return sets.pop() if sets else 0

    def bsdf(self, number: int | None, has: Mapping[str, Any]) -> Description:
        """A complete material with its emission.

        Args:
            number: index in the file; None for the default. has: attributes of its surface.
        """
        description = {} if number is None else self._file.json["materials"][number]
        pbr, name = description.get("pbrMetallicRoughness", {}), f"m{number}"
        whole = self._reflecting(description, pbr, name, has)
        if (transmission := _extension(description, "transmission")).get("transmissionFactor", 0.0):
            return self._transmitting(description, pbr, name, transmission, whole)
        if description.get("alphaMode", "OPAQUE") != "OPAQUE":
            whole = {"type": "mask", "opacity": self._opacity(description, pbr, name), "content": whole}
            if "COLOR_0" in has and (has["COLOR_0"][:, 3:] < 1).any():
                if description["alphaMode"] == "MASK":
                    raise ValueError("masks with transparent vertex colors are not in these files")
                alpha = {"type": "mesh_attribute", "name": "vertex_alpha"}
                whole = {"type": "mask", "opacity": alpha, "content": whole}
        return {**whole, "sides": True, **self._make_emitter(description, name)}

    def _reflecting(self, description: Description, pbr: Description, name: str, has: Mapping[str, Any]) -> Description:
        specular, coat, sheen = (_extension(description, kind) for kind in ("specular", "clearcoat", "sheen"))
        ior = _extension(description, "ior").get("ior", 1.5)
        bsdf: Description = {"type": "gltf", "f0": 1.0 if ior == 0 else ((ior - 1) / (ior + 1)) ** 2}
        factor = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
        self._add(bsdf, name, "base", pbr.get("baseColorTexture"), factor, slice(3), is_color=True)
        metallic_roughness = pbr.get("metallicRoughnessTexture")
        self._add(bsdf, name, "rough", metallic_roughness, pbr.get("roughnessFactor", 1.0), slice(1, 2))
        self._add(bsdf, name, "metal", metallic_roughness, pbr.get("metallicFactor", 1.0), slice(2, 3))
        self._add(
            bsdf, name, "weight", specular.get("specularTexture"), specular.get("specularFactor", 1.0), slice(3, 4)
        )
        tint = specular.get("specularColorFactor", [1, 1, 1])
        self._add(bsdf, name, "tint", specular.get("specularColorTexture"), tint, slice(3), is_color=True)
        if coat.get("clearcoatFactor", 0):
            self._add(bsdf, name, "coat", coat.get("clearcoatTexture"), coat["clearcoatFactor"], slice(1))
            coat_roughness = coat.get("clearcoatRoughnessFactor", 0.0)
            self._add(bsdf, name, "coat_rough", coat.get("clearcoatRoughnessTexture"), coat_roughness, slice(1, 2))
        if any(sheen.get("sheenColorFactor", [0])):
            self._add(
                bsdf, name, "sheen", sheen.get("sheenColorTexture"), sheen["sheenColorFactor"], slice(3), is_color=True
            )
            bsdf["sheen_alpha"] = max(sheen.get("sheenRoughnessFactor", 0.0) ** 2, _LEAST_SHEEN)
        self._bend(bsdf, description, name, has)
        return bsdf

    def _bend(self, bsdf: Description, description: Description, name: str, has: Mapping[str, Any]) -> None:
        """Add normals, the direction of anisotropy, and vertex colors."""
        stretched = _extension(description, "anisotropy")
        if (info := description.get("normalTexture")) is not None:
            normal_map = np.asarray(self._file.image(info["index"])[..., :3] / np.float32(127.5) - 1, np.float32)
            normal_map *= np.array([info.get("scale", 1.0)] * 2 + [1.0], np.float32)
            normal_map /= np.linalg.norm(normal_map, axis=2, keepdims=True)
            bsdf["normal"] = self._image(f"{name}_normal", np.asarray(normal_map * 0.5 + 0.5, np.float32), info)
            _set_uv_transform(bsdf, "normal", info)
        if stretched.get("anisotropyStrength", 0):
            bsdf["anisotropy"] = stretched["anisotropyStrength"]
            bsdf["turn"] = stretched.get("anisotropyRotation", 0.0)
        if "TANGENT" in has and ("normal" in bsdf or "anisotropy" in bsdf):
            bsdf["tangent"] = {"type": "mesh_attribute", "name": "vertex_tangent"}
            bsdf["hand"] = {"type": "mesh_attribute", "name": "vertex_hand"}
        if "COLOR_0" in has:
            bsdf["colors"] = {"type": "mesh_attribute", "name": "vertex_colors"}

    def _add(
        self, bsdf: Description, name: str, key: str, info: Description | None, factor: Any, channels: slice,
        *, is_color: bool = False,
    ) -> None:  # fmt: skip
        texels = np.ones((1, 1, len(np.atleast_1d(factor))), np.float32)
        if info is not None:
            image_values = np.asarray(self._file.image(info["index"])[..., channels] / np.float32(255), np.float32)
            texels = linear(image_values) if is_color else image_values
        texels = texels * np.atleast_1d(np.asarray(factor, np.float32))
        bsdf[key] = self._image(f"{name}_{key}", texels, info)
        _set_uv_transform(bsdf, key, info)

    def _image(self, name: str, texels: F32, info: Description | None, **more: Any) -> Description:
        self.arrays[name] = np.ascontiguousarray(texels, np.float32)
        return {"array": name, **({} if info is None else {"wrap_mode": self._file.wraps(info["index"])}), **more}

    def _opacity(self, description: Description, pbr: Description, name: str) -> Any:
        """Alpha, thresholded for masks, between texels as well."""
        info, more = pbr.get("baseColorTexture"), {} if description["alphaMode"] == "BLEND" else _NEAREST
        return self._image(f"{name}_alpha", self._alpha_texels(description, pbr), info, **more)

    def _alpha_texels(self, description: Description, pbr: Description) -> F32:
        info, alpha = pbr.get("baseColorTexture"), pbr.get("baseColorFactor", [1, 1, 1, 1])[3]
        texels = np.full((1, 1, 1), alpha, np.float32)
        if info is not None:
            texels = texels * self._file.image(info["index"])[..., 3:] / np.float32(255)
        if description["alphaMode"] == "BLEND":
            return texels
        fine = _finer(texels, _FINER) if info is not None else texels
        return np.asarray(fine >= description.get("alphaCutoff", 0.5), np.float32)

    def _make_emitter(self, description: Description, name: str) -> Description:
        factor = np.array(description.get("emissiveFactor", [0, 0, 0]), np.float32)
        factor = factor * np.float32(_extension(description, "emissive_strength").get("emissiveStrength", 1.0))
        if not factor.any():
            return {}
        info, texels = description.get("emissiveTexture"), np.ones((1, 1, 3), np.float32)
        if info is not None:
            texels = linear(np.asarray(self._file.image(info["index"])[..., :3] / np.float32(255), np.float32))
        if description.get("alphaMode", "OPAQUE") == "MASK":  # the peer's emitters shine through holes
            alpha = self._alpha_texels(description, description.get("pbrMetallicRoughness", {}))
            finer = _finer(texels, _FINER) if info is not None else texels
            if 1 not in (len(alpha), len(finer)) and alpha.shape[:2] != finer.shape[:2]:
                raise ValueError("masks of another size than the emission are not in these files")
            radiance = self._image(f"{name}_emission", finer * alpha * factor, info, **_NEAREST)
        else:
            radiance = self._image(f"{name}_emission", texels * factor, info)
        return {"emitter": {"type": "area", "radiance": radiance}} if texels.any() else {}

    def _transmitting(
        self, description: Description, pbr: Description, name: str, transmission: Description, opaque: Description
    ) -> Description:
        """Glass, or a blend of glass and the opaque material where less than all light is transmitted."""
        glass, inside = self._glass(description, pbr, name)
        share, info = transmission["transmissionFactor"], transmission.get("transmissionTexture")
        if share == 1 and info is None:
            return {**glass, **inside}
        texels = np.full((1, 1, 1), share, np.float32)
        if info is not None:
            texels = texels * self._file.image(info["index"])[..., :1] / np.float32(255)
        weight = self._image(f"{name}_transmission", texels, info)
        return {"type": "blendbsdf", "weight": weight, "opaque": opaque, "other": glass, "sides": True, **inside}

    def _glass(self, description: Description, pbr: Description, name: str) -> tuple[Description, Description]:
        """A dielectric, thin or solid; and the medium inside it, empty if it is clear."""
        volume, ior = _extension(description, "volume"), float(_extension(description, "ior").get("ior", 1.5))
        base: Description = {}
        factor = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
        self._add(base, name, "tint", pbr.get("baseColorTexture"), factor, slice(3), is_color=True)
        glass = {"specular_transmittance": base["tint"], "int_ior": ior}
        if not volume.get("thicknessFactor", 0):
            return {"type": "thindielectric", **glass}, {}
        glass |= self._frosting(pbr, name, ior)
        absorbed = -np.log(np.maximum(volume.get("attenuationColor", [1, 1, 1]), 1e-6))
        absorbed = absorbed / volume.get("attenuationDistance", np.inf)
        if not absorbed.any():  # free paths in an empty medium are NaN
            return glass, {}
        rate = {"type": "rgb", "value": (absorbed / absorbed.max()).tolist()}
        inside = {"type": "homogeneous", "albedo": 0.0, "scale": float(absorbed.max()), "sigma_t": rate}
        return glass, {"interior": inside}

    def _frosting(self, pbr: Description, name: str, ior: float) -> Description:
        """The kind of dielectric: smooth, or rough with the roughness of the file."""
        roughness: Description = {}
        info, factor = pbr.get("metallicRoughnessTexture"), pbr.get("roughnessFactor", 1.0)
        self._add(roughness, name, "rough", info, factor, slice(1, 2))
        alpha = np.maximum(self.arrays[f"{name}_rough"] ** 2, _LEAST_FROST**2)
        if alpha.max() <= _CLEAR**2:
            return {"type": "dielectric"}
        texture = self._image(f"{name}_frost", alpha, info)
        # its half vectors are undefined at an index of 1
        return {
            "type": "roughdielectric",
            "distribution": "ggx",
            "alpha": texture,
            "int_ior": max(ior, _LEAST_FROSTED_IOR),
        }


def _uv_sets(description: Any) -> Iterator[int]:
    """Sets of texture coordinates that the textures in a description refer to; occlusion is not rendered."""
    for key, value in description.items():
        if key == "occlusionTexture":
            continue
        if key.endswith("Texture") and isinstance(value, dict):
            transform = value.get("extensions", {}).get("KHR_texture_transform")
            overriding = transform if isinstance(transform, dict) else {}
            yield {**value, **overriding}.get("texCoord", 0)
        elif isinstance(value, dict):
            yield from _uv_sets(value)


def _extension(description: Description, kind: str) -> Description:
    extension = description.get("extensions", {}).get(f"KHR_materials_{kind}", {})
    return extension if isinstance(extension, dict) else {}


def _set_uv_transform(bsdf: Description, key: str, info: Description | None) -> None:
    """Set the UV transform of KHR_texture_transform: translation · rotation · scale, v down."""
    uv_transform = (info or {}).get("extensions", {}).get("KHR_texture_transform")
    if not isinstance(uv_transform, dict):
        return
    c, s = np.cos(uv_transform.get("rotation", 0.0)), np.sin(uv_transform.get("rotation", 0.0))
    (x, y), (u, v) = uv_transform.get("offset", [0, 0]), uv_transform.get("scale", [1, 1])
    rows = [[c * u, s * v, x], [-s * u, c * v, y]]
    bsdf |= {f"{key}_{row}{column}": float(rows[row][column]) for row in range(2) for column in range(3)}


def _finer(texels: F32, times: int) -> F32:
    """Interpolate bilinearly between texel centers, wrapping at the borders. (times · rows, times · columns, ...)"""
    for axis in (0, 1):
        size = texels.shape[axis]
        position = (np.arange(size * times) + 0.5) / times - 0.5
        low = np.floor(position).astype(int)
        fraction = (position - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        below, above = (np.take(texels, (low + k) % size, axis=axis) for k in (0, 1))
        texels = below * (1 - fraction) + above * fraction
    return texels
