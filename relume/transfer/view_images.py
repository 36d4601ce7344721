"""The live images of all materials in one view, and the frozen operators that they follow."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from relume.errors import ParameterError
from relume.light.local import num_samples
from relume.look import LightGeometry, Look, TermLook, validate
from relume.look.terms import complete_term
from relume.transfer.along import Along, AlongCurve
from relume.transfer.cache import FrozenCache
from relume.transfer.frozen import Frozen
from relume.transfer.light import Light, emission_of, gain_of, light_of
from relume.transfer.local import SAMPLES, Points, Shadows
from relume.transfer.material_image import MaterialImage
from relume.transfer.opened import Transfer
from relume.transfer.pointer import CurvePointer, ParameterPointer
from relume.transfer.receivers import LocalRays
from relume.transfer.shade import Shaded
from relume.transfer.slider import linearise
from relume.transfer.term_image import TermImage

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
        gain: what multiplies the finished picture.
    """

    def __init__(self, transfer: Transfer, view_name: str, cache: FrozenCache) -> None:
        self.transfer, self.cache = transfer, cache
        self.view = transfer.views[view_name]
        self.default = validate(transfer.default_look, transfer.default_look)
        self.light = self.default_light = self._light_of(self.default)
        self.by_name = {
            name: MaterialImage(self.view, index, documents_of(self.default, name), self.light)
            for index, name in enumerate(transfer.material_names)
        }
        self.gain = gain_of(self.default)

    def terms(self) -> Iterator[tuple[MaterialImage, TermImage]]:
        """All that this view sees anything of."""
        materials = self.by_name.values()
        return ((material, image) for material in materials if material.num_samples for image in material.terms)

    def set_look(self, look: Look) -> None:
        """A new target for every term. Raises what `Transfer.radiance_of` raises; then nothing has changed."""
        light = self._light_of(look)
        if light != self.light:
            self.transfer.radiance_of(light.environment.map)
            self.light = light
            for material in self.by_name.values():
                material.set_light(light)
        for name, material in self.by_name.items():
            material.set_documents(documents_of(look, name))
        self.gain = gain_of(look)

    def shine_in(self, light: Light) -> None:
        """Surfaces send out themselves what they do in this light."""
        for name, material in self.by_name.items():
            material.set_emission(emission_of(light, name), self._shines)

    def local_rays(self, material: int, light: Light) -> list[LocalRays]:
        """What a material's samples see of local lights; shadows that the cache lacks are traced."""
        if not light.local:
            return []
        local = self.transfer.local

        def remembered(geometry: LightGeometry, points: Points) -> Shadows:
            key = (self.transfer.key, self.view.name, material, "shadows", geometry)
            num_bytes = len(points.position) * -(-num_samples(geometry, SAMPLES) // 8)
            return self.cache.get(key, Shadows, num_bytes, lambda: local.shadows(geometry, points))

        return local.all_rays(light, self.view.points(material), remembered)

    def _light_of(self, look: Look) -> Light:
        return light_of(look, self.transfer.material_names, has_cells=self.transfer.cells is not None)

    def _shines(self, material: int) -> NDArray[np.bool_]:
        """Which samples of a material show a side that shines, where it does."""
        eye = self.view.camera.to_world[:3, 3].astype(np.float32)
        return self.transfer.local.shines_at(material, eye, self.view.points(material).position)

    def find(self, pointer: CurvePointer | ParameterPointer) -> tuple[MaterialImage, TermImage]:
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

    def along(self, pointer: CurvePointer | ParameterPointer) -> Along | None:
        """What must be free for what a pointer means to be moved; None where light has no part in it.

        Raises:
            ParameterError: there is no such curve or parameter.
        """
        _, term = self.find(pointer)
        if isinstance(pointer, ParameterPointer):
            return linearise(term.document, pointer.name)
        curve = term.term.curve(pointer.name)
        return None if curve.outgoing else AlongCurve.of(curve)

    def key(
        self, material: MaterialImage, term: TermImage, active: Along | None, *, of_target: bool
    ) -> tuple[Hashable, ...]:
        """Name of an operator, or of an image where nothing is active, in the cache; the store comes first."""
        return self.transfer.key, self.view.name, material.index, term.dormant_key(active, of_target=of_target)

    def key_of_image(self, material: MaterialImage, term: TermImage, light: Light) -> tuple[Hashable, ...]:
        """Name of the image of a term's target in some light."""
        return self.transfer.key, self.view.name, material.index, term.key_in(light)

    def is_at_hand(self, material: MaterialImage, term: TermImage) -> bool:
        """Whether the image of a term's target need not be made: it is in the cache, or was kept with the store."""
        key = self.key_of_image(material, term, self.light)
        return self.cache.find(key, Shaded) is not None or self.transfer.has_image(key[1:])

    def operator(self, material: MaterialImage, term: TermImage) -> Frozen | None:
        """The operator that the term's image follows now, unless the cache has dropped it."""
        if term.active is None or term.effective is None:
            return None
        return self.cache.find(self.key(material, term, term.active, of_target=False), Frozen)
