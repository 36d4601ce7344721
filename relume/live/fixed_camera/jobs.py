"""What a picture needs made before it can go on: found by looking, made in any thread, installed by the picture's user.

All that `make` reads was fixed when the job was found: the picture may be changed while it runs, and `install` looks
whether what was made is still wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from relume.brdf.term import Term
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, split_for_shading
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.operator_budget import OperatorForm, precompute_subsampled
from relume.live.fixed_camera.texel_light_cache import is_cacheable, put_texel_light
from relume.live.fixed_camera.view_images import MERGED_LIGHT_SUFFIX, ViewImages
from relume.look.model import Rgb
from relume.operators.edit_basis import EditBasis
from relume.operators.linear_operator import LinearOperator, MergedLightOperator
from relume.operators.operator import Operator
from relume.operators.quantized import QuantizedOperator
from relume.operators.shade import PartialImage, ShadedTerm, shaded_bytes
from relume.transport.shading_points import ShadingPoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
_PARTIAL_SUFFIX = "begun"  # ends the names of images of which some is shaded
ProgressCallback = Callable[[float], None]
CancelCheck = Callable[[], bool]


class Job(Protocol):
    """Something to be made.

    Attributes:
        label: in words. key: equal keys are the same job.
        state: what making it is called; what follows a hand takes a few frames, and nobody is told of it.
        is_refinement: the picture is near its look without it, so that it can wait until the hand rests.
        is_resumable: what is made of it is kept where it is cancelled.
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
        """Make it, unless the cache has it.

        Raises ResultUnavailableError where what is shown can stay, CancelledError where `is_canceled`, asked now and
        then, said so.
        """
        ...

    def install(self, result: Any) -> None:
        """Go on with what `make` returned, unless the look has moved on to where it is of no use."""
        ...


class LightComponent(NamedTuple):
    """Of a light. key: of the image in it alone. gain: how much of it there is, of each channel."""

    key: tuple[Hashable, ...]
    light: Illumination
    gain: Rgb


class TermTarget(NamedTuple):
    """A term of a picture: where it is, and the one that was there when a job was found."""

    images: ViewImages
    material: MaterialImage
    live: LiveTerm

    @property
    def name(self) -> str:
        """The material's."""
        return self.images.transfer.material_names[self.material.index]

    def exists(self) -> bool:
        """Whether the look still has this term."""
        return any(self.live is term for term in self.material.terms)


@dataclass(frozen=True, eq=False)
class PrecomputeOperator:
    """The operator of a term along what an edit moves, everything else dormant (eq. 22, Ben-Artzi 2006).

    Attributes:
        bands: of the term's curves, (3, J) each. light: what arrives.
        form: what it is made of.
    """

    target: TermTarget
    basis: EditBasis
    key: tuple[Hashable, ...]
    term: Term
    bands: Mapping[str, F64]
    light: Illumination
    form: OperatorForm
    is_refinement: bool
    state: Literal["precomputing", "shading"] = "precomputing"
    is_resumable = False

    @classmethod
    def for_target(cls, target: TermTarget, basis: EditBasis, form: OperatorForm) -> PrecomputeOperator:
        """The operator for what is wanted of a term now.

        Args:
            target: of the term. basis: what is free in it. form: from `operator_form`.
        """
        images, material, live = target
        key = images.operator_key(material, live, basis, live.target_bands, is_merged_light=form.is_merged_light)
        is_refinement = live.has_preview()
        return cls(target, basis, key, live.term, live.target_bands, live.light, form, is_refinement)

    @property
    def label(self) -> str:
        """In words."""
        return f"{self.target.name}, {self.basis.label}"

    @property
    def num_bytes(self) -> int:
        """Memory to keep it."""
        return self.form.num_bytes(self.target.material, self.basis.num_columns)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Operator:
        """See `Job`."""
        images, material, _ = self.target

        def build_operator() -> Operator:
            lights, receivers = images.incident_light(material, self.light, is_canceled)

            def precompute_samples(subset: ShadingPoints) -> LinearOperator | QuantizedOperator:
                callbacks = progress, is_canceled
                return self.basis.precompute(
                    self.term, self.bands, lights, subset, *callbacks, is_quantized=self.form.is_quantized
                )

            if self.form.is_merged_light:
                lights = images.transfer.clustered_lights(self.light)
                return MergedLightOperator(**vars(precompute_samples(receivers)))
            if self.form.step == 1:
                return precompute_samples(receivers)
            return precompute_subsampled(images.view, material.index, self.form.step, receivers, precompute_samples)

        return images.cache.get(self.key, Operator, self.num_bytes, build_operator)  # type: ignore[type-abstract]

    def install(self, result: Operator) -> None:
        """See `Job`; the dormant curves of the operator must be those that are wanted now.

        Where the image shows other curves, or the operator can say them better, it is summed anew. An operator that is
        not exact goes on from the image as it is, if that differs in nothing else.
        """
        images, material, live = self.target
        is_merged_light = self.form.is_merged_light
        if not is_merged_light:
            images.cache.evict((*self.key, MERGED_LIGHT_SUFFIX))
        current_key = images.operator_key(
            material, live, self.basis, live.target_bands, is_merged_light=is_merged_light
        )
        if not self.target.exists() or self.key != current_key:
            return
        ready, changed = live.ready, set(live.changed_curves())
        # its coefficients hold, also where only some were moved
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
    """Whether changes along a basis may be added to what is ready: its curves are known, and no other one differs.

    Args:
        ready: of a term. changed: curves whose target is not summed in it. basis: of an operator.
    """
    has_curves = all(not np.isnan(ready.bands.get(name, np.nan)).any() for name in basis.affected_curves)
    return ready.is_converged and has_curves and set(changed) <= set(basis.affected_curves)


