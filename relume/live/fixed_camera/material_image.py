"""The live image of one material: its terms, composed into the radiance of its view samples."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.specular import specular_albedo
from relume.brdf.texture_slots import is_user_image
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.live_term import LiveTerm
from relume.views.compose_terms import add_term
from relume.views.pixel_blocks import num_blocks
from relume.views.view import Tile, View

F32 = NDArray[np.float32]


class MaterialImage:
    """State of one material in one view.

    Attributes:
        num_composed: how often its radiance has been written: whoever has seen as many has seen it as it is.
    """

    def __init__(self, view: View, index: int, documents: Sequence[Mapping[str, Any]], light: Illumination) -> None:
        self._view, self.index = view, index
        rows = view.rows(index)
        self.num_samples = rows.stop - rows.start
        self._first = rows.start
        self._cos_theta_o, self._levels = view.cos_theta_o[rows], view.roughness_levels(index)
        self._is_mirrored = view.is_mirrored[rows] if view.is_mirrored[rows].any() else None
        self._textures = view.textures[index]
        self.documents = list(documents)
        self._light = light
        self.terms = [LiveTerm(document, self._cos_theta_o, self._levels, light) for document in documents]
        self._emission = (0.0, 0.0, 0.0)
        self._emission_pattern: F32 | None = None
        self._factor: F32 | None = None
        self._max_radiance: F32 | None = None
        self._unlit: F32 | None = None
        self._mirror_emission: F32 | None = None
        self.factor_key: Hashable = None
        self._is_current = False
        self.num_composed = 0
        self._num_pixel_blocks: dict[int, int] = {}
        self._in_region: tuple[Tile, NDArray[np.bool_]] | None = None

    def set_view(self, view: View) -> None:
        """The view has other samples of other materials, and the same of this one."""
        self._view, self._is_current = view, False

    def keep_displayed(self, before: MaterialImage, rows: NDArray[np.integer]) -> None:
        """Show what the same material's image does, until something of this one is ready.

        Args:
            before: that image. rows: of its samples, which each of these is. (n,)
        """
        for term, previous_term in zip(self.terms, before.terms, strict=True):
            term.keep_displayed(previous_term, rows)

    def num_pixel_blocks(self, step: int) -> int:
        """How many squares of step × step pixels it is seen in."""
        if step not in self._num_pixel_blocks:
            self._num_pixel_blocks[step] = num_blocks(self._view, self.index, step)
        return self._num_pixel_blocks[step]

    def lies_in(self, region: Tile) -> NDArray[np.bool_]:
        """Which of its samples are seen in a region of the picture, see `View.lies_in`; the last answer is kept."""
        cached = self._in_region
        if cached is None or cached[0] != region:
            self._in_region = cached = region, self._view.is_in_region(self.index, region)
        return cached[1]

    def set_documents(self, documents: Sequence[Mapping[str, Any]]) -> None:
        """New targets; terms that stay as they are keep their images."""
        if list(documents) == self.documents:
            return
        num_terms = len(self.terms)
        for k, document in enumerate(documents):
            if k >= num_terms:
                self.terms.append(LiveTerm(document, self._cos_theta_o, self._levels, self._light))
            elif document != self.documents[k]:
                self.terms[k].set_document(document)
        del self.terms[len(documents) :]
        self.documents = list(documents)
        self._is_current = False

    def set_light(self, light: Illumination, *, is_solo: bool) -> None:
        """It is lit by this from now on. is_solo: by some sources alone."""
        self._light = light
        for term in self.terms:
            term.set_light(light, is_solo=is_solo)

    def set_emission(self, emission: tuple[float, float, float], emission_pattern: Callable[[int], F32]) -> None:
        """The surfaces send this out themselves, as `emission_pattern` says of the material's samples, (n, 1 or 3)."""
        if emission == self._emission:
            return
        self._emission, self._is_current = emission, False
        if self._emission_pattern is None:
            self._emission_pattern = emission_pattern(self.index)

    def set_factor(self, key: Hashable, factor: F32 | None, max_radiance: F32 | None, unlit: F32 | None) -> None:
        """Every sample's finished radiance is multiplied, as on a ground that only catches shadows; None: by one.

        Args:
            key: that tells it from others, None for none. factor: (3, n) float32
            max_radiance: that samples become by it. (3, n) float32
            unlit: added to what is multiplied: what samples show without any light. (3, n) float32 or None for nothing
        """
        if key != self.factor_key:
            self.factor_key, self._factor, self._max_radiance, self._unlit = key, factor, max_radiance, unlit
            self._is_current = False

    def set_mirror_emission(self, mirror_emission: F32 | None) -> None:
        """What shines between mirrors and samples that are seen in them, (3, n): the same array while it is the same.

        Args:
            mirror_emission: of all of the view that are seen in mirrors. (3, m) float32, None for nothing
        """
        if mirror_emission is not self._mirror_emission:
            self._mirror_emission, self._is_current = mirror_emission, False

    @property
    def mirrors(self) -> Sequence[Mapping[str, Any]]:
        """Its terms, as their mirrors are shown; those of a material of which nothing else is seen follow at once."""
        return [term.mirror for term in self.terms] if self.num_samples else self.documents

    @property
    def is_shadow_catcher(self) -> bool:
        """Whether only shadows on it are shown."""
        return self._factor is not None

    def compose(self, radiance: F32) -> bool:
        """Write the material's samples into the view's radiance; False where nothing has changed since."""
        for term in self.terms:
            term.update_mirror()
        if self._is_current and all(term.is_composed for term in self.terms):
            return False
        for k, term in enumerate(self.terms):
            color, texture = self._factors(term)
            view_factor = self._view_factor(term) if self._factor is None else self._factor
            sample_range = self._first, self.num_samples
            add_term(term.displayed.image, color, texture, view_factor, *sample_range, k == 0, radiance)
            term.is_composed = True
        material_radiance = radiance[:, self._first : self._first + self.num_samples]
        if not self.terms:
            material_radiance[:] = 0
        if self._max_radiance is not None:
            np.minimum(material_radiance, self._max_radiance, out=material_radiance)
        if self._unlit is not None:
            material_radiance += self._unlit
        if self._emission_pattern is not None and any(self._emission):
            material_radiance += np.array(self._emission, np.float32)[:, None] * self._emission_pattern.T
        mirror_samples = self._view.mirrored
        if self._mirror_emission is not None and mirror_samples is not None:
            selection = mirror_samples.restrict_to(self._view.rows(self.index))
            material_radiance[:, mirror_samples.sample[selection] - self._first] += self._mirror_emission[:, selection]
        self._is_current = True
        self.num_composed += 1
        return True

    def term_radiance(self, term: LiveTerm, image: F32, radiance: F32) -> None:
        """Write what another image of one term would give alone to `radiance`, (3, samples); the term stays."""
        color, texture = self._factors(term)
        add_term(image, color, texture, self._view_factor(term), self._first, self.num_samples, True, radiance)

    def factors_at(self, term: LiveTerm, sample: int) -> NDArray[np.float64]:
        """What multiplies a term's image at one of the material's samples. (3,) float64"""
        color, texture = self._factors(term)
        factor = color.astype(np.float64)
        if texture is not None:
            factor = factor * texture[sample]
        view_factor = self._view_factor(term)
        return factor if view_factor is None else factor * view_factor[:, sample]

    def level_at(self, sample: int) -> int:
        """The level of roughness of one of the material's samples."""
        return int(self._levels.level[sample])

    def _view_factor(self, term: LiveTerm) -> F32 | None:
        """What multiplies a term's finished samples, None for one: its outgoing curves; of mirrors, whose picture other
        samples have, the share that is none. (3, n)"""
        if self._is_mirrored is None or not (specular := specular_albedo(term.mirror)).any():
            return term.view_factor
        lobe = np.where(self._is_mirrored, (1 - specular)[:, None], 1).astype(np.float32)
        return lobe if term.view_factor is None else lobe * term.view_factor

    def _factors(self, term: LiveTerm) -> tuple[F32, F32 | None]:
        """What multiplies a term's image: its colour, and its texture per sample, None for one."""
        color = np.asarray(term.document["color"], np.float32)
        name = term.document.get("texture")
        if is_user_image(name):
            return color, self._view.image(self.index, name)
        return color, None if name is None else self._textures.get(name)
