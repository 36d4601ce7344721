"""The lights of a scene file: unique names, and the limits of a look on number and brightness."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote
from relume.scene.emission import normalize_emission
from relume.scene.light_prefix import name_prefix
from relume.scene.merge_lights import merge_lights, surface_area
from relume.scene.model import Light, Material, Mesh
from relume.scene.unique_names import unique_name
from relume.scene.validate import ENVIRONMENT, MAX_EMISSION, MAX_LIGHTS

F64 = NDArray[np.float64]


class LightCollector:
    """Collects the lights of one file of any format."""

    def __init__(self, warnings: list[ImporterWarning]) -> None:
        self._warnings = warnings
        self._names = {ENVIRONMENT: 1}
        self._instance_groups: dict[int, str] = {}
        self.lights: list[Light] = []

    def name(self, preferred: str) -> str:
        """Return a name that no other light of the file has."""
        return unique_name(preferred, self._names)

    def add(
        self, name: str, fields: Mapping[str, Any], emission: Shaped[F64, " 3"], *, instance: int | None = None
    ) -> None:
        """Add a light; its emission is clamped to the limit of a look.

        Args:
            name: from `name`, so that it is unique.
            fields: `kind` and all fields that differ from its defaults, without the emission.
            emission: linear RGB in the unit of the kind.
            instance: number of the light of the file, which several nodes may share; they are proposed as one group.
        """
        if emission.max() > MAX_EMISSION:
            self._warnings.append(
                approximated(f"Light {quote(name)} was clamped to the maximum emission {MAX_EMISSION:g}.")
            )
        fields = {**fields, "emission": np.clip(emission, 0, MAX_EMISSION).tolist()}
        group = name_prefix(name)
        self.lights.append(
            Light(name, fields, group if instance is None else self._instance_groups.setdefault(instance, group))
        )

    def emissive_light(
        self, materials: Sequence[Material], emissions: Sequence[Shaped[F64, " 3"]], meshes: Sequence[Mesh]
    ) -> tuple[Material, ...]:
        """Add a light for each material with an emission; the brightest lights remain if a look cannot have all.

        Emission is used as radiance without conversion: in practice, files expect 1 to look like a white surface under
        an environment of 1, not like one candela per square meter.

        Args:
            materials: all materials of the scene.
            emissions: emitted radiance of each material, multiplied by its image.
            meshes: all meshes of the scene; a material without a mesh is no light.
        Returns:
            The materials, with emission images divided by their mean.
        """
        lit_materials = []
        for number, (original, factor) in enumerate(zip(materials, emissions, strict=True)):
            emitting_meshes = [mesh for mesh in meshes if mesh.material == number]
            has_image = "emission" in original.textures
            material, emission = (
                normalize_emission(original, factor, emitting_meshes) if has_image else (original, factor)
            )
            lit_materials.append(material)
            if factor.max() <= 0:
                continue
            if emitting_meshes and emission.max() > 0:
                self.add(self.name(material.name), {"kind": "mesh", "material": material.name}, emission)
            else:
                reason = "its emission texture is black there" if emitting_meshes else "no surface uses it"
                self._warnings.append(ignored(f"Emissive material {quote(material.name)} emits no light: {reason}."))
        self._merge(materials, meshes)
        return tuple(lit_materials)

    def _merge(self, materials: Sequence[Material], meshes: Sequence[Mesh]) -> None:
        """Group lights of one prefix or instance, and merge those beyond the limit of a look."""
        num_lights = Counter(light.group for light in self.lights)
        lights = [light if num_lights[light.group] > 1 else replace(light, group="") for light in self.lights]
        if len(lights) > MAX_LIGHTS:
            lights = merge_lights(lights, light_powers(lights, materials, meshes), self.name, self._warnings)
        self.lights = lights


def light_powers(lights: Sequence[Light], materials: Sequence[Material], meshes: Sequence[Mesh]) -> list[float]:
    """Power of each light, W, averaged over red, green and blue.

    A point light of intensity I has 4π I, a spot 2π (1 − cos θ) I within its cone, a surface of radiance L π L A. For a
    directional light of irradiance E it is the power through the scene's bounding sphere, π d² / 4 E.

    Args:
        lights: of any kind. materials, meshes: of the scene; a mesh has the index of its material.
    """
    corners = np.concatenate([[mesh.positions.min(axis=0), mesh.positions.max(axis=0)] for mesh in meshes])
    diagonal = float(np.linalg.norm(np.ptp(corners.astype(np.float64), axis=0)))
    areas: dict[str, float] = {}
    for mesh in meshes:
        name = materials[mesh.material].name
        areas[name] = areas.get(name, 0.0) + mesh_area(mesh)

    def extent(fields: Mapping[str, Any]) -> float:
        if fields["kind"] == "mesh":
            return np.pi * areas.get(fields["material"], 0.0)
        if fields["kind"] == "directional":
            return np.pi * diagonal**2 / 4
        if area := surface_area(fields):
            return np.pi * area
        half_angle = np.radians(fields["cone"][1]) if fields["kind"] == "spot" else np.pi
        return float(2 * np.pi * (1 - np.cos(half_angle)))

    return [extent(light.fields) * float(np.mean(light.fields["emission"])) for light in lights]


def mesh_area(mesh: Mesh) -> float:
    """Area of all triangles of a mesh, m²."""
    a, b, c = (mesh.positions[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
