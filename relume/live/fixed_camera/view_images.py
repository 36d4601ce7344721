"""The live terms of all materials in one view, and their cached results."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from copy import copy
from typing import NamedTuple, cast

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.lobe_sampling import LobeSampling
from relume.brdf.roughness_levels import uses_roughness_map
from relume.brdf.term_validation import complete_term
from relume.brdf.texture_slots import EmissionImage, roughness_image
from relume.core.cache import Cache
from relume.core.errors import ParameterError
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.edit_pointers import CurvePointer, ParameterPointer
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import (
    Illumination,
    Solo,
    emission_images,
    geometries,
    group_lights,
    illumination_from_look,
    images_by_material,
    is_solo,
    links,
    material_emissions,
    picture_gain,
)
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.mirror_samples import MirrorFactors
from relume.live.fixed_camera.protocols import (
    EditAxis,
    FixedViewTransfer,
    LightQuality,
    LightsAndPoints,
    LobeShader,
    PatchRadiance,
)
from relume.look import Look, TermLook, validate
from relume.operators.edit_basis import CurveBasis, EditBasis
from relume.operators.linear_operator import LinearOperator
from relume.operators.parameter_operator import linearize
from relume.operators.shade import ShadedTerm, shaded_bytes
from relume.transport.shading_points import ShadingPoints
from relume.transport.split_light import SplitLight
from relume.views.map_override import MapOverrides, with_overrides
from relume.views.view import Tile

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MERGED_LIGHT_SUFFIX = "roughly"
"""Suffix of the keys of operators from merged lights."""

_WHITE = complete_term(("terms", 0), {"model": "lambert", "texture": None}, None)


def material_documents(look: Look, material: str) -> Sequence[TermLook]:
    """Return the terms that a material's image needs; for a shadow catcher a white diffuse term."""
    material_look = look.materials[material]
    return (cast(TermLook, _WHITE),) if material_look.shadow_catcher else material_look.terms


class OutgoingChange(NamedTuple):
    """Change of outgoing radiance between two lights, equal for all terms.

    Attributes:
        before, after: the lights. radiance: change of the patches. coefficients: Haar coefficients of this change.
    """

    before: Illumination
    after: Illumination
    radiance: PatchRadiance
    coefficients: Shaped[F32, "padded 3"]


