"""The lights that a scene file brings, under names of their own, as many and as bright as a look may have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.core.errors import SceneError
from relume.core.import_warnings import ImporterWarning, approximated, ignored
from relume.scene.emission import normalize_emission
from relume.scene.model import Light, Material, Mesh
from relume.scene.unique_names import unique_name
from relume.scene.validate import MAX_EMISSION, MAX_LIGHTS

F64 = NDArray[np.float64]


class LightCollector:
    """Collects the lights of one file, whatever its format."""

    def __init__(self, warnings: list[ImporterWarning]) -> None:
        self._warnings = warnings
        self._names: dict[str, int] = {}
        self.lights: list[Light] = []

    def name(self, preferred: str) -> str:
        """A name that no other light of the file has."""
        return unique_name(preferred, self._names)

    def add(self, name: str, fields: Mapping[str, Any], emission: F64) -> None:
        """A light of the file, its emission held to what a look may have.

        Args:
            name: from `name`, so that no other light has it.
            fields: `kind` and what else is not that kind's default, without the emission.
            emission: linear RGB in the unit of its kind. (3,)
        Raises:
            SceneError: there are more than a look may have.
        """
        if len(self.lights) == MAX_LIGHTS:
            raise SceneError(
                f"the scene has more than {MAX_LIGHTS} lights, materials that shine included; remove those that "
                "matter least, or light it by an environment"
            )
        if emission.max() > MAX_EMISSION:
            self._warnings.append(approximated(f"light {name!r} is brighter than {MAX_EMISSION:g}; it is held to that"))
        self.lights.append(Light(name, {**fields, "emission": np.clip(emission, 0, MAX_EMISSION).tolist()}))

    def emissive_light(
        self, materials: Sequence[Material], emissions: Sequence[F64], meshes: Sequence[Mesh]
    ) -> tuple[Material, ...]:
        """A light for each material with an emission, which is radiance as it stands: files mean by 1 what a white
        surface under an environment of 1 has, not a candela per square metre.

        Args:
            materials: those of the scene.
            emissions: of each material, which its image multiplies. (3,)
            meshes: those of the scene; a material without any is no light.
        Returns:
            The materials; images of what they shine are over its mean from now on.
        Raises:
            SceneError: there are more lights than a look may have.
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
                reason = "its image is black on all of them" if emitting_meshes else "no surface is left of it"
                self._warnings.append(ignored(f"material {material.name!r} shines, but {reason}"))
        return tuple(lit_materials)
