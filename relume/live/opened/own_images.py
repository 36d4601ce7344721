"""Looks whose transformed materials name the scene's own textures as images."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from relume.brdf.texture_slots import ROUGHNESS, TEXTURES
from relume.core.errors import StoreError
from relume.images.own_textures import OwnTextures
from relume.look import Look
from relume.look.model import MaterialLook, NormalMapLook
from relume.look.uv_transforms import check_uv_transforms
from relume.raytrace.alpha_test import GLASS_RULE
from relume.store.bake_protocol import StoreReader


class OwnImages:
    """The textures of a bake's materials, as images of its looks.

    Args:
        key: of the bake. store: the bake's.
    """

    def __init__(self, key: str, store: StoreReader) -> None:
        self._store, self._textures = store, OwnTextures.of(key, store)
        self._index = {name: k for k, name in enumerate(store.attributes["materials"])}

    def look(self, look: Look) -> Look:
        """Return a look in which materials with a transform of texture coordinates name their own textures as images.

        Raises:
            ParameterError: the images of a material cannot be transformed. StoreError: the bake is too old for this.
        """
        moved = {name: each for name, each in look.materials.items() if each.uv_transform is not None}
        if not moved:
            return look
        check_uv_transforms(look, self._fixed())
        materials = {name: self._material(self._index[name], material) for name, material in moved.items()}
        return look.model_copy(update={"materials": {**look.materials, **materials}})

    def _fixed(self) -> dict[str, str]:
        """Return the image of each material that has one which cannot be transformed."""
        attributes, fixed = self._store.attributes, dict[str, str]()
        if "roughness_maps" not in attributes:
            raise StoreError("this bake is too old for transforms of texture coordinates; bake the scene again")
        if attributes.get("has_alpha_test"):
            row, rules = (self._store.read(f"alpha_masks/{name}") for name in ("material_rule", "rules"))
            images = self._store.read("alpha_masks/images")
            for name, k in self._index.items():
                if row[k] >= 0 and (rules[row[k], 0] != GLASS_RULE or max(images[row[k], 1:3]) > 1):
                    fixed[name] = "an opacity image"
        emitters = (name for name, k in self._index.items() if attributes["emission_images"][k] >= 0)
        return fixed | dict.fromkeys(emitters, "an emission image")

    def _material(self, index: int, material: MaterialLook) -> MaterialLook:
        attributes = self._store.attributes
        channels = dict(zip(TEXTURES, attributes["textures"][index], strict=True))
        normals, normal_map = attributes["normal_maps"][index], material.normal_map
        if normal_map is None and normals >= 0:
            normal_map = NormalMapLook(image=self._textures.name(f"textures/{normals}"))
        terms = tuple(self._term(term, channels, attributes["roughness_maps"][index]) for term in material.terms)
        return material.model_copy(update={"terms": terms, "normal_map": normal_map})

    def _term(self, term: Mapping[str, Any], channels: Mapping[str, int], roughness: int) -> Mapping[str, Any]:
        named = dict(term)
        if (texture := channels.get(term["texture"], -1)) >= 0:
            named["texture"] = self._textures.name(f"textures/{texture}")
        if term.get("roughness_map") == ROUGHNESS and roughness >= 0:
            named["roughness_map"] = self._textures.name(f"roughness/{roughness}")
        return named
