"""Jobs of a picture: found in the picture's thread, run in any thread, installed in the picture's thread.

All input of `run` is fixed when the job is found: the picture may change while the job runs, and `install` checks
whether the result is still needed.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, split_for_shading
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.operator_budget import compressed_bytes, precompute_subsampled
from relume.live.fixed_camera.protocols import LightQuality
from relume.live.fixed_camera.texel_light_cache import is_cacheable, put_texel_light
from relume.live.fixed_camera.view_images import MERGED_LIGHT_SUFFIX, ViewImages
from relume.look.model import Rgb
from relume.operators.edit_basis import EditBasis, precompute
from relume.operators.linear_operator import Compression, LinearOperator
from relume.operators.shade import PartialImage, ShadedTerm, shaded_bytes
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_PARTIAL_SUFFIX = "begun"  # ends the keys of partially shaded images
ProgressCallback = Callable[[float], None]
CancelCheck = Callable[[], bool]


class Job(Protocol):
    """A computation that a picture needs.

    Attributes:
        label: text for the user. key: equal keys are the same job.
        state: status while it runs; "updating" jobs take a few frames and are not reported.
        is_refinement: the picture is close to its look without it, so it can wait until the drag ends.
        is_resumable: a partial result is cached if it is canceled.
    """

    @property
    def label(self) -> str: ...
    @property
    def state(self) -> Literal["precomputing", "shading", "updating"]: ...
    @property
    def key(self) -> tuple[Hashable, ...]: ...
    @property
    def is_refinement(self) -> bool: ...
    @property
    def is_resumable(self) -> bool: ...
    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Any:
        """Compute the result, or return it from the cache.

        Raises:
            ResultUnavailableError: the displayed image can stay. CancelledError: `is_canceled`, polled regularly,
                returned true.
        """
        ...

    def install(self, result: Any) -> None:
        """Use the result of `run`, unless the look has changed so that it is no longer needed."""
        ...


class LightComponent(NamedTuple):
    """A component of a light. key: of the image in it alone. gain: per channel."""

    key: tuple[Hashable, ...]
    light: Illumination
    gain: Rgb


class TermTarget(NamedTuple):
    """A term of a picture: its view and material, and its state when a job was found."""

    images: ViewImages
    material: MaterialImage
    live: LiveTerm

    @property
    def name(self) -> str:
        """The name of the material."""
        return self.images.transfer.material_names[self.material.index]

    def exists(self) -> bool:
        """Return whether the look still contains this term."""
        return any(self.live is term for term in self.material.terms)


@dataclass(frozen=True, eq=False)
class PrecomputeOperator:
    """The operator of a term along the basis of an edit, all other factors fixed (eq. 22, Ben-Artzi 2006).

    Attributes:
        bands: of the term's curves, (3, J) each. light: the illumination.
        form: compression of the operator.
    """

    target: TermTarget
    basis: EditBasis
    key: tuple[Hashable, ...]
    term: Term
    bands: Mapping[str, F64]
    light: Illumination
    form: Compression
    is_refinement: bool
    state: Literal["precomputing", "shading"] = "precomputing"
    is_resumable = False

    @classmethod
    def for_target(cls, target: TermTarget, basis: EditBasis, form: Compression) -> PrecomputeOperator:
        """Return the job for the current target of a term.

        Args:
            target: the term. basis: its free coefficients. form: from `operator_form`.
        """
        images, material, live = target
        key = images.operator_key(material, live, basis, live.target_bands, is_merged_light=form.has_merged_lights)
        is_refinement = live.has_preview()
        return cls(target, basis, key, live.term, live.target_bands, live.light, form, is_refinement)

    @property
    def label(self) -> str:
        """Text for the user."""
        return f"{self.target.name}, {self.basis.label}"

    @property
    def num_bytes(self) -> int:
        """Memory of the result."""
        return compressed_bytes(self.target.material, self.basis.num_columns, self.form)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> LinearOperator:
        """See `Job`."""
        images, (step, bits, has_merged_lights) = self.target.images, self.form

        def build_operator() -> LinearOperator:
            material, quality = self.target.material, LightQuality.MERGED if has_merged_lights else LightQuality.EXACT
            lights, receivers = images.incident_light(material, self.light, is_canceled, quality)

            def precompute_at(samples: ShadingPoints) -> LinearOperator:
                return precompute(self.basis, self.term, self.bands, lights, samples, progress, is_canceled, bits)

            if step > 1:
                return precompute_subsampled(images.view, material.index, step, receivers, precompute_at)
            return replace(precompute_at(receivers), has_merged_lights=has_merged_lights)

        return images.cache.get(self.key, LinearOperator, self.num_bytes, build_operator)

    def install(self, result: LinearOperator) -> None:
        """See `Job`; used only if the fixed curves of the operator are still those of the target.

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
            live.set_ready(ready.evaluate_operator(result, self.basis, live.target_bands, live.light))
        elif not has_coefficients:
            live.set_ready(replace(ready, basis=self.basis, coefficients=self.basis.coefficients(live.target_bands)))


