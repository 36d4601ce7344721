"""Materials of a look as surfaces reflect: one with a map of roughness is many, each as rough as some of its texels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import roughness_image
from relume.brdf.levels import at_ratio, follows_map
from relume.brdf.mirror import is_mirror, mirrored_share
from relume.images.shelf import mean_roughness, roughness_of
from relume.look import Look
from relume.scene.model import Material, Scene
from relume.scene.roughness import level_of, levels_between, levels_of, shortest_normal

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
Terms = Sequence[Mapping[str, Any]]

_EACH, _ALL = 48, 96  # kinds of a material, and of a scene: far finer than pictures tell apart


@dataclass(frozen=True)
class Kinds:
    """What the surfaces of a scene are made of.

    Attributes:
        terms: of each kind. mirrors: how much of each term of a kind mirrors, where the scene's own material does, so
            that pictures follow what is seen in it. (3,) each
        first: kind of each material's first. ratios: of each material's kinds, none for one.
    """

    terms: list[Terms]
    mirrors: list[list[F64]]
    first: list[int]
    ratios: list[tuple[float, ...]]

    def of(self, material: NDArray[np.integer], roughness: F32) -> NDArray[np.int64]:
        """The kinds of points.

        Args:
            material: index into the scene's materials. (n,) roughness: over the material's, see
                `relume.trace.surface.Surface`. (n,)
        """
        kind: NDArray[np.int64] = np.array(self.first, np.int64)[material]
        for index, ratios in enumerate(self.ratios):
            if ratios:
                rows = np.flatnonzero(material == index)
                kind[rows] += level_of(ratios, roughness[rows])
        return kind


def _levels(material: Material, terms: Terms) -> tuple[float, ...]:
    """Of the map that terms of a material follow."""
    name = roughness_image(terms)
    if name is None:
        return levels_of(material)
    return levels_between(roughness_of(name), mean_roughness(name) or None, shortest_normal(material.normal_map))


def kinds_of(scene: Scene, look: Look) -> Kinds:
    """Find the kinds of a scene's surfaces under a look."""
    of_materials = [look.materials[material.name].terms for material in scene.materials]
    ends = [
        _levels(m, terms) if any(map(follows_map, terms)) else ()
        for m, terms in zip(scene.materials, of_materials, strict=True)
    ]
    num = min(_EACH, max(2, _ALL // max(1, sum(map(bool, ends)))))
    kinds = Kinds([], [], [], [])
    for material, terms, levels in zip(scene.materials, of_materials, ends, strict=True):
        ratios = tuple(np.square(np.linspace(levels[0] ** 0.5, levels[-1] ** 0.5, num)).tolist()) if levels else ()
        kinds.first.append(len(kinds.terms))
        kinds.ratios.append(ratios)
        kinds.terms.extend([at_ratio(term, ratio) for term in terms] for ratio in ratios or (1.0,))
        mirrors = [mirrored_share(term) * is_mirror(material.terms) for term in terms]
        kinds.mirrors.extend(mirrors for _ in ratios or (1.0,))
    return kinds
