"""One term of one material in a picture: what is wanted of it, what it has ready, and what the picture shows of it.

Exactness is tracked as in eqs. 29 to 31, Ben-Artzi 2006: an image belongs to coefficients, and a step adds
T · (c_perfect − c_shown), the most important ones first where there is no time for all.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.brdf.roughness_levels import RoughnessLevels
from relume.brdf.specular import specular_albedo
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity, FidelityLabel, fidelity_label
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.target import TargetTerm
from relume.operators.edit_basis import EditBasis
from relume.operators.linear_operator import tile_layout
from relume.operators.shade import ShadedTerm

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


class LiveTerm:
    """State of one term.

    Attributes:
        document: of the term in the newest look. light: in which it is wanted.
        term: the declaration of its model, fixed parameters put in. model: what tells it from other models.
        target_bands: bands of each curve in the newest look. (3, J) float64 each, or (L, 3, J), see `TargetTerm`
        target_rows_key: the same as bytes, in order of the curves' names: what keys are made of.
        view_factor: product of the curves of the outgoing angle, per sample. (3, samples) float32, or None for 1
        ready: the newest image of it.
        displayed: the image in the picture; another one than `ready` until all terms can be shown in one light.
        is_composed: the picture's radiance has `displayed` in it as it is now.
        mirror: the document whose mirror the picture shows, see `update_mirror`.
    """

    def __init__(
        self, document: Mapping[str, Any], cos_theta_o: F64, levels: RoughnessLevels, light: Illumination
    ) -> None:
        self.light = light
        self._is_solo = False
        self._before_solo: DisplayedImage | None = None  # what can be gone on from when all sources come back
        self._cos_theta_o, self._levels = cos_theta_o, levels
        tiles, samples = tile_layout(len(cos_theta_o))
        self.ready = self.displayed = DisplayedImage(np.zeros((tiles, 3, samples), np.float32))
        self.is_composed = False
        self.model: Hashable = None
        self.set_document(document)
        self.displayed, self.mirror = self.ready, self.document

    @cached_property
    def _theta_o(self) -> F64:
        """Of each sample, radians; kept once a curve of it is there."""
        return np.arccos(self._cos_theta_o)

    def keep_displayed(self, before: LiveTerm, rows: NDArray[np.integer]) -> None:
        """Show what another term of the same samples does, until something of this one is ready.

        Args:
            before: the other. rows: of its samples, which each of these is. (n,)
        """
        if before.displayed.fidelity:
            image = ShadedTerm.from_rows(ShadedTerm(before.displayed.image).rows(len(rows))[rows]).image
            base = before.displayed.without_edit()
            self.displayed = replace(base, image=image, bands={}, reference=None, exact_region=None, is_outdated=True)
            self.mirror, self.is_composed = before.mirror, False

    def set_document(self, document: Mapping[str, Any]) -> None:
        """A new target; another model, or another value of a fixed parameter, starts from nothing."""
        target = TargetTerm.from_document(document, lambda: self._theta_o, self._levels)
        if target.model != self.model:
            self.ready, self._before_solo = DisplayedImage(np.zeros_like(self.ready.image)), None
            self.displayed = replace(self.displayed, bands={}, is_outdated=True)  # none of its curves is wanted
        elif self.ready.basis is not None and not self.ready.basis.is_valid_for(document):
            self.ready = self._replace_ready(self.ready.without_edit())
        self.document, self.term, self.model = target.document, target.term, target.model
        self.target_bands, self.view_factor = target.bands, target.view_factor
        self.target_rows_key = _rows(self.target_bands, ())
        self.is_composed = False

    def update_mirror(self) -> None:
        """Its mirror follows the look; one that fades stays as it was until its lobe can be shown in its place."""
        if self.mirror is self.document:
            return
        is_fading = bool(np.any(specular_albedo(self.document) < specular_albedo(self.mirror)))
        basis = self.displayed.basis if self.displayed is self.ready else None
        steps = () if basis is None else basis.affected_curves  # curves on their way
        if not is_fading or set(self.displayed.changed_curves(self.target_bands)) <= set(steps):
            self.mirror, self.is_composed = self.document, False

    def set_light(self, light: Illumination, *, is_solo: bool) -> None:
        """It is wanted in another light; the picture goes on showing what it shows (`display_ready`).

        Args:
            is_solo: it is of some sources alone. Mixed from their images, those of the others would all be lacking when
                they come back, so the image of all sources is stored for then.
        """
        self.light = light
        current = self.ready.reset_for_new_light()
        if is_solo and not self._is_solo:
            self._before_solo = current.reference
        elif self._is_solo and not is_solo:
            before, self._before_solo = self._before_solo, None
            if before is not None and not before.changed_curves(self.target_bands):
                current = replace(current, reference=before)
        self.ready, self._is_solo = current, is_solo
        reference = current.reference
        if reference is not None and reference.light == light:  # as before, after all
            self.ready = replace(reference.without_edit(), image=reference.image.copy())

    def set_ready(self, image: DisplayedImage) -> None:
        """A new image is ready; the picture shows it at once, unless it is held back until all terms have one."""
        self.ready = self._replace_ready(image)

    def _replace_ready(self, image: DisplayedImage) -> DisplayedImage:
        """The image that takes the place of `ready`, in the picture as well where that shows it."""
        if self.displayed is self.ready:
            self.displayed, self.is_composed = image, False
        return image

    def display_ready(self) -> None:
        """The picture shows what is ready from now on, where there is anything."""
        if self.ready.fidelity and self.displayed is not self.ready:
            self.displayed, self.is_composed = self.ready, False

    @property
    def latest(self) -> DisplayedImage:
        """What could be shown of it now: what is ready, else what was shown before."""
        return self.ready if self.ready.fidelity else self.displayed

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing of it that could be shown."""
        return not self.latest.fidelity

    @property
    def displays_outdated(self) -> bool:
        """Whether nothing of it is ready, and another model or other fixed parameters are shown in its place."""
        return self.displayed.is_outdated and not self.ready.fidelity

    @property
    def is_converged(self) -> bool:
        """Whether steps may be added to what is ready."""
        return self.ready.is_converged

    def changed_curves(self) -> list[str]:
        """Curves whose target is not summed in what is ready."""
        return self.ready.changed_curves(self.target_bands) if self.is_converged else list(self.target_bands)

    def is_exact(self) -> bool:
        """Whether what is ready is all that is wanted."""
        return self.ready.fidelity == Fidelity.EXACT and not self.changed_curves()

    def has_preview(self) -> bool:
        """Whether its look can be seen though nothing firm is ready, so that shading may wait for the hand to rest.

        Where the light has changed every position of the hand brings another preview; the first one of all, of a
        picture that has just been opened, is the only one, and knows nothing of curves that were moved since.
        """
        ready = self.ready
        is_preview = ready.fidelity > Fidelity.NOTHING and not ready.is_converged
        return is_preview and (ready.reference is not None or not ready.changed_curves(self.target_bands))

    def needs_only_light(self) -> bool:
        """Whether all that is between its anchor and what is wanted is a change of light."""
        reference = self.ready.reference
        return reference is not None and not self.is_converged and not reference.changed_curves(self.target_bands)

    @property
    def fidelity_label(self) -> FidelityLabel:
        """How near what the picture shows of it is to its look."""
        displayed = self.displayed
        is_current = (
            not displayed.is_outdated
            and displayed.light == self.light
            and not displayed.changed_curves(self.target_bands)
        )
        return fidelity_label(displayed.fidelity, is_current=is_current)

    def operator_key(self, basis: EditBasis, bands: Mapping[str, F64]) -> tuple[Hashable, ...]:
        """What an operator depends on besides view and material: model, light, and the curves that are dormant."""
        return ((self.model, self.light), basis, *_rows(bands, basis.affected_curves))

    def image_key(self, light: Illumination) -> tuple[Hashable, ...]:
        """What the image of the target in some light depends on besides view and material."""
        return ((self.model, light), None, *self.target_rows_key)


def _rows(bands: Mapping[str, F64], affected_curves: tuple[str, ...]) -> list[bytes]:
    """Bands of the curves that are not moved, in order of their names."""
    return [bands[name].astype(np.float32).tobytes() for name in sorted(bands) if name not in affected_curves]
