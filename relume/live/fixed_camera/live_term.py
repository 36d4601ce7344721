"""One term of one material in a picture: its target, its newest image, and its displayed image.

Exactness is tracked as in eqs. 29 to 31, Ben-Artzi 2006: an image belongs to coefficients, and a step adds
T · (c_target − c_displayed), the most important ones first if time is short.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.lobe_sampling import LobeSampling, lobe_curves, lobe_of, sample_lobe
from relume.brdf.roughness_levels import RoughnessLevels
from relume.brdf.specular import specular_albedo
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
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
        document: document of the term in the newest look. light: the target illumination.
        term: the declaration of its model with its fixed parameters. model: identifies the model and these parameters.
        target_bands: bands of each curve in the newest look. (3, J) float64 each, or (L, 3, J), see `TargetTerm`
        target_rows_key: the same as bytes, in order of the curves' names, for keys.
        view_factor: product of the curves of the outgoing angle, per sample. (3, samples) float32, or None for 1
        ready: its newest image.
        levels: roughness levels of its samples.
        displayed: its image in the picture; differs from `ready` until all terms have an image in one light.
        is_composed: the picture's radiance contains `displayed` in its current state.
        mirror: the document whose mirror the picture shows, see `update_mirror`.
    """

    def __init__(
        self,
        document: Mapping[str, Any],
        num_samples: int,
        read_cosine: Callable[[], F64],
        levels: RoughnessLevels,
        light: Illumination,
    ) -> None:
        """Start from an empty image.

        Args:
            document, levels, light: see the attributes. num_samples: of the image.
            read_cosine: returns cos θo of each sample; called at the first curve of it.
        """
        self.light = light
        self._is_solo = False
        self._before_solo: DisplayedImage | None = None  # reference image for the end of the solo
        self._read_cosine, self.levels = read_cosine, levels
        tiles, samples = tile_layout(num_samples)
        self.ready = self.displayed = DisplayedImage(np.zeros((tiles, 3, samples), np.float32))
        self.is_composed = False
        self._lobe_document: Mapping[str, Any] | None = None
        self._lobe: LobeSampling | None = None
        self.model: Hashable = None
        self.set_document(document)
        self.displayed, self.mirror = self.ready, self.document

    @cached_property
    def _theta_o(self) -> F64:
        """Outgoing angle of each sample, radians."""
        return np.arccos(self._read_cosine())

    def keep_displayed(self, before: LiveTerm, rows: Shaped[NDArray[np.integer], " n"]) -> None:
        """Display the image of another term of the same samples until an image of this one is ready.

        Args:
            before: the other term. rows: index of each sample of this term among its samples.
        """
        if not before.displayed.is_empty:
            image = ShadedTerm.from_rows(ShadedTerm(before.displayed.image).rows(len(rows))[rows]).image
            self.displayed = DisplayedImage(image, Fidelity.APPROXIMATE, light=before.displayed.light)
            self.mirror, self.is_composed = before.mirror, False

    def set_document(self, document: Mapping[str, Any]) -> None:
        """Set a new target; another model, or another value of a fixed parameter, starts from an empty image."""
        target = TargetTerm.from_document(document, lambda: self._theta_o, self.levels)
        if target.model != self.model:
            self.ready, self._before_solo = DisplayedImage(np.zeros_like(self.ready.image)), None
            if not self.displayed.is_empty:  # the target has none of its curves
                self.displayed = replace(self.displayed, bands={}, fidelity=Fidelity.APPROXIMATE)
        elif self.ready.basis is not None and not self.ready.basis.is_valid_for(document):
            self.ready = self._replace_ready(self.ready.without_edit())
        self.document, self.term, self.model = target.document, target.term, target.model
        self.target_bands, self.view_factor = target.bands, target.view_factor
        self.target_rows_key = _rows(self.target_bands, ())
        self.is_composed = False

    @property
    def lobe(self) -> LobeSampling | None:
        """The lobe along which rays are traced in the newest look; None if it is wide."""
        if self._lobe_document is not self.document:
            has_levels = bool(self.levels.pairs)
            self._lobe = sample_lobe(self.document, self.levels) if has_levels else lobe_of(self.document)
            self._lobe_document = self.document
        return self._lobe

    def lobe_beside(self, basis: EditBasis) -> LobeSampling | None:
        """Return the lobe along which the light of an operator is traced; None if the basis changes the lobe."""
        return None if self.changes_lobe(basis) else self.lobe

    def mark_lobe(self, image: DisplayedImage) -> DisplayedImage:
        """Return an operator's image, marked if the operator changes the lobe, which it cannot trace."""
        changes_lobe = image.basis is not None and self.changes_lobe(image.basis)
        return replace(image, traces_lobe=False) if changes_lobe and image.traces_lobe else image

    def changes_lobe(self, basis: EditBasis) -> bool:
        """Return whether a curve that shapes the lobe is free in a basis."""
        return any(curve.name in basis.affected_curves for curve in lobe_curves(self.document))

    def _lacks_lobe(self, image: DisplayedImage) -> bool:
        """Return whether an image does not trace the narrow lobe of the target."""
        return not image.traces_lobe and self.lobe is not None

    def update_mirror(self) -> None:
        """Update the mirror to the look; a mirror that fades is kept until its lobe can be displayed instead."""
        if self.mirror is self.document:
            return
        is_fading = bool(np.any(specular_albedo(self.document) < specular_albedo(self.mirror)))
        basis = self.displayed.basis if self.displayed is self.ready else None
        steps = () if basis is None else basis.affected_curves  # curves that an operator updates
        if not is_fading or set(self.displayed.changed_curves(self.target_bands)) <= set(steps):
            self.mirror, self.is_composed = self.document, False

    def set_light(self, light: Illumination, *, is_solo: bool) -> None:
        """Set the target illumination; the displayed image stays (`display_ready`).

        Args:
            is_solo: it is of some sources alone. The image of all sources is stored until the solo ends; mixing it
                again would need the image of every other source.
        """
        self.light = light
        current = self.ready.reset_for_new_light()
        if is_solo and not self._is_solo:
            before = current.reference  # steps may be added to the reference itself
            self._before_solo = None if before is None else replace(before, image=before.image.copy())
        elif self._is_solo and not is_solo:
            before, self._before_solo = self._before_solo, None
            if before is not None and not before.changed_curves(self.target_bands):
                current = replace(current, reference=before)
        self.ready, self._is_solo = current, is_solo
        reference = current.reference
        if reference is not None and reference.light == light:  # the light is back to that of the reference
            self.ready = replace(reference.without_edit(), image=reference.image.copy())

    def set_ready(self, image: DisplayedImage) -> None:
        """Set the newest image; it is displayed at once unless it must wait for all terms."""
        self.ready = self._replace_ready(image)

    def _replace_ready(self, image: DisplayedImage) -> DisplayedImage:
        """Return the image that replaces `ready`, and display it if `ready` was displayed."""
        if self.displayed is self.ready:
            self.displayed, self.is_composed = image, False
        return image

    def keeps_showing(self, reference: DisplayedImage) -> bool:
        """Return whether the displayed image is a copy of a reference image, which shows the target's curves."""
        displayed = self.displayed
        is_copy = displayed.reference is reference and displayed.bands is reference.bands
        is_copy &= displayed.fidelity == Fidelity.APPROXIMATE
        return is_copy and not reference.changed_curves(self.target_bands)

    def keep_image(self, light: Illumination) -> None:
        """Show the displayed image in another light; it need not be composed again."""
        self.ready = self.displayed = replace(self.displayed, light=light)

    def display_ready(self) -> None:
        """Display the newest image, if there is one."""
        if not self.ready.is_empty and self.displayed is not self.ready:
            self.displayed, self.is_composed = self.ready, False

    @property
    def latest(self) -> DisplayedImage:
        """The newest image if there is one, else the displayed image."""
        return self.displayed if self.ready.is_empty else self.ready

    @property
    def displays_outdated(self) -> bool:
        """True if there is no newer image, and the displayed one has another model or other fixed parameters."""
        return self.ready.is_empty and self.displayed.fidelity == Fidelity.APPROXIMATE

    @property
    def is_converged(self) -> bool:
        """True if steps may be added to the newest image."""
        return self.ready.is_converged

    def changed_curves(self) -> list[str]:
        """Return the curves whose target the newest image does not show."""
        return self.ready.changed_curves(self.target_bands) if self.is_converged else list(self.target_bands)

    def is_exact(self) -> bool:
        """Return whether the newest image shows the target exactly."""
        ready = self.ready
        return ready.fidelity == Fidelity.EXACT and not self.changed_curves() and not self._lacks_lobe(ready)

    def has_preview(self) -> bool:
        """Return whether a preview shows the target, so that shading may wait for the end of the drag.

        After a change of light each step of a drag brings a new preview. The first preview of a newly opened picture is
        never repeated, and does not show curves that changed since.
        """
        ready = self.ready
        is_preview = not ready.is_empty and not ready.is_converged
        return is_preview and (ready.reference is not None or not ready.changed_curves(self.target_bands))

    def needs_only_light(self) -> bool:
        """Return whether the reference image differs from the target only in light."""
        reference = self.ready.reference
        return reference is not None and not self.is_converged and not reference.changed_curves(self.target_bands)

    @property
    def fidelity(self) -> Fidelity:
        """Fidelity of the displayed image with respect to the look."""
        displayed = self.displayed
        is_current = displayed.light == self.light and not displayed.changed_curves(self.target_bands)
        limit = Fidelity.NEAR_EXACT if self._lacks_lobe(displayed) else Fidelity.EXACT
        return min(displayed.fidelity, limit if is_current else Fidelity.APPROXIMATE)

    def operator_key(self, basis: EditBasis, bands: Mapping[str, F64], light: Illumination) -> tuple[Hashable, ...]:
        """Dependencies of an operator besides view and material: model, light, and its fixed curves.

        Args:
            basis: its free coefficients. bands: of the term's curves, (3, J) each. light: the illumination.
        """
        return ((self.model, light), basis, *_rows(bands, basis.affected_curves))

    def image_key(self, light: Illumination) -> tuple[Hashable, ...]:
        """Dependencies of the target's image in some light besides view and material."""
        return ((self.model, light), None, *self.target_rows_key)


def _rows(bands: Mapping[str, F64], affected_curves: tuple[str, ...]) -> list[bytes]:
    """Bands of the curves that an edit does not change, in order of their names."""
    return [bands[name].astype(np.float32).tobytes() for name in sorted(bands) if name not in affected_curves]
