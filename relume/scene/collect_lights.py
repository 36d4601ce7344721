"""The lights of a scene file: unique names, and the limits of a look on number and brightness."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored, quote
from relume.scene.emission import normalize_emission
from relume.scene.model import Light, Material, Mesh
from relume.scene.unique_names import unique_name
from relume.scene.validate import MAX_EMISSION, MAX_LIGHTS

F64 = NDArray[np.float64]


class LightCollector:
    """Collects the lights of one file of any format."""

    def __init__(self, warnings: list[ImporterWarning]) -> None:
        self._warnings = warnings
        self._names: dict[str, int] = {}
        self.lights: list[Light] = []

    def name(self, preferred: str) -> str:
        """Return a name that no other light of the file has."""
        return unique_name(preferred, self._names)

    def add(self, name: str, fields: Mapping[str, Any], emission: Shaped[F64, " 3"]) -> None:
        """Add a light; its emission is clamped to the limit of a look.

        Args:
            name: from `name`, so that it is unique.
            fields: `kind` and all fields that differ from its defaults, without the emission.
            emission: linear RGB in the unit of the kind.
        Raises:
            SceneError: there are more lights than a look can have.
        """
        if len(self.lights) == MAX_LIGHTS:
            raise SceneError(
                f"the scene has more than {MAX_LIGHTS} lights, with emissive materials; remove the least important ones"
            )
        if emission.max() > MAX_EMISSION:
            self._warnings.append(
                approximated(f"Light {quote(name)} was clamped to the maximum emission {MAX_EMISSION:g}.")
            )
        self.lights.append(Light(name, {**fields, "emission": np.clip(emission, 0, MAX_EMISSION).tolist()}))

    def emissive_light(
        self, materials: Sequence[Material], emissions: Sequence[Shaped[F64, " 3"]], meshes: Sequence[Mesh]
    ) -> tuple[Material, ...]:
        """Add a light for each material with an emission.

        Emission is used as radiance without conversion: in practice, files expect 1 to look like a white surface under
        an environment of 1, not like one candela per square meter.

        Args:
            materials: all materials of the scene.
            emissions: emitted radiance of each material, multiplied by its image.
            meshes: all meshes of the scene; a material without a mesh is no light.
        Returns:
            The materials, with emission images divided by their mean.
        Raises:
            SceneError: there are more lights than a look can have.
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
        return tuple(lit_materials)
