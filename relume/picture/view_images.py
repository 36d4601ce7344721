"""The live terms of all materials in one view, and what the memory knows of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from copy import copy
from typing import cast

import numpy as np
from numpy.typing import NDArray

from relume.brdf.channels import roughness_image
from relume.brdf.document import complete_term
from relume.brdf.levels import follows_map
from relume.errors import ParameterError
from relume.light.triangles import TriangleLights
from relume.look import Look, TermLook, validate
from relume.memory import Memory
from relume.operators.edit_basis import CurveBasis, EditBasis
from relume.operators.nodes import linearise
from relume.operators.operator import Operator
from relume.operators.shade import Shaded, shaded_bytes
from relume.picture.light import Light, Solo, emission_of, gain_of, is_solo, light_of
from relume.picture.live_term import LiveTerm
from relume.picture.material_image import MaterialImage
from relume.picture.mirrors import Mirrors
from relume.picture.pointer import CurvePointer, ParameterPointer
from relume.picture.transfer import Axis, Transfer
from relume.project.receivers import Receivers
from relume.views.view import Tile
from relume.views.worn import Maps, worn

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

ROUGHLY = "roughly"
"""Ends the names of operators of merged lights."""

_WHITE = complete_term(("terms", 0), {"model": "lambert", "texture": None}, None)


def documents_of(look: Look, material: str) -> Sequence[TermLook]:
    """The terms whose images make a material's picture; of a catcher what arrives at it, as a white surface has it."""
    chosen = look.materials[material]
    return (cast(TermLook, _WHITE),) if chosen.catcher else chosen.terms