class ViewImages:
    """Material images of one view, by name, by pointer, and with their cache keys.

    Attributes:
        default: the scene's own look. by_name: the materials in the scene's order.
        light: the illumination. default_light: that of the scene's own look.
        groups: light of each light group alone at intensity 1, see `group_lights`.
        gain: gain of the finished image. mirrors: the mirrors of the image.
        glass_factors: factors of the samples that preview edited glass, in the view's order; None for 1.
        region: visible pixels of the image: x, y, width, height; None: all.
        outgoing_change: of the last incremental update, for the next term.
        lobe_shader: of the last light that it was prepared for; None before.
    """

    def __init__(self, transfer: FixedViewTransfer, view_name: str, cache: Cache) -> None:
        self.transfer, self.cache = transfer, cache
        self.view = transfer.views[view_name]
        self.default = validate(transfer.default_look, transfer.default_look)
        self.light, self.groups = self._lights_from_look(self.default)
        self.default_light = self.light
        self.by_name = {
            name: MaterialImage(self.view, index, material_documents(self.default, name), self.light)
            for index, name in enumerate(transfer.material_names)
        }
        self.gain = picture_gain(self.default)
        self.mirrors = MirrorFactors(self.view)
        self.glass_factors: F32 | None = None
        self.region: Tile | None = None
        self.outgoing_change: OutgoingChange | None = None
        self.lobe_shader: LobeShader | None = None

    def view_with_overrides(self, look: Look) -> ViewImages:
        """Return the images of the view with the roughness- and normal-map overrides of a look; self if they are
        unchanged.

        Materials with changed overrides still display their previous images; others are shared.

        Raises what `relume.views.map_override.with_overrides` raises; then nothing has changed.
        """
        look = self.transfer.with_own_images(look)
        maps = tuple(self._map_overrides(look, name) for name in self.transfer.material_names)
        if maps == (self.view.maps or (None,) * len(maps)):
            return self
        changed, view = copy(self), with_overrides(self.transfer.views[self.view.name], maps, self.transfer.tracer)
        changed.view, changed.mirrors, changed.by_name = view, MirrorFactors(view), {}
        changed.glass_factors = None
        baked_to_view = np.empty(view.num_surface_samples, np.int64)
        # sample index in this view, per baked sample
        baked_to_view[self.view.unmodified()] = np.arange(len(baked_to_view))
        for index, (name, before) in enumerate(self.by_name.items()):
            image = before
            if view.sample_key(index) != self.view.sample_key(index):
                rows = view.rows(index)
                image = MaterialImage(view, index, before.documents, self.light)
                image.keep_displayed(before, baked_to_view[view.unmodified()[rows]] - rows.start)
            changed.by_name[name] = image
        return changed

    @property
    def throughput(self) -> Shaped[F32, "n channels"]:
        """Factor of each sample's radiance in its pixel, in the view's order: with mirrors and previewed glass."""
        gains = self.mirrors.gains
        return gains if self.glass_factors is None else gains * self.glass_factors

    def _map_overrides(self, look: Look, material: str) -> MapOverrides | None:
        """Return the map overrides of a material in a look; None for none."""
        documents, normals = material_documents(look, material), look.materials[material].normals
        roughness = roughness_image(documents)
        if roughness is None and normals is None:
            return None
        base_roughness = self._base_roughness(material) if any(map(uses_roughness_map, documents)) else None
        uv = None if roughness is None else look.materials[material].uv_transform
        return MapOverrides(roughness, normals, base_roughness, uv)

    def _base_roughness(self, material: str) -> float | None:
        """Return the scene's roughness of a material's terms, which normal variation within a pixel widens."""
        values = (term["params"].get("roughness") for term in material_documents(self.default, material))
        return next((float(np.mean(value)) for value in values if value is not None), None)

    def terms(self) -> Iterator[tuple[MaterialImage, LiveTerm]]:
        """Yield the terms that are visible in this view."""
        materials = self.by_name.values()
        return ((material, image) for material in materials if material.num_samples for image in material.terms)

    def targets(self) -> Iterator[TermTarget]:
        """Yield the same terms as targets of strategies and jobs."""
        return (TermTarget(self, material, live) for material, live in self.terms())

    def image_bytes(self) -> int:
        """Return the memory of one image of every term."""
        return sum(shaded_bytes(material.num_samples) for material, _ in self.terms())

    def set_look(self, look: Look, solo: Solo = None) -> None:
        """Set a new target for every term; `solo` restricts the light to some sources.

        Raises what `FixedViewTransfer.environment_radiance` and `LocalLightTransport.emission_image` raise; then
        nothing has changed.
        """
        look = self.transfer.with_own_images(look)
        light, self.groups = self._lights_from_look(look, solo)
        if light != self.light:
            if light.environment.map is not None:
                self.transfer.environment_radiance(light.environment.map)
            self.light = light
            for material in self.by_name.values():
                material.set_light(light, is_solo=is_solo(look, solo))
        for name, material in self.by_name.items():
            material.set_documents(material_documents(look, name))
            material.set_uv(look.materials[name].uv_transform)
        self.gain = picture_gain(look, solo)

    def set_emission(self, light: Illumination) -> None:
        """Set the emission of surfaces in this light."""
        sources = (geometry for geometry, _ in light.local)
        images = images_by_material(emission_images(sources, self.transfer.local.emission_image))
        emissions = material_emissions(light, list(self.by_name), is_visible=True)
        for (name, material), (red, green, blue) in zip(self.by_name.items(), emissions.tolist(), strict=True):
            material.set_emission((red, green, blue), images.get(name), self._emission_pattern)

    def update_mirrors(self, look: Look) -> list[int]:
        """Update the mirrors to the displayed documents; returns the materials whose specular albedo changed."""
        names = {index: self.transfer.material_names[index] for index in self.mirrors.materials}
        documents = {
            k: None if look.materials[name].shadow_catcher else self.by_name[name].mirrors for k, name in names.items()
        }
        return self.mirrors.update_emission(documents)

    def incident_light(
        self,
        material: MaterialImage,
        light: Illumination,
        is_canceled: Callable[[], bool],
        quality: LightQuality = LightQuality.EXACT,
        lobe: LobeSampling | None = None,
        patch_light: Illumination | None = None,
    ) -> LightsAndPoints:
        """Return the incident light at the samples of a material. See `FixedViewTransfer.incident_light`."""
        samples = self.transfer.samples(self.view, material.index, self.cache)
        return self.transfer.incident_light(samples, light, quality, is_canceled, lobe, patch_light)

    def preview_highlights(
        self, material: MaterialImage, light: Illumination, is_canceled: Callable[[], bool], max_lights: int
    ) -> LightsAndPoints:
        """Return the brightest light at the samples of a material. See `FixedViewTransfer.preview_highlights`."""
        samples = self.transfer.samples(self.view, material.index, self.cache)
        return self.transfer.preview_highlights(samples, light, is_canceled, max_lights)

    def split_light(
        self,
        material: MaterialImage,
        light: Illumination,
        lobe: LobeSampling,
        unsplit: Callable[[], Shaped[F32, "n 3"]],
        is_canceled: Callable[[], bool],
        patch_light: Illumination | None = None,
    ) -> SplitLight | None:
        """Return the light at samples of a material that are split. See `FixedViewTransfer.split_light`."""
        return self.transfer.split_light(self.view, material.index, light, lobe, unsplit, is_canceled, patch_light)

    def unlit_samples(self, material: MaterialImage) -> ShadingPoints:
        """Return the samples of a material without incident light."""
        return self.view.receivers(material.index, is_lit=False)

    def is_default(self, material: MaterialImage, live: LiveTerm, light: Illumination) -> bool:
        """True if `live`, a term of `material`, in `light` is of the scene's own look, cached next to the store."""
        name = self.transfer.material_names[material.index]
        is_without_overrides = not any(self.view.maps[material.index : material.index + 1])
        return (
            is_without_overrides
            and light == self.default_light
            and live.document in material_documents(self.default, name)
        )

    def _lights_from_look(self, look: Look, solo: Solo = None) -> tuple[Illumination, Mapping[str, Illumination]]:
        has_bounces, names = EditAxis.BOUNCES in self.transfer.axes, self.transfer.material_names
        images = emission_images(geometries(look), self.transfer.local.emission_image)
        self.transfer.local.check_links(links(look))
        light = illumination_from_look(look, names, has_bounces=has_bounces, solo=solo, images=images)
        return light, group_lights(look, light, solo, images)

    def _emission_pattern(self, material: int, image: EmissionImage | None) -> F32:
        """Emission of a material's samples relative to its mean; zero on sides that do not emit. (n, 1 or 3)"""
        return self.transfer.is_emissive_at(self.view, material)[:, None] * self.view.emissive(material, image)

    def material_term(self, pointer: CurvePointer | ParameterPointer) -> tuple[MaterialImage, LiveTerm]:
        """Return the material and the term of a pointer in the current look.

        Raises:
            ParameterError: there is no such curve or parameter.
        """
        material = self.by_name.get(pointer.material)
        if material is None or not pointer.term < len(material.terms):
            raise ParameterError(str(pointer), pointer.material, "a material and term of this look")
        term = material.terms[pointer.term]
        declared = term.term.curves if isinstance(pointer, CurvePointer) else term.term.parameters
        names = [item.name for item in declared]
        if pointer.name not in names:
            raise ParameterError(str(pointer), pointer.name, "one of " + ", ".join(names))
        return material, term

    def basis(self, pointer: CurvePointer | ParameterPointer) -> EditBasis | None:
        """Return the free coefficients for edits of a curve or parameter; None if no operator depends on it.

        Raises:
            ParameterError: there is no such curve or parameter.
        """
        _, term = self.material_term(pointer)
        if isinstance(pointer, ParameterPointer):
            return linearize(term.document, pointer.name)
        curve = term.term.curve(pointer.name)
        return None if curve.depends_on_view else CurveBasis.from_curve(curve)

    def _sample_key(self, material: MaterialImage) -> tuple[Hashable, ...]:
        # the store comes first: the cache groups entries by it
        return self.transfer.key, *self.view.sample_key(material.index)

    def operator_key(
        self,
        material: MaterialImage,
        live: LiveTerm,
        basis: EditBasis,
        bands: Mapping[str, F64],
        *,
        light: Illumination | None = None,
        is_merged_light: bool = False,
    ) -> tuple[Hashable, ...]:
        """Cache key of the operator of `live`, a term of `material`, along a basis.

        Args:
            bands: bands of the term's curves, (3, J) each; those of the basis are free.
            light: the illumination; None: the target's.
            is_merged_light: it is from merged lights.
        """
        return (
            *self._sample_key(material),
            live.operator_key(basis, bands, live.light if light is None else light),
            *((MERGED_LIGHT_SUFFIX,) if is_merged_light else ()),
        )

    def image_key(self, material: MaterialImage, live: LiveTerm, light: Illumination) -> tuple[Hashable, ...]:
        """Cache key of the image of the target of `live`, a term of `material`, in `light`."""
        return *self._sample_key(material), live.image_key(light)

    def image_in(self, material: MaterialImage, live: LiveTerm, light: Illumination) -> ShadedTerm | None:
        """Return the cached image of the target of `live`, a term of `material`, in `light`, or None."""
        return self.cache.get_cached(self.image_key(material, live, light), ShadedTerm)

    def is_cached(self, material: MaterialImage, live: LiveTerm) -> bool:
        """Return whether the image of a term's target is in the cache or on disk."""
        key = self.image_key(material, live, self.light)
        return self.cache.get_cached(key, ShadedTerm) is not None or self.transfer.has_image(key[1:])

    def operator(
        self, material: MaterialImage, live: LiveTerm, image: DisplayedImage | None = None
    ) -> LinearOperator | None:
        """Return the active operator of a term, a coarse one until the exact one is ready; None if it was evicted.

        Args:
            material, live: the term. image: that it updates; None: the newest.
        """
        updated = live.ready if image is None else image
        if updated.basis is None or updated.light is None or not updated.is_converged:
            return None
        key = self.operator_key(material, live, updated.basis, updated.bands, light=updated.light)
        candidates = (self.cache.get_cached(name, LinearOperator) for name in (key, (*key, MERGED_LIGHT_SUFFIX)))
        return next((operator for operator in candidates if operator is not None), None)


