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
from relume.reference.radiance import ReferencePoints
from relume.scene.model import Material, Scene
from relume.scene.roughness_levels import (
    ONE_LEVEL,
    LevelGrid,
    level_range,
    levels_of_material,
    levels_of_texture,
    min_mean_normal_length,
)

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
        first: first class of each material. grids: roughness levels of each material's classes.
    """

    terms: list[Terms]
    mirrors: list[list[F64]]
    first: list[int]
    grids: list[LevelGrid]

    def classify(
        self, material: Shaped[NDArray[np.integer], " n"], points: ReferencePoints
    ) -> Shaped[NDArray[np.int64], " n"]:
        """Return the classes of points. material: indices into the scene's materials"""
        variance = np.broadcast_to(points.slope_variance, len(material))
        class_index: NDArray[np.int64] = np.array(self.first, np.int64)[material]
        for index, grid in enumerate(self.grids):
            if grid.pairs:
                rows = np.flatnonzero(material == index)
                class_index[rows] += grid.select(points.roughness[rows], variance[rows])
        return class_index


def _level_grid(material: Material, terms: Terms) -> LevelGrid:
    """Roughness levels of the map that terms of a material use."""
    if not any(map(uses_roughness_map, terms)):
        return ONE_LEVEL
    name = roughness_image(terms)
    if name is None:
        return levels_of_material(material)
    return levels_of_texture(
        load_roughness_map(name), mean_roughness(name) or None, min_mean_normal_length(material.normal_map)
    )


def roughness_classes(scene: Scene, look: Look) -> RoughnessClasses:
    """Make the roughness classes of a scene's surfaces under a look."""
    material_terms = [look.materials[material.name].terms for material in scene.materials]
    grids = [_level_grid(m, terms) for m, terms in zip(scene.materials, material_terms, strict=True)]
    num = min(_MAX_CLASSES_PER_MATERIAL, max(2, _MAX_CLASSES // max(1, sum(bool(grid.pairs) for grid in grids))))
    classes = RoughnessClasses([], [], [], [])
    for material, terms, coarse in zip(scene.materials, material_terms, grids, strict=True):
        has_both = len(coarse.ratios) > 1 and len(coarse.slope_variances) > 1
        grid = level_range(coarse, *((max(2, num // 6), min(6, max(2, num // 2))) if has_both else (num, num)))
        pairs = grid.pairs or ((1.0, 0.0),)
        classes.first.append(len(classes.terms))
        classes.grids.append(grid)
        classes.terms.extend([scaled_roughness(term, *pair) for term in terms] for pair in pairs)
        mirrors = [specular_albedo(term) * is_mirror(material.terms) for term in terms]
        classes.mirrors.extend(mirrors for _ in pairs)
    return classes
