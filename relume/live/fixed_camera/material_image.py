"""The live image of one material: its terms, composed into the radiance of its view samples."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.specular import specular_albedo
from relume.brdf.texture_slots import EmissionImage, is_user_image
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.live_term import LiveTerm
from relume.math.uv_transform import UvTransform
from relume.views.compose_terms import add_term
from relume.views.pixel_blocks import num_blocks
from relume.views.view import Tile, View

F32 = NDArray[np.float32]


class MaterialImage:
    """State of one material in one view.

    Attributes:
        num_composed: number of times that its radiance has been written; equal numbers mean equal radiance.
    """

    def __init__(self, view: View, index: int, documents: Sequence[Mapping[str, Any]], light: Illumination) -> None:
        self._view, self.index = view, index
        rows = view.rows(index)
        self.num_samples = rows.stop - rows.start
        self._first = rows.start
        self._levels = view.roughness_levels(index)
        self._is_mirrored = view.is_mirrored[rows] if view.is_mirrored[rows].any() else None
        self._textures = view.textures[index]
        self.documents = list(documents)
        self._light = light
        self.terms = [self._live_term(document) for document in documents]
        self._emission: tuple[tuple[float, float, float], EmissionImage | None] = (0.0, 0.0, 0.0), None
        self._uv: UvTransform | None = None
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

    def _live_term(self, document: Mapping[str, Any]) -> LiveTerm:
        return LiveTerm(
            document, self.num_samples, lambda: self._view.cos_theta_o(self.index), self._levels, self._light
        )

    def set_view(self, view: View) -> None:
        """Set a view in which the samples of other materials have changed, but not those of this one."""
        self._view, self._is_current = view, False

    def keep_displayed(self, before: MaterialImage, rows: Shaped[NDArray[np.integer], " n"]) -> None:
        """Display another image of the same material until an image of this one is ready.

        Args:
            before: that image. rows: index of each sample of this image among its samples.
        """
        for term, previous_term in zip(self.terms, before.terms, strict=True):
            term.keep_displayed(previous_term, rows)

    def num_pixel_blocks(self, step: int) -> int:
        """Return the number of blocks of step × step pixels in which it is visible."""
        if step not in self._num_pixel_blocks:
            self._num_pixel_blocks[step] = num_blocks(self._view, self.index, step)
        return self._num_pixel_blocks[step]

    def lies_in(self, region: Tile) -> Shaped[NDArray[np.bool_], " n"]:
        """Return a mask of its samples in a region of the image, see `View.is_in_region`; the last result is cached."""
        cached = self._in_region
        if cached is None or cached[0] != region:
            self._in_region = cached = region, self._view.is_in_region(self.index, region)
        return cached[1]

    def set_documents(self, documents: Sequence[Mapping[str, Any]]) -> None:
        """Set new targets; unchanged terms keep their images."""
        if list(documents) == self.documents:
            return
        num_terms = len(self.terms)
        for k, document in enumerate(documents):
            if k >= num_terms:
                self.terms.append(self._live_term(document))
            elif document != self.documents[k]:
                self.terms[k].set_document(document)
        del self.terms[len(documents) :]
        self.documents = list(documents)
        self._is_current = False

    def set_uv(self, uv: UvTransform | None) -> None:
        """Set the transform of texture coordinates; None for the identity."""
        if uv != self._uv:
            self._uv, self._is_current = uv, False

    def set_light(self, light: Illumination, *, is_solo: bool) -> None:
        """Set the target illumination. is_solo: it is of some sources alone."""
        self._light = light
        for term in self.terms:
            term.set_light(light, is_solo=is_solo)

    def set_emission(
        self,
        emission: tuple[float, float, float],
        image: EmissionImage | None,
        emission_pattern: Callable[[int, EmissionImage | None], F32],
    ) -> None:
        """Set the emitted radiance.

        Args:
            emission: mean over the surfaces. image: emitted image of the look; None: they emit as in the scene.
            emission_pattern: returns the emission of the material's samples over that mean, (n, 1 or 3).
        """
        if (emission, image) == self._emission:
            return
        is_same_image = image == self._emission[1]
        self._emission, self._is_current = (emission, image), False
        if self._emission_pattern is None or not is_same_image:
            self._emission_pattern = emission_pattern(self.index, image)

    def set_factor(
        self,
        key: Hashable,
        factor: Shaped[F32, "3 n"] | None,
        max_radiance: Shaped[F32, "3 n"] | None,
        unlit: Shaped[F32, "3 n"] | None,
    ) -> None:
        """Set a factor on the radiance of every sample, as on a shadow catcher; None for 1.

        Args:
            key: identifies the factor, None for none. factor: float32 per sample.
            max_radiance: upper limit of the product.
            unlit: added to the product: radiance of samples that receive no light; None for zero.
        """
        if key != self.factor_key:
            self.factor_key, self._factor, self._max_radiance, self._unlit = key, factor, max_radiance, unlit
            self._is_current = False

    def set_mirror_emission(self, mirror_emission: Shaped[F32, "3 m"] | None) -> None:
        """Set the radiance of emitters between mirrors and the samples that are visible in them.

        Args:
            mirror_emission: for all mirrored samples of the view, None for zero; the same array while nothing changes.
        """
        if mirror_emission is not self._mirror_emission:
            self._mirror_emission, self._is_current = mirror_emission, False

    @property
    def mirrors(self) -> Sequence[Mapping[str, Any]]:
        """Documents of its terms whose mirrors are displayed; of a material without samples the newest ones."""
        return [term.mirror for term in self.terms] if self.num_samples else self.documents

    @property
    def is_shadow_catcher(self) -> bool:
        """True if only shadows on it are shown."""
        return self._factor is not None

    def compose(self, radiance: Shaped[F32, "3 samples"]) -> bool:
        """Write the material's samples into the view's radiance; False if nothing has changed."""
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
        if self._emission_pattern is not None and any(self._emission[0]):
            material_radiance += np.array(self._emission[0], np.float32)[:, None] * self._emission_pattern.T
        mirror_samples = self._view.mirrored
        if self._mirror_emission is not None and mirror_samples is not None:
            selection = mirror_samples.restrict_to(self._view.rows(self.index))
            material_radiance[:, mirror_samples.sample[selection] - self._first] += self._mirror_emission[:, selection]
        self._is_current = True
        self.num_composed += 1
        return True

    def term_radiance(
        self, term: LiveTerm, image: Shaped[F32, "tiles 3 lanes"], radiance: Shaped[F32, "3 samples"]
    ) -> None:
        """Write the radiance of another image of one term alone to `radiance`; the state of the term is unchanged."""
        color, texture = self._factors(term)
        add_term(image, color, texture, self._view_factor(term), self._first, self.num_samples, True, radiance)

    def factors_at(self, term: LiveTerm, sample: int) -> Shaped[NDArray[np.float64], " 3"]:
        """Return the factor on a term's image at one of the material's samples."""
        color, texture = self._factors(term)
        factor = color.astype(np.float64)
        if texture is not None:
            factor = factor * texture[sample]
        view_factor = self._view_factor(term)
        return factor if view_factor is None else factor * view_factor[:, sample]

    def level_at(self, sample: int) -> int:
        """Return the roughness level of one of the material's samples."""
        return int(self._levels.level[sample])

    def _view_factor(self, term: LiveTerm) -> F32 | None:
        """Factor on a term's finished samples, None for 1: outgoing curves, and 1 minus the specular albedo of mirrors.
        (3, n)
        """
        if self._is_mirrored is None or not (specular := specular_albedo(term.mirror)).any():
            return term.view_factor
        lobe = np.where(self._is_mirrored, (1 - specular)[:, None], 1).astype(np.float32)
        return lobe if term.view_factor is None else lobe * term.view_factor

    def _factors(self, term: LiveTerm) -> tuple[F32, F32 | None]:
        """Factors on a term's image: its color, and its texture per sample, None for 1."""
        color = np.asarray(term.document["color"], np.float32)
        name = term.document.get("texture")
        if is_user_image(name):
            return color, self._view.image(self.index, name, self._uv)
        return color, None if name is None else self._textures.get(name)