class TermTarget(NamedTuple):
    """A term of a picture: its view and material, and its state."""

    images: ViewImages
    material: MaterialImage
    live: LiveTerm

    @property
    def name(self) -> str:
        """The name of the material."""
        return self.images.transfer.material_names[self.material.index]

    @property
    def label(self) -> str:
        """Text for the user."""
        return f"{self.name}, {self.live.term.label}"

    def exists(self) -> bool:
        """Return whether the look still contains this term."""
        return any(self.live is term for term in self.material.terms)

    def is_visible(self, region: Tile | None) -> bool:
        """Return whether any sample of its material lies in a region; None: in the image."""
        return region is None or bool(self.material.lies_in(region).any())

    def is_exact_within(self, region: Tile | None) -> bool:
        """Return whether its newest image is exact in a region, though not everywhere."""
        images, material, live = self
        exact_region = live.ready.exact_region
        if region is None or exact_region is None or not _contains(exact_region[1], region):
            return False
        return exact_region[0] == images.image_key(material, live, live.light)

    def fidelity_in(self, region: Tile | None) -> Fidelity:
        """Return the fidelity of its displayed image in a region; None: everywhere."""
        live = self.live
        is_exact = live.displayed is live.ready and self.is_exact_within(region)
        return Fidelity.EXACT if is_exact or not self.is_visible(region) else live.fidelity


def _contains(outer: Tile, inner: Tile) -> bool:
    (x, y, width, height), (left, top, across, down) = outer, inner
    return x <= left and y <= top and left + across <= x + width and top + down <= y + height
