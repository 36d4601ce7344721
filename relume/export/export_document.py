"""An export before it is written: the scene, its looks, and their materials as principled surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from relume.assets.environments.environment_names import load_environment
from relume.core.errors import NotFoundError, ParameterError, SceneError
from relume.core.import_warnings import quote
from relume.export.export_images import ExportImages
from relume.export.export_materials import ExportMaterial, MaterialExporter
from relume.export.export_objects import assign_in_all_looks
from relume.look import Look, default_look, validate
from relume.look.light_mix import expand_light_mix
from relume.look.model import AreaLook, SingleLightLook
from relume.look.single_lights import single_lights
from relume.scene.model import Scene

MAX_VARIANTS = 100  # as many as imports read


@dataclass(frozen=True)
class ExportDocument:
    """Everything that a writer needs.

    Attributes:
        scene: geometry, cameras and names. look: lights and environment of the file.
        materials: as the look shows them, in the scene's order. variants: materials of further looks by their names.
        images: images of all materials. warnings: sentences about light mixes among the looks.
    """

    scene: Scene
    look: Look
    materials: list[ExportMaterial]
    variants: dict[str, list[ExportMaterial]]
    images: ExportImages
    warnings: tuple[str, ...] = ()

    def all_materials(self) -> list[ExportMaterial]:
        """Every material once: those of the look, then those of variants that differ from them."""
        distinct = {id(material): material for material in self.materials}
        for materials in self.variants.values():
            distinct.update((id(material), material) for material in materials)
        return list(distinct.values())

    def materials_of(self, index: int) -> list[ExportMaterial]:
        """The material `index` of the look and of all variants."""
        return [self.materials[index], *(materials[index] for materials in self.variants.values())]

    def variants_of(self, index: int) -> dict[int, list[int]]:
        """Numbers of the variants by the number, in `all_materials`, of a replacement of material `index`."""
        numbers = {id(material): number for number, material in enumerate(self.all_materials())}
        replacements: dict[int, list[int]] = {}
        for variant, materials in enumerate(self.variants.values()):
            if materials[index] is not self.materials[index]:
                replacements.setdefault(numbers[id(materials[index])], []).append(variant)
        return replacements

    @property
    def environment_name(self) -> str:
        """Name of the environment of the look, as users know it; as looks do if it is unavailable."""
        name = self.look.environment.map
        try:
            return self.scene.environment.name if name is None else load_environment(name).name
        except (NotFoundError, SceneError):
            return str(name)

    def lights(self) -> Iterator[tuple[str, SingleLightLook]]:
        """Lights other than emissive materials; area lights only if they emit."""
        for name, light in single_lights(self.scene, self.look).items():
            if light.kind != "mesh" and not (isinstance(light, AreaLook) and max(light.gain) == 0):
                yield name, light


def prepare_export(
    scene: Scene, look: Look, variants: Mapping[str, Look] | None = None, *, has_materials: bool = True
) -> ExportDocument:
    """Convert a scene's materials, without writing anything.

    Args:
        scene: the scene. look: a complete look of it.
        variants: further complete looks of it by name, after the variants that it was imported with.
        has_materials: the file has materials; otherwise none are converted.
    Raises:
        ParameterError: there are too many variants. NotFoundError, SceneError: an image of a look is unavailable.
    """
    variants, images = variants or {}, ExportImages()
    if not has_materials:
        return ExportDocument(scene, look, [], {name: [] for name in variants}, images)
    own = {name: look_of_scene(scene, partial, f"variant {name!r}") for name, partial in scene.variants.items()}
    variants = {**own, **variants}
    if len(variants) > MAX_VARIANTS:
        raise ParameterError("variants", len(variants), f"at most {MAX_VARIANTS} looks, with the variants of the scene")
    scene, (look, *others) = assign_in_all_looks(scene, [look, *variants.values()])
    exporter = MaterialExporter(scene, images)
    by_variant = {name: exporter.materials(each) for name, each in zip(variants, others, strict=True)}
    return ExportDocument(scene, look, exporter.materials(look), by_variant, images)


def light_mix_warnings(scene: Scene, documents: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return sentences about what a scene does not have of light mixes among look documents."""
    default = default_look(scene.materials, scene.lights)
    texts = [text for document in documents for text in expand_light_mix(document, default)[1]]
    return tuple(dict.fromkeys(texts))


def look_of_scene(scene: Scene, document: Mapping[str, Any], label: str) -> Look:
    """Return the complete look of a possibly partial document.

    Args:
        scene: the scene. document: changes to its default look. label: names the look in the error.
    Raises:
        ParameterError: the look is invalid, or of another scene.
    """
    default = default_look(scene.materials, scene.lights)
    names = document.get("materials", {})
    if isinstance(names, Mapping) and names and not names.keys() & default["materials"].keys():
        allowed = f"a look of the scene {quote(scene.name)}, which has none of its materials"
        raise ParameterError(label, min(map(str, names)), allowed)
    return validate(document, default)