@dataclass(frozen=True, eq=False)
class Shade:
    """The image of a term's target in some light, from nothing: what every route to EXACT must agree with.

    Attributes:
        model: of the term. bands: of its curves, (3, J) each. light_components: that the light is the sum of.
        is_default: the look is the scene's own, whose images stay beside the store.
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
        """Shade the term of a target in some light.

        is_refinement: whether it can wait; None: where the term can be seen without it.
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
        """In words."""
        return f"{self.target.name}, {self.term.label}"

    @property
    def num_bytes(self) -> int:
        """Memory to keep it."""
        return shaded_bytes(self.target.material.num_samples)

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        """See `Job`; kept beside the store as well."""
        images = self.target.images
        image_files = images.transfer.derived if self.is_default else images.transfer.edited
        shape = self.target.live.ready.image.shape

        def shaded() -> ShadedTerm:
            return image_files.get(self.key[1:], shape, lambda: self._sum_components(progress, is_canceled))

        return images.cache.get(self.key, ShadedTerm, self.num_bytes, shaded)

    def _sum_components(self, progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        """Shade the parts of the light that no other image has had, and sum all."""
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
        """The image in a light, from what was begun of it."""
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
        """Rows of the image in a light, those of wanted samples shaded; None: all. (n, 3)"""
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
        """How much of all parts of the light is done with a share of one."""
        progress((done + fraction) / max(1, len(self.light_components)))

    def shade_samples(
        self, sample_mask: NDArray[np.bool_], progress: ProgressCallback, is_canceled: CancelCheck
    ) -> F32:
        """Rows of the same image of which only wanted samples are made; others may be anything. (n, 3)

        Args:
            sample_mask: samples of the material. (n,) progress, is_canceled: as of `make`; what is made is kept.
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
        """See `Job`; an image of older curves is shown where there is none: a hand may not rest for long."""
        images, material, live = self.target
        if not self.target.exists() or (live.model, live.light) != (self.model, self.light):
            return
        is_current = self.key == images.image_key(material, live, self.light)
        if not live.is_converged or (is_current and (not live.is_exact() or live.ready.rounding > 0)):
            basis = live.ready.basis  # a hand that is on something goes on from here
            coefficients = None if basis is None else basis.coefficients(self.bands)
            live.set_ready(
                DisplayedImage(result.image.copy(), Fidelity.EXACT, self.bands, self.light, basis, coefficients)
            )


@dataclass(frozen=True, eq=False)
class Resum:
    """An image that was summed from steps, summed once: at rest, exact is a fact.

    Attributes:
        ready: the state that the steps led to. sum_into: writes the same image, summed once, over zeros.
        rounding: that such a sum leaves, see `DisplayedImage`.
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
        """In words."""
        return f"{self.target.name}, {self.target.live.term.label}"

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> F32:
        """See `Job`; takes as long as reading once what is summed."""
        image = np.zeros_like(self.ready.image)
        self.sum_into(image)
        progress(1.0)
        return image

    def install(self, result: F32) -> None:
        """See `Job`; of no use where another step has been added."""
        live = self.target.live
        if live.ready is self.ready:
            live.set_ready(replace(self.ready, image=result, rounding=self.rounding, fidelity=Fidelity.EXACT))


def weighted_sum(start: F32, weighted_images: Sequence[tuple[F32, Rgb]]) -> F32:
    """Σ g R, added to an image in place: transport is linear in light.

    Args:
        start: (tiles, 3, samples) float32, written. weighted_images: images of the same shape, and the gain of each
            channel.
    """
    for image, gain in weighted_images:
        start += np.array(gain, np.float32)[:, None] * image
    return start
