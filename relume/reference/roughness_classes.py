"""Roughness classes of a look's materials: a material with a roughness map has many, each for a range of texels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.roughness_levels import scaled_roughness, uses_roughness_map
from relume.brdf.specular import is_mirror, specular_albedo
from relume.brdf.texture_slots import roughness_image
from relume.images.image_store import load_roughness_map, mean_roughness
from relume.look import Look
from relume.scene.model import Material, Scene
from relume.scene.roughness_levels import levels_of_material, levels_of_texture, min_mean_normal_length, select_level

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Terms = Sequence[Mapping[str, Any]]

# maximum numbers of classes, far finer than the roughness levels of bakes
_MAX_CLASSES_PER_MATERIAL, _MAX_CLASSES = 48, 96


@dataclass(frozen=True)
class RoughnessClasses:
    """Roughness classes of a scene's surfaces.

    Attributes:
        terms: terms of each class.
        mirrors: mirror fraction of each term of a class, per channel; zero unless the scene's own
            material is a mirror, because only those are traced in bakes.
        first: first class of each material. ratios: relative roughness of each material's classes, empty for one.
    """

    terms: list[Terms]
    mirrors: list[list[F64]]
    first: list[int]
    ratios: list[tuple[float, ...]]

    def classify(
        self, material: Shaped[NDArray[np.integer], " n"], roughness: Shaped[F32, " n"]
    ) -> Shaped[NDArray[np.int64], " n"]:
        """Return the classes of points.

        Args:
            material: index into the scene's materials. roughness: relative to the material's, see
                `relume.raytrace.surface_interaction.SurfaceInteraction`.
        """
        class_index: NDArray[np.int64] = np.array(self.first, np.int64)[material]
        for index, ratios in enumerate(self.ratios):
            if ratios:
                rows = np.flatnonzero(material == index)
                class_index[rows] += select_level(ratios, roughness[rows])
        return class_index


def _roughness_levels(material: Material, terms: Terms) -> tuple[float, ...]:
    """Roughness levels of the map that terms of a material use."""
    name = roughness_image(terms)
    if name is None:
        return levels_of_material(material)
    return levels_of_texture(
        load_roughness_map(name), mean_roughness(name) or None, min_mean_normal_length(material.normal_map)
    )


def roughness_classes(scene: Scene, look: Look) -> RoughnessClasses:
    """Make the roughness classes of a scene's surfaces under a look."""
    material_terms = [look.materials[material.name].terms for material in scene.materials]
    level_ranges = [
        _roughness_levels(m, terms) if any(map(uses_roughness_map, terms)) else ()
        for m, terms in zip(scene.materials, material_terms, strict=True)
    ]
    num = min(_MAX_CLASSES_PER_MATERIAL, max(2, _MAX_CLASSES // max(1, sum(map(bool, level_ranges)))))
    classes = RoughnessClasses([], [], [], [])
    for material, terms, material_levels in zip(scene.materials, material_terms, level_ranges, strict=True):
        ratios = (
            tuple(np.square(np.linspace(material_levels[0] ** 0.5, material_levels[-1] ** 0.5, num)).tolist())
            if material_levels
            else ()
        )
        classes.first.append(len(classes.terms))
        classes.ratios.append(ratios)
        classes.terms.extend([scaled_roughness(term, ratio) for term in terms] for ratio in ratios or (1.0,))
        mirrors = [specular_albedo(term) * is_mirror(material.terms) for term in terms]
        classes.mirrors.extend(mirrors for _ in ratios or (1.0,))
    return classes
