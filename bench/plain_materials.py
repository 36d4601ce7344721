"""Materials of a glTF file as the peer's BSDF has them, factors and images multiplied; beside `bench.gltf_plain`.

Glass is the peer's own dielectric: thin where the file names no thickness, else solid and filled with what absorbs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.gltf_plain import File

F32 = NDArray[np.float32]
Description = dict[str, Any]

_FINER = 4  # texels of a mask that is cut, for each of the image's
_LEAST_SHEEN = 0.07**2


class Materials:
    """Describes the materials of one file.

    Attributes:
        arrays: images that descriptions name.
    """

    def __init__(self, file: File) -> None:
        self._file = file
        self.arrays: dict[str, F32] = {}

    def bsdf(self, number: int | None, has: Mapping[str, Any]) -> Description:
        """A material, complete, with what it shines.

        Args:
            number: of it in the file; None for the default. has: attributes of the surface that wears it.
        """
        of = {} if number is None else self._file.json["materials"][number]
        pbr, name = of.get("pbrMetallicRoughness", {}), f"m{number}"
        reflecting = self._reflecting(of, pbr, name, has)
        passing = _extension(of, "transmission").get("transmissionFactor", 0.0)
        if passing:
            return self._glass(of, pbr, passing)
        whole: Description = {"type": "twosided", "front": reflecting}
        if of.get("alphaMode", "OPAQUE") != "OPAQUE":
            whole = {"type": "mask", "opacity": self._opacity(of, pbr, name), "content": whole}
        return {**whole, "sides": True, **self._shining(of, name)}

    def _reflecting(self, of: Description, pbr: Description, name: str, has: Mapping[str, Any]) -> Description:
        specular, coat, sheen = (_extension(of, kind) for kind in ("specular", "clearcoat", "sheen"))
        ior = _extension(of, "ior").get("ior", 1.5)
        found: Description = {"type": "gltf", "f0": 1.0 if ior == 0 else ((ior - 1) / (ior + 1)) ** 2}
        factor = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
        self._add(found, name, "base", pbr.get("baseColorTexture"), factor, slice(3), is_color=True)
        packed = pbr.get("metallicRoughnessTexture")
        self._add(found, name, "rough", packed, pbr.get("roughnessFactor", 1.0), slice(1, 2))
        self._add(found, name, "metal", packed, pbr.get("metallicFactor", 1.0), slice(2, 3))
        self._add(
            found, name, "weight", specular.get("specularTexture"), specular.get("specularFactor", 1.0), slice(3, 4)
        )
        tint = specular.get("specularColorFactor", [1, 1, 1])
        self._add(found, name, "tint", specular.get("specularColorTexture"), tint, slice(3), is_color=True)
        if coat.get("clearcoatFactor", 0):
            self._add(found, name, "coat", coat.get("clearcoatTexture"), coat["clearcoatFactor"], slice(1))
            rough = coat.get("clearcoatRoughnessFactor", 0.0)
            self._add(found, name, "coat_rough", coat.get("clearcoatRoughnessTexture"), rough, slice(1, 2))
        if any(sheen.get("sheenColorFactor", [0])):
            self._add(
                found, name, "sheen", sheen.get("sheenColorTexture"), sheen["sheenColorFactor"], slice(3), is_color=True
            )
            found["sheen_alpha"] = max(sheen.get("sheenRoughnessFactor", 0.0) ** 2, _LEAST_SHEEN)
        self._bend(found, of, name, has)
        return found

    def _bend(self, found: Description, of: Description, name: str, has: Mapping[str, Any]) -> None:
        """Normals, the direction of anisotropy, colours of vertices."""
        stretched = _extension(of, "anisotropy")
        if (info := of.get("normalTexture")) is not None:
            bumps = np.asarray(self._file.image(info["index"])[..., :3] / np.float32(127.5) - 1, np.float32)
            bumps *= np.array([info.get("scale", 1.0)] * 2 + [1.0], np.float32)
            bumps /= np.linalg.norm(bumps, axis=2, keepdims=True)
            found["normal"] = self._image(f"{name}_normal", np.asarray(bumps * 0.5 + 0.5, np.float32), info)
            _place(found, "normal", info)
        if stretched.get("anisotropyStrength", 0):
            found["anisotropy"] = stretched["anisotropyStrength"]
            found["turn"] = stretched.get("anisotropyRotation", 0.0)
        if "TANGENT" in has and ("normal" in found or "anisotropy" in found):
            found["tangent"] = {"type": "mesh_attribute", "name": "vertex_tangent"}
            found["hand"] = {"type": "mesh_attribute", "name": "vertex_hand"}
        if "COLOR_0" in has:
            found["colors"] = {"type": "mesh_attribute", "name": "vertex_colors"}

    def _add(
        self, found: Description, name: str, key: str, info: Description | None, factor: Any, channels: slice,
        *, is_color: bool = False,
    ) -> None:  # fmt: skip
        texels = np.ones((1, 1, len(np.atleast_1d(factor))), np.float32)
        if info is not None:
            shown = np.asarray(self._file.image(info["index"])[..., channels] / np.float32(255), np.float32)
            texels = _linear(shown) if is_color else shown
        texels = texels * np.atleast_1d(np.asarray(factor, np.float32))
        found[key] = self._image(f"{name}_{key}", texels, info)
        _place(found, key, info)

    def _image(self, name: str, texels: F32, info: Description | None, **more: Any) -> Description:
        self.arrays[name] = np.ascontiguousarray(texels, np.float32)
        return {"array": name, **({} if info is None else {"wrap_mode": self._file.wraps(info["index"])}), **more}

    def _opacity(self, of: Description, pbr: Description, name: str) -> Any:
        """Alpha, cut where it is a mask: between texels as well."""
        info, alpha = pbr.get("baseColorTexture"), pbr.get("baseColorFactor", [1, 1, 1, 1])[3]
        texels = np.full((1, 1, 1), alpha, np.float32)
        if info is not None:
            texels = texels * self._file.image(info["index"])[..., 3:] / np.float32(255)
        if of["alphaMode"] == "BLEND":
            return self._image(f"{name}_alpha", texels, info)
        fine = _finer(texels, _FINER) if info is not None else texels
        cut = (fine >= of.get("alphaCutoff", 0.5)).astype(np.float32)
        return self._image(f"{name}_alpha", cut, info, filter_type="nearest")

    def _shining(self, of: Description, name: str) -> Description:
        factor = np.array(of.get("emissiveFactor", [0, 0, 0]), np.float32)
        factor = factor * np.float32(_extension(of, "emissive_strength").get("emissiveStrength", 1.0))
        if not factor.any():
            return {}
        info, texels = of.get("emissiveTexture"), np.ones((1, 1, 3), np.float32)
        if info is not None:
            texels = _linear(np.asarray(self._file.image(info["index"])[..., :3] / np.float32(255), np.float32))
        if not texels.any():
            return {}
        return {"emitter": {"type": "area", "radiance": self._image(f"{name}_emission", texels * factor, info)}}

    def _glass(self, of: Description, pbr: Description, passing: float) -> Description:
        volume, ior = _extension(of, "volume"), _extension(of, "ior").get("ior", 1.5)
        tint = {"type": "rgb", "value": [passing * c for c in pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]]}
        if not volume.get("thicknessFactor", 0):
            return {"type": "thindielectric", "int_ior": ior, "specular_transmittance": tint}
        distance = volume.get("attenuationDistance", np.inf)
        absorbed = -np.log(np.maximum(volume.get("attenuationColor", [1, 1, 1]), 1e-6)) / distance
        most = float(max(*absorbed, 1e-9))
        rate = {"type": "rgb", "value": (absorbed / most).tolist()}
        inside = {"type": "homogeneous", "albedo": 0.0, "scale": most, "sigma_t": rate}
        rough = pbr.get("roughnessFactor", 1.0) if "metallicRoughnessTexture" not in pbr else 0.0
        kind: Description = {"type": "dielectric"}
        if rough > 0.1:
            kind = {"type": "roughdielectric", "distribution": "ggx", "alpha": rough**2}
        return {**kind, "int_ior": ior, "specular_transmittance": tint, "interior": inside}


def _extension(of: Description, kind: str) -> Description:
    found: Description = of.get("extensions", {}).get(f"KHR_materials_{kind}", {})
    return found


def _place(found: Description, key: str, info: Description | None) -> None:
    """Where a texture lies, by KHR_texture_transform: translation · rotation · scale, v down."""
    of = (info or {}).get("extensions", {}).get("KHR_texture_transform")
    if of is None:
        return
    c, s = np.cos(of.get("rotation", 0.0)), np.sin(of.get("rotation", 0.0))
    (x, y), (u, v) = of.get("offset", [0, 0]), of.get("scale", [1, 1])
    rows = [[c * u, s * v, x], [-s * u, c * v, y]]
    found |= {f"{key}_{row}{column}": float(rows[row][column]) for row in range(2) for column in range(3)}


def _linear(display: F32) -> F32:
    return np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _finer(texels: F32, times: int) -> F32:
    """Bilinear between the middles of texels, which go round at the borders. (times · rows, times · columns, ...)"""
    for axis in (0, 1):
        size = texels.shape[axis]
        place = (np.arange(size * times) + 0.5) / times - 0.5
        low = np.floor(place).astype(int)
        share = (place - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        below, above = (np.take(texels, (low + k) % size, axis=axis) for k in (0, 1))
        texels = below * (1 - share) + above * share
    return texels
