"""Shaders of USD materials: UsdPreviewSurface, and standard_surface, OpenPBR and gltf_pbr of MaterialX."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from relume.core.import_warnings import ImporterWarning, approximated, quote, unsupported
from relume.scene.validate import MAX_IOR
from relume.scene_io.usd.networks import NetworkReader, Numbers, Sample, Value
from relume.scene_io.usd.surface import Surface

PREVIEW = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
MATERIALX = "mtlx"


class ShaderReader:
    """Reads the surface shader of one material.

    Args:
        time: a UsdTimeCode. meters: unit of the stage. label: names the material in warnings.
        warnings: gets a sentence for each simplification.
    """

    def __init__(self, time: Any, meters: float, label: str, warnings: list[ImporterWarning]) -> None:
        self._time, self._meters, self._label, self._warnings = time, meters, label, warnings
        self._network = NetworkReader(time, label, warnings)

    def read(self, material: Any) -> Surface:
        """Read a UsdShade.Material; gray with a warning if its shader is not supported."""
        shaders = [shader for context in ("", MATERIALX) if (shader := self._surface_source(material, context))]
        identifiers = [str(shader.GetIdAttr().Get(self._time) or "") for shader in shaders]
        for shader, identifier in zip(shaders, identifiers, strict=True):
            if identifier in PREVIEW:
                return self._preview_surface(shader)
            if identifier.startswith("ND_standard_surface"):
                return self._standard_surface(shader)
            if identifier.startswith("ND_open_pbr_surface"):
                return self._open_pbr_surface(shader)
        reason = f"its shader {quote(identifiers[0])} isn't supported" if identifiers else "it has no surface shader"
        self._warnings.append(unsupported(f"{self._label[0].upper()}{self._label[1:]} is shown gray: {reason}."))
        return Surface()

    def _surface_source(self, material: Any, context: str) -> Any:
        source = material.ComputeSurfaceSource(context)
        shader = source[0] if isinstance(source, tuple) else source
        return shader if shader and shader.GetPrim().IsValid() else None

    def _number(self, shader: Any, name: str, default: float) -> float:
        return self._network.numbers(shader, name, (default,))[0]

    def _value(self, shader: Any, name: str, default: Numbers) -> Value:
        value = self._network.read(shader, name)
        return default if value is None else value

    def _preview_surface(self, shader: Any) -> Surface:
        """UsdPreviewSurface, version 2.6."""
        number, value = self._number, self._value
        opacity, threshold = value(shader, "opacity", (1.0,)), number(shader, "opacityThreshold", 0.0)
        is_metallic = number(shader, "useSpecularWorkflow", 0.0) == 0
        transparency = 0.0
        is_presence = self._network.text(shader, "opacityMode", "transparent") == "presence"
        metallic = value(shader, "metallic", (0.0,)) if is_metallic else (0.0,)
        if isinstance(opacity, tuple) and threshold == 0 and not is_presence and metallic == (0.0,):
            transparency, opacity = 1 - min(max(opacity[0], 0.0), 1.0), (1.0,)
        if self._network.read(shader, "displacement") not in (None, (0.0,)):
            self._warnings.append(unsupported(f"Displacement of {self._label} isn't supported; its surface is smooth."))
        return Surface(
            base_color=value(shader, "diffuseColor", (0.18, 0.18, 0.18)),
            metallic=metallic,
            roughness=value(shader, "roughness", (0.5,)),
            opacity=opacity,
            opacity_threshold=min(max(threshold, 0.0), 1.0),
            normal=self._network.read(shader, "normal"),
            occlusion=self._network.read(shader, "occlusion"),
            emission=value(shader, "emissiveColor", (0.0, 0.0, 0.0)),
            ior=self._ior(number(shader, "ior", 1.5)),
            specular_color=None if is_metallic else value(shader, "specularColor", (0.0, 0.0, 0.0)),
            coat=value(shader, "clearcoat", (0.0,)),
            coat_roughness=value(shader, "clearcoatRoughness", (0.01,)),
            transparency=transparency,
        )

    def _standard_surface(self, shader: Any) -> Surface:
        """Autodesk Standard Surface 1.0.1."""
        number, value, color = self._number, self._value, self._network.numbers
        self._warn_ignored(shader, {"subsurface": 0.0, "thin_film_thickness": 0.0, "transmission_scatter": 0.0})
        depth = number(shader, "transmission_depth", 0.0)
        transmission = number(shader, "transmission", 0.0)
        tint = color(shader, "transmission_color", (1.0, 1.0, 1.0))
        base = self._scaled(value(shader, "base_color", (0.8, 0.8, 0.8)), number(shader, "base", 1.0))
        coat = value(shader, "coat", (0.0,))
        base = self._below_coat(base, coat, value(shader, "coat_color", (1.0, 1.0, 1.0)))
        return Surface(
            base_color=self._transmitted(base, transmission, tint, depth),
            metallic=value(shader, "metalness", (0.0,)),
            roughness=value(shader, "specular_roughness", (0.2,)),
            opacity=_mean_opacity(value(shader, "opacity", (1.0,))),
            normal=self._network.read(shader, "normal"),
            emission=value(shader, "emission_color", (1.0, 1.0, 1.0)),
            emission_scale=number(shader, "emission", 0.0),
            ior=self._ior(number(shader, "specular_IOR", 1.5)),
            specular_weight=number(shader, "specular", 1.0),
            specular_tint=color(shader, "specular_color", (1.0, 1.0, 1.0)),
            coat=coat,
            coat_roughness=value(shader, "coat_roughness", (0.1,)),
            sheen_color=tuple(
                number(shader, "sheen", 0.0) * channel for channel in color(shader, "sheen_color", (1.0, 1.0, 1.0))
            ),
            sheen_roughness=number(shader, "sheen_roughness", 0.3),
            anisotropy=number(shader, "specular_anisotropy", 0.0),
            anisotropy_rotation=2 * np.pi * number(shader, "specular_rotation", 0.0),
            transmission=transmission,
            is_solid=number(shader, "thin_walled", 0.0) == 0,
            **_volume(tint, depth * self._meters),
        )

    def _open_pbr_surface(self, shader: Any) -> Surface:
        """OpenPBR Surface 1.1."""
        number, value, color = self._number, self._value, self._network.numbers
        self._warn_ignored(
            shader, {"subsurface_weight": 0.0, "thin_film_weight": 0.0, "transmission_dispersion_scale": 0.0}
        )
        depth = number(shader, "transmission_depth", 0.0)
        transmission = number(shader, "transmission_weight", 0.0)
        tint = color(shader, "transmission_color", (1.0, 1.0, 1.0))
        base = self._scaled(value(shader, "base_color", (0.8, 0.8, 0.8)), number(shader, "base_weight", 1.0))
        coat = value(shader, "coat_weight", (0.0,))
        base = self._below_coat(base, coat, value(shader, "coat_color", (1.0, 1.0, 1.0)))
        fuzz = number(shader, "fuzz_weight", 0.0)
        return Surface(
            base_color=self._transmitted(base, transmission, tint, depth),
            metallic=value(shader, "base_metalness", (0.0,)),
            roughness=value(shader, "specular_roughness", (0.3,)),
            opacity=_mean_opacity(value(shader, "geometry_opacity", (1.0,))),
            normal=self._network.read(shader, "geometry_normal"),
            emission=value(shader, "emission_color", (1.0, 1.0, 1.0)),
            emission_scale=number(shader, "emission_luminance", 0.0),
            ior=self._ior(number(shader, "specular_ior", 1.5)),
            specular_weight=number(shader, "specular_weight", 1.0),
            specular_tint=color(shader, "specular_color", (1.0, 1.0, 1.0)),
            coat=coat,
            coat_roughness=value(shader, "coat_roughness", (0.0,)),
            sheen_color=tuple(fuzz * channel for channel in color(shader, "fuzz_color", (1.0, 1.0, 1.0))),
            sheen_roughness=number(shader, "fuzz_roughness", 0.5),
            anisotropy=number(shader, "specular_roughness_anisotropy", 0.0),
            transmission=transmission,
            is_solid=number(shader, "geometry_thin_walled", 0.0) == 0,
            **_volume(tint, depth * self._meters),
        )

    def _ior(self, ior: float) -> float:
        if 0 < ior <= MAX_IOR:
            return ior
        self._warnings.append(
            unsupported(f"The index of refraction {ior:g} of {self._label} is out of range; 1.5 is used.")
        )
        return 1.5

    def _transmitted(self, base: Value, transmission: float, tint: Numbers, depth: float) -> Value:
        """The base color, in which glTF also has the tint of the transmitted light, unless it is that of a volume."""
        if transmission == 0:
            return base
        if 0 < transmission < 1:
            message = f"The scattered and the transmitted light of {self._label} have the same color here."
            self._warnings.append(approximated(message))
        return (1.0, 1.0, 1.0) if depth > 0 else tint

    def _scaled(self, value: Value, weight: float) -> Value:
        return self._multiplied(value, (weight,) * 3)

    def _multiplied(self, value: Value, color: Numbers) -> Value:
        """A color times another one."""
        if isinstance(value, Sample):
            scale, bias = (
                tuple(np.multiply(row, (*color, 1.0)[: len(row)]).tolist()) for row in (value.scale, value.bias)
            )
            return replace(value, scale=scale, bias=bias)
        return tuple(np.multiply(value, color).tolist()) if isinstance(value, tuple) else value

    def _below_coat(self, base: Value, coat: Value, tint: Value) -> Value:
        """The base color times that of the coat, as far as it covers the base."""
        if coat == (0.0,) or tint == (1.0, 1.0, 1.0):
            return base
        if isinstance(coat, tuple) and isinstance(tint, tuple) and len(tint) == 3:
            return self._multiplied(base, tuple(1 - coat[0] * (1 - channel) for channel in tint))
        if coat == (1.0,) and isinstance(tint, Sample) and isinstance(base, tuple):
            return self._multiplied(tint, base)
        self._warnings.append(unsupported(f"The color of the coat of {self._label} isn't supported; it is clear."))
        return base

    def _warn_ignored(self, shader: Any, inputs: dict[str, float]) -> None:
        """One warning for inputs that are not supported and differ from the value that turns them off."""
        names = [
            name for name, off in inputs.items() if self._network.read(shader, name) not in (None, (off,), (off,) * 3)
        ]
        if names:
            listed = ", ".join(name.replace("_", " ") for name in names)
            self._warnings.append(unsupported(f"{listed[0].upper()}{listed[1:]} of {self._label} isn't supported."))


def _mean_opacity(value: Value) -> Value:
    return (sum(value) / len(value),) if isinstance(value, tuple) else value


def _volume(tint: Numbers, depth: float) -> dict[str, Any]:
    """Absorption of a solid, whose color is seen after that depth."""
    return {"attenuation_color": tint, "attenuation_distance": depth} if depth > 0 else {}