def can_resume_from(ready: DisplayedImage, changed: Collection[str], basis: EditBasis) -> bool:
    """Return whether changes along a basis may be added to a converged image: no other curve differs.

    Args:
        ready: image of a term. changed: curves whose target it does not show. basis: of an operator.
    """
    has_curves = all(not np.isnan(ready.bands.get(name, np.nan)).any() for name in basis.affected_curves)
    return ready.is_converged and has_curves and set(changed) <= set(basis.affected_curves)


@dataclass(frozen=True, eq=False)
class Shade:
    """The image of a term's target in some light, shaded from scratch: every strategy with fidelity EXACT must match
    it.

    Attributes:
        model: of the term. bands: of its curves, (3, J) each. light_components: their sum is the light.
        is_default: the look is the scene's own, whose images are cached next to the store.
    """

    target: TermTarget
    key: tuple[Hashable, ...]
    term: Term
    model: Hashable
    bands: Mapping[str, F64]
    light: Illumination
    light_components: Sequence[LightComponent]
    is_default: bool
    is_refinement: bool
    state: Literal["precomputing", "shading"] = "shading"
    is_resumable = True

    @classmethod
    def for_target(cls, target: TermTarget, light: Illumination, *, is_refinement: bool | None = None) -> Shade:
        """Return the job that shades a target in some light.

        Args:
            is_refinement: it can wait; None: it can if the term already has a preview.
        """
        images, material, live = target
        key, can_wait = (
            images.image_key(material, live, light),
            live.has_preview() if is_refinement is None else is_refinement,
        )
        components = [
            LightComponent(images.image_key(material, live, component), component, gain)
            for component, gain in split_for_shading(light).items()
        ]
        is_default = images.is_default(material, live, light)
        return cls(target, key, live.term, live.model, live.target_bands, light, components, is_default, can_wait)

    @property
    def label(self) -> str:
        """Text for the user."""
        return f"{self.target.name}, {self.term.label}"

    @property
    def num_bytes(self) -> int:
        """Memory of the result."""
        return shaded_bytes(self.target.material.num_samples)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        """See `Job`; the result is cached on disk as well."""
        images = self.target.images
        image_files = images.transfer.derived if self.is_default else images.transfer.edited
        shape = self.target.live.ready.image.shape

        def shaded() -> ShadedTerm:
            return image_files.get(self.key[1:], shape, lambda: self._sum_components(progress, is_canceled))

        return images.cache.get(self.key, ShadedTerm, self.num_bytes, shaded)

    def _sum_components(self, progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        """Shade the components of the light that are not cached, and sum all."""
        images, material, live = self.target
        btf_ref = self.term.texels
        if btf_ref is not None and self.light == live.light and is_cacheable(images, material, btf_ref):
            incident = put_texel_light(images, material, btf_ref, self.light, progress, is_canceled)
            return incident.shade(btf_ref, images.unlit_samples(material))
        if len(self.light_components) < 2:
            return self._complete_image(self.key, self.light, progress, is_canceled)
        weighted_images: list[tuple[F32, Rgb]] = []
        for done, (key, light, gain) in enumerate(self.light_components):
            shade_component = partial(
                self._complete_image, key, light, partial(self._report, progress, done), is_canceled
            )
            weighted_images.append((images.cache.get(key, ShadedTerm, self.num_bytes, shade_component).image, gain))
        return ShadedTerm(weighted_sum(np.zeros_like(live.ready.image), weighted_images))

    def _complete_image(
        self, key: tuple[Hashable, ...], light: Illumination, progress: ProgressCallback, is_canceled: CancelCheck
    ) -> ShadedTerm:
        """Complete the image in a light from its partial result."""
        shaded = ShadedTerm.from_rows(self._partial_rows(key, light, progress, is_canceled, None))
        self.target.images.cache.evict((*key, _PARTIAL_SUFFIX))
        return shaded

    def _partial_rows(
        self,
        key: tuple[Hashable, ...],
        light: Illumination,
        progress: ProgressCallback,
        is_canceled: CancelCheck,
        sample_mask: NDArray[np.bool_] | None,
    ) -> F32:
        """Rows of the image in a light; only samples in the mask are shaded, None: all. (n, 3)"""
        images, material, _ = self.target
        num, transient = material.num_samples, images.cache.transient
        partial_image = transient.get(
            (*key, _PARTIAL_SUFFIX), PartialImage, self.num_bytes, lambda: PartialImage.empty(num)
        )
        partial_image.shade(
            self.term,
            self.bands,
            *images.incident_light(material, light, is_canceled),
            progress,
            is_canceled,
            sample_mask,
        )
        return partial_image.rows

    def _report(self, progress: ProgressCallback, done: int, fraction: float) -> None:
        """Report the progress of one component as a fraction of all components."""
        progress((done + fraction) / max(1, len(self.light_components)))

    def shade_samples(
        self, sample_mask: Shaped[NDArray[np.bool_], " n"], progress: ProgressCallback, is_canceled: CancelCheck
    ) -> Shaped[F32, "n 3"]:
        """Shade only the samples of a mask; the other rows are undefined. Partial results are cached.

        Args:
            sample_mask: samples of the material. progress, is_canceled: as in `run`.
        """
        if len(self.light_components) < 2:
            return self._partial_rows(self.key, self.light, progress, is_canceled, sample_mask)
        total, num = np.zeros((len(sample_mask), 3), np.float32), len(sample_mask)
        for done, (key, light, gain) in enumerate(self.light_components):
            cached = self.target.images.cache.get_cached(key, ShadedTerm)
            report = partial(self._report, progress, done)
            rows = (
                self._partial_rows(key, light, report, is_canceled, sample_mask) if cached is None else cached.rows(num)
            )
            total += np.array(gain, np.float32) * rows
        return total

    def install(self, result: ShadedTerm) -> None:
        """See `Job`; an image of older curves is shown if there is no other, since a drag may rarely pause."""
        images, material, live = self.target
        if not self.target.exists() or (live.model, live.light) != (self.model, self.light):
            return
        is_current = self.key == images.image_key(material, live, self.light)
        if not live.is_converged or (is_current and (not live.is_exact() or live.ready.rounding > 0)):
            basis = live.ready.basis  # an active edit continues from here
            coefficients = None if basis is None else basis.coefficients(self.bands)
            live.set_ready(
                DisplayedImage(result.image.copy(), Fidelity.EXACT, self.bands, self.light, basis, coefficients)
            )


@dataclass(frozen=True, eq=False)
class Resum:
    """An image that was accumulated in steps, summed again to remove rounding errors.

    Attributes:
        ready: the state after the steps. sum_into: adds the same image, summed once, to zeros.
        rounding: of such a sum, see `DisplayedImage`.
    """

    target: TermTarget
    key: tuple[Hashable, ...]
    ready: DisplayedImage = field(repr=False)
    sum_into: Callable[[F32], object] = field(repr=False)
    rounding: float = 0.0
    is_refinement: bool = True
    state: Literal["precomputing", "shading"] = "shading"
    is_resumable = False

    @property
    def label(self) -> str:
        """Text for the user."""
        return f"{self.target.name}, {self.target.live.term.label}"

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Shaped[F32, "tiles 3 samples"]:
        """See `Job`; the cost is one pass over the summed arrays."""
        image = np.zeros_like(self.ready.image)
        self.sum_into(image)
        progress(1.0)
        return image

    def install(self, result: Shaped[F32, "tiles 3 samples"]) -> None:
        """See `Job`; ignored if another step has been added."""
        live = self.target.live
        if live.ready is self.ready:
            live.set_ready(replace(self.ready, image=result, rounding=self.rounding, fidelity=Fidelity.EXACT))


def weighted_sum(
    start: Shaped[F32, "tiles 3 samples"], weighted_images: Sequence[tuple[F32, Rgb]]
) -> Shaped[F32, "tiles 3 samples"]:
    """Add Σ g R to an image in place (transport is linear in light), and return it.

    Args:
        start: the image, overwritten. weighted_images: images of the same shape, with a gain per channel.
    """
    for image, gain in weighted_images:
        start += np.array(gain, np.float32)[:, None] * image
    return start
