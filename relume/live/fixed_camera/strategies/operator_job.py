"""Precomputing the operator of a term along the basis of an edit (eq. 22, Ben-Artzi 2006)."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.brdf.lobe_sampling import LobeSampling
from relume.brdf.term import Term
from relume.lights.spherical_triangles import TriangleLights
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.operator_budget import compressed_bytes, precompute_subsampled
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.fixed_camera.view_images import MERGED_LIGHT_SUFFIX, TermTarget
from relume.operators.edit_basis import EditBasis, precompute
from relume.operators.linear_operator import Compression, LinearOperator
from relume.operators.shade import shade
from relume.transport.shading_points import ShadingPoints
from relume.transport.split_light import SplitLight

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OperatorPrecompute:
    """An operator with all other factors fixed when its job was found.

    Attributes:
        basis: the free coefficients. key: of the operator in the cache. bands: of the term's curves, (3, J) each.
        lobe: along which rays are traced; None if it is wide, or changed by the basis.
        light: the illumination. form: compression of the operator.
    """

    target: TermTarget
    basis: EditBasis
    key: tuple[Hashable, ...]
    term: Term
    bands: Mapping[str, F64]
    lobe: LobeSampling | None
    light: Illumination
    form: Compression

    @classmethod
    def for_target(cls, target: TermTarget, basis: EditBasis, form: Compression) -> OperatorPrecompute:
        """Return the operator for the current target of a term.

        Args:
            target: the term. basis: its free coefficients. form: from `operator_form`.
        """
        images, material, live = target
        key = images.operator_key(material, live, basis, live.target_bands, is_merged_light=form.has_merged_lights)
        term_args = live.term, live.target_bands, live.lobe_beside(basis)
        return cls(target, basis, key, *term_args, live.light, form)

    def job(self) -> Job:
        """Return the job; it can wait if the term already has a preview."""
        priority = Priority.REFINEMENT if self.target.live.has_preview() else Priority.CONTROL
        label = f"{self.target.name}, {self.basis.label}"
        return Job(("operator", *self.key), label, priority, self.run, self.apply, state="precomputing")

    @property
    def num_bytes(self) -> int:
        """Memory of the result."""
        return compressed_bytes(self.target.material, self.basis.num_columns, self.form)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> LinearOperator:
        """Precompute the operator, or return it from the cache."""
        images, material, _ = self.target
        step, bits, has_merged_lights = self.form
        quality = LightQuality.MERGED if has_merged_lights else LightQuality.EXACT

        def build_operator() -> LinearOperator:
            lights, receivers = images.incident_light(material, self.light, is_canceled, quality, self.lobe)

            split = self._split_light(lights, receivers, is_canceled) if step == 1 else None

            def precompute_at(samples: ShadingPoints) -> LinearOperator:
                args = self.basis, self.term, self.bands, lights, samples, progress, is_canceled, bits
                return precompute(*args, split)

            if step > 1:
                return precompute_subsampled(images.view, material.index, step, receivers, precompute_at)
            return replace(precompute_at(receivers), has_merged_lights=has_merged_lights)

        return images.cache.get(self.key, LinearOperator, self.num_bytes, build_operator)

    def _split_light(
        self, lights: TriangleLights, receivers: ShadingPoints, is_canceled: CancelCheck
    ) -> SplitLight | None:
        """Return the light at the samples that the exact image splits; None for none.

        Args:
            lights, receivers: incident light at all samples. is_canceled: polled.
        """
        if self.lobe is None:
            return None
        images, material, _ = self.target

        def unsplit() -> F32:
            args = self.term, self.bands, lights, receivers, lambda fraction: None, is_canceled
            return shade(*args).rows(material.num_samples)

        return images.split_light(material, self.light, self.lobe, unsplit, is_canceled)

    def apply(self, result: LinearOperator) -> None:
        """Use the operator, only if its fixed curves are still those of the target.

        If the image shows other curves, or the operator is more exact, the image is summed anew. An operator that is
        not exact continues from the current image, if that differs in nothing else.
        """
        images, material, live = self.target
        is_merged_light = self.form.has_merged_lights
        if not is_merged_light:
            images.cache.evict((*self.key, MERGED_LIGHT_SUFFIX))
        current_key = images.operator_key(
            material, live, self.basis, live.target_bands, is_merged_light=is_merged_light
        )
        if not self.target.exists() or self.key != current_key:
            return
        ready, changed = live.ready, set(live.changed_curves())
        # its coefficients are valid, even if only some were updated
        has_coefficients = live.is_converged and ready.basis == self.basis
        if not result.is_exact and can_resume_from(ready, changed, self.basis):
            if not has_coefficients:
                live.set_ready(replace(ready, basis=self.basis, coefficients=self.basis.coefficients(ready.bands)))
            return
        if not result.is_whole:
            return
        improves_fidelity = ready.fidelity < Fidelity.EXACT and self.basis.is_complete
        if not changed <= set(self.basis.affected_curves) or (changed and not has_coefficients) or improves_fidelity:
            after = ready.evaluate_operator(result, self.basis, live.target_bands, live.light)
            live.set_ready(live.mark_lobe(after))
        elif not has_coefficients:
            live.set_ready(replace(ready, basis=self.basis, coefficients=self.basis.coefficients(live.target_bands)))


def can_resume_from(ready: DisplayedImage, changed: Collection[str], basis: EditBasis) -> bool:
    """Return whether changes along a basis may be added to a converged image: no other curve differs.

    Args:
        ready: image of a term. changed: curves whose target it does not show. basis: of an operator.
    """
    has_curves = all(not np.isnan(ready.bands.get(name, np.nan)).any() for name in basis.affected_curves)
    return ready.is_converged and has_curves and set(changed) <= set(basis.affected_curves)