class ViewImages:
    """Found by name, by pointer, and by what the cache knows them as.

    Attributes:
        default: the scene's own look. by_name: the materials in the scene's order.
        light: what arrives at them. default_light: what does under the scene's own look.
        gain: what multiplies the finished picture. mirrors: what they send on of it.
        region: pixels that are seen of the picture: x, y, width, height; None: all.
    """

    def __init__(self, transfer: Transfer, view_name: str, cache: Memory) -> None:
        self.transfer, self.cache = transfer, cache
        self.view = transfer.views[view_name]
        self.default = validate(transfer.default_look, transfer.default_look)
        self.light = self.default_light = self._light_of(self.default)
        self.by_name = {
            name: MaterialImage(self.view, index, documents_of(self.default, name), self.light)
            for index, name in enumerate(transfer.material_names)
        }
        self.gain = gain_of(self.default)
        self.mirrors = Mirrors(self.view)
        self.region: Tile | None = None

    def following(self, look: Look) -> ViewImages:
        """The images of the view whose samples wear the images that a look names in the place of maps of roughness and
        of normals; the same where none is named that was not before. Materials whose images are others go on showing
        what they do; others are shared.

        Raises what `relume.views.worn.worn` raises; then nothing has changed.
        """
        maps = tuple(self._maps_of(look, name) for name in self.transfer.material_names)
        if maps == (self.view.maps or (None,) * len(maps)):
            return self
        changed, view = copy(self), worn(self.transfer.views[self.view.name], maps, self.transfer.tracer)
        changed.view, changed.mirrors, changed.by_name = view, Mirrors(view), {}
        place = np.empty(view.num_surface_samples, np.int64)
        place[self.view.as_baked()] = np.arange(len(place))  # of the samples as they were baked, in this view
        for index, (name, before) in enumerate(self.by_name.items()):
            image = before
            if view.place(index) != self.view.place(index):
                rows = view.rows(index)
                image = MaterialImage(view, index, before.documents, self.light)
                image.go_on_showing(before, place[view.as_baked()[rows]] - rows.start)
            changed.by_name[name] = image
        return changed

    def _maps_of(self, look: Look, material: str) -> Maps | None:
        """What a look names in the place of a material's maps; None for nothing."""
        documents, normals = documents_of(look, material), look.materials[material].normals
        roughness = roughness_image(documents)
        if roughness is None and normals is None:
            return None
        return Maps(roughness, normals, self._widening_base(material) if any(map(follows_map, documents)) else None)

    def _widening_base(self, material: str) -> float | None:
        """The roughness of a material's terms in the scene, that bumps below a pixel widen."""
        given = (term["params"].get("roughness") for term in documents_of(self.default, material))
        return next((float(np.mean(value)) for value in given if value is not None), None)

    def terms(self) -> Iterator[tuple[MaterialImage, LiveTerm]]:
        """All that this view sees anything of."""
        materials = self.by_name.values()
        return ((material, image) for material in materials if material.num_samples for image in material.terms)

    def image_bytes(self) -> int:
        """Memory of one image of every term."""
        return sum(shaded_bytes(material.num_samples) for material, _ in self.terms())

    def set_look(self, look: Look, solo: Solo = None) -> None:
        """A new target for every term, in the light of some sources alone where `solo` names them.

        Raises what `Transfer.radiance_of` raises; then nothing has changed.
        """
        light = self._light_of(look, solo)
        if light != self.light:
            if light.environment.map is not None:
                self.transfer.radiance_of(light.environment.map)
            self.light = light
            for material in self.by_name.values():
                material.set_light(light, is_solo=is_solo(look, solo))
        for name, material in self.by_name.items():
            material.set_documents(documents_of(look, name))
        self.gain = gain_of(look, solo)

    def shine_in(self, light: Light) -> None:
        """Surfaces send out themselves what they do in this light."""
        for name, material in self.by_name.items():
            material.set_emission(emission_of(light, name), self._shines)

    def follow_mirrors(self, look: Look) -> list[int]:
        """Bring mirrors to a look, as far as their materials are shown in it; returns the materials that send on
        something else than before."""
        names = {index: self.transfer.material_names[index] for index in self.mirrors.materials}
        shown = {k: None if look.materials[name].catcher else self.by_name[name].mirrors for k, name in names.items()}
        return self.mirrors.follow(shown)

    def arriving(
        self, material: MaterialImage, light: Light, cancelled: Callable[[], bool]
    ) -> tuple[TriangleLights, Receivers]:
        """What arrives at the samples of a material in a light; what the memory lacks is traced.

        Args:
            material: of these. light: what arrives. cancelled: asked now and then.
        Raises:
            CancelledError: `cancelled` said so.
        """
        if light.paths.reflect and material.num_samples:
            self.view.trace_gather_rays(material.index, cancelled)
            self.transfer.trace_cells(light, cancelled)
        return self.transfer.arriving(self.view, material.index, light, self.cache)

    def unlit(self, material: MaterialImage) -> Receivers:
        """The samples of a material, without what arrives at them."""

        def read() -> Receivers:
            return self.view.receivers(material.index, is_lit=False)

        key = self.transfer.key, "receivers", *self.view.place(material.index)
        return self.cache.keep(key, read)

    def is_default(self, material: MaterialImage, live: LiveTerm, light: Light) -> bool:
        """Whether a material's live term in some light is of the scene's own look: its image stays beside the store."""
        name = self.transfer.material_names[material.index]
        is_own = not any(self.view.maps[material.index : material.index + 1])
        return is_own and light == self.default_light and live.document in documents_of(self.default, name)

    def _light_of(self, look: Look, solo: Solo = None) -> Light:
        has_bounces = Axis.BOUNCES in self.transfer.axes
        return light_of(look, self.transfer.material_names, has_bounces=has_bounces, solo=solo)

    def _shines(self, material: int) -> F32:
        """How brightly the samples of a material shine, over its mean; nothing on sides that do not. (n, 1 or 3)"""
        return self.transfer.shines_at(self.view, material)[:, None] * self.view.shining(material)

    def find(self, pointer: CurvePointer | ParameterPointer) -> tuple[MaterialImage, LiveTerm]:
        """The material and the term of a pointer in the look as it is now.

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
            raise ParameterError(str(pointer), pointer.name, ", ".join(names))
        return material, term

    def basis(self, pointer: CurvePointer | ParameterPointer) -> EditBasis | None:
        """What must be free for what a pointer means to be moved; None where light has no part in it.

        Raises:
            ParameterError: there is no such curve or parameter.
        """
        _, term = self.find(pointer)
        if isinstance(pointer, ParameterPointer):
            return linearise(term.document, pointer.name)
        curve = term.term.curve(pointer.name)
        return None if curve.outgoing else CurveBasis.of(curve)

    def _place(self, material: MaterialImage) -> tuple[Hashable, ...]:
        return self.transfer.key, *self.view.place(material.index)  # the store comes first: a memory asks whose it is

    def key_of_operator(
        self,
        material: MaterialImage,
        live: LiveTerm,
        basis: EditBasis,
        bands: Mapping[str, F64],
        *,
        is_rough: bool = False,
    ) -> tuple[Hashable, ...]:
        """Name of the operator of a material's live term along a basis in the memory.

        Args:
            bands: of the term's curves, (3, J) each; those that it moves are free. is_rough: of that of merged lights.
        """
        return *self._place(material), live.key_of_operator(basis, bands), *((ROUGHLY,) if is_rough else ())

    def key_of_image(self, material: MaterialImage, live: LiveTerm, light: Light) -> tuple[Hashable, ...]:
        """Name of the image of a material's live term, of its target in some light."""
        return *self._place(material), live.key_of_image(light)

    def image_in(self, material: MaterialImage, live: LiveTerm, light: Light) -> Shaded | None:
        """The image of a material's live term, of its target in some light, where the memory has it."""
        return self.cache.find(self.key_of_image(material, live, light), Shaded)

    def is_at_hand(self, material: MaterialImage, live: LiveTerm) -> bool:
        """Whether the image of a term's target need not be made: it is in the memory, or was kept with the store."""
        key = self.key_of_image(material, live, self.light)
        return self.cache.find(key, Shaded) is not None or self.transfer.has_image(key[1:])

    def operator(self, material: MaterialImage, live: LiveTerm) -> Operator | None:
        """The operator that a term follows now, a rough one until the other is there; none if the memory dropped it."""
        ready = live.ready
        if ready.basis is None or not live.is_firm:
            return None
        key = self.key_of_operator(material, live, ready.basis, ready.bands)
        found = (self.cache.find(name, Operator) for name in (key, (*key, ROUGHLY)))  # type: ignore[type-abstract]
        return next((operator for operator in found if operator is not None), None)
