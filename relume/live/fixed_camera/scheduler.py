"""Chooses the update strategy per frame: the one of highest fidelity that needs no further jobs.

Jobs for better strategies run in this order: incremental light updates, terms without an image, the prepared control,
refinement of a converged image, prefetching.

A picture shows one light at a time. After a change of light, images of terms become ready one after another; until all
of them are in one light, the picture shows the previous light with its background, emissive surfaces and gain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from relume.live.fixed_camera.active_control import ActiveControl
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, element_gains, single_source
from relume.live.fixed_camera.jobs import Job, PrecomputeOperator, Shade, TermTarget, can_resume_from
from relume.live.fixed_camera.operator_budget import EXACT, MERGED_LIGHT, operator_form, use_coarse
from relume.live.fixed_camera.priority_region import is_exact_within, is_visible, make_region_job
from relume.live.fixed_camera.strategies import operator, texel_sum
from relume.live.fixed_camera.strategies.base import LightStrategy
from relume.live.fixed_camera.strategies.cached_image import CachedImage
from relume.live.fixed_camera.strategies.incremental_light import IncrementalLight
from relume.live.fixed_camera.strategies.linear_mix import LinearMix
from relume.live.fixed_camera.strategies.sparse_preview import (
    SparsePreview,
    can_preview,
    is_needed_for_first_frame,
    is_prepared,
    should_refine,
)
from relume.live.fixed_camera.view_images import ViewImages
from relume.look import Look
from relume.look.model import Rgb
from relume.operators.edit_basis import CurveBasis, EditBasis
from relume.operators.linear_operator import Compression
from relume.operators.shade import shaded_bytes
from relume.transport.roughness_ranges import contract_levels


class StrategyScheduler:
    """The scheduler of one picture.

    Attributes:
        light: the displayed illumination. gain: of the finished image.
    """

    def __init__(self, images: ViewImages, *, is_watched: bool) -> None:
        self._images, self._is_watched = images, is_watched
        self._linear_mix, self._incremental = LinearMix(), IncrementalLight(images)
        # highest fidelity first; at equal fidelity the cheapest first
        self._strategies: Sequence[LightStrategy] = (CachedImage(), self._linear_mix, self._incremental)
        self._previewed: tuple[Illumination, Rgb] | None = None
        self.light, self.gain = images.light, images.gain
        images.set_emission(self.light)

    def adopt(self, images: ViewImages) -> None:
        """Continue with other images of the same picture, some of whose samples are in another order."""
        self._images, self._incremental, self._previewed = images, IncrementalLight(images), None
        self._strategies = (CachedImage(), self._linear_mix, self._incremental)
        images.set_emission(self.light)

    # displayed images

    def advance(self, max_coefficients: int | None) -> None:
        """Update every term as close to its target as possible now."""
        for target in self._targets():
            texel_sum.step(target)
        self._change_light()
        for target in self._targets():
            if not target.live.is_exact():
                operator.step(target, max_coefficients)

    def install(self, job: Job, result: object) -> None:
        """Install the result of a job."""
        job.install(result)
        if isinstance(job, SparsePreview):
            self._previewed = job.light, job.gain
        self._change_light()

    def _change_light(self) -> None:
        """Update terms to the target light if all can be updated; else update those that can to the preview's light."""
        target_light = self._images.light
        unconverged = self._unconverged_targets()
        outdated = [p for p in unconverged if not p.live.is_empty and p.live.ready.light != target_light]
        if all(self._best_strategy(target, target_light) for target in outdated):
            self._apply_strategies(unconverged, target_light)
        elif self._previewed is not None and any(p.live.ready.light == self._previewed[0] for p in unconverged):
            self._apply_strategies(unconverged, self._previewed[0])
        self._display_latest()

    def _apply_strategies(self, unconverged: Iterable[TermTarget], light: Illumination) -> None:
        for target in unconverged:
            strategy, ready = self._best_strategy(target, light), target.live.ready
            if strategy is not None and (ready.light != light or ready.fidelity < strategy.fidelity):
                strategy.evaluate(target, light)

    def _best_strategy(self, target: TermTarget, light: Illumination) -> LightStrategy | None:
        """Return the best strategy that can update a term to a light at once; None if its curves would not be exact."""
        if not target.live.needs_only_light():
            return None
        target_light = self._images.light
        allowed = (r for r in self._strategies if light == target_light or r.fidelity < Fidelity.NEARLY_EXACT)
        return next((r for r in allowed if r.applicable(target, light) and not r.prepare(target, light)), None)

    def _display_latest(self) -> None:
        """Display every term's newest image, if all images are in one light; empty terms do not count."""
        images, before = self._images, self.light
        lit = {target.live.latest.light for target in self._targets() if not target.live.is_empty}
        if lit <= {images.light}:
            self.light, self.gain, self._previewed = images.light, images.gain, None
        elif self._previewed is not None and lit == {self._previewed[0]}:
            self.light, self.gain = self._previewed
        else:
            return
        for target in self._targets():
            target.live.display_ready()
        if self.light != before:
            images.set_emission(self.light)

    # jobs

    def next_job(self, control: ActiveControl, look: Look) -> Job | None:
        """Return the most urgent job; None if nothing is missing. control: the active one. look: the current one."""
        stages: Sequence[Callable[[ActiveControl], Job | None]] = (
            self._changed_light_job, self._preview_job, self._element_job, self._missing_image_job, self._prepared_job,
            self._exact_operator_job,
        )  # fmt: skip
        for stage in stages:
            job = stage(control)
            if job is not None:
                return job
        return self._refinement_job() or self._prefetch_job(control, look)

    def _changed_light_job(self, control: ActiveControl) -> Job | None:
        """Return the next rows if the light changes during a drag and only rows can follow it."""
        if not control.edits_light or not self._needs_incremental():
            return None
        return self._rows_job()

    def _preview_job(self, control: ActiveControl) -> Job | None:
        """Return a preview if the target light differs or the picture opens, or to select samples before a rotation."""
        images = self._images
        if self._needs_preview(control):
            is_opening = all(target.live.is_empty for target in self._targets())
            missing = [
                target for target in self._unconverged_targets() if self._best_strategy(target, images.light) is None
            ]
            whole = SparsePreview.for_targets(images, missing, "a preview" if is_opening else "the light")
            paths = images.light.paths
            return whole.direct_only_first() if is_opening and paths.direct and paths.has_indirect else whole
        outdated = [p for p in self._targets() if p.live.displays_outdated and not images.is_cached(p.material, p.live)]
        if outdated and self._is_watched and can_preview(images):
            return SparsePreview.for_targets(images, outdated, "what was changed")
        if control.rotates_environment and can_preview(images) and not is_prepared(images):
            return SparsePreview.for_targets(images, self._targets(), "the light")
        return None

    def _needs_preview(self, control: ActiveControl) -> bool:
        images = self._images
        if all(target.live.is_empty for target in self._targets()):
            return self._is_watched and is_needed_for_first_frame(images)
        if self.light == images.light or not can_preview(images):
            return False
        is_immediate = all(
            self._best_strategy(target, images.light) is not None for target in self._unconverged_targets()
        )
        return not is_immediate and not (control.edits_light and self._needs_incremental())

    def _needs_incremental(self) -> bool:
        """Return whether transport rows can bring every term to the target light, and gains alone cannot."""
        target_light, incremental = self._images.light, self._incremental
        unconverged = self._unconverged_targets()
        is_reached = all(p.live.needs_only_light() and incremental.applicable(p, target_light) for p in unconverged)
        is_moved = any(not self._linear_mix.applicable(target, target_light) for target in unconverged)
        return bool(unconverged) and is_reached and is_moved and incremental.fits_budget()

    def _element_job(self, control: ActiveControl) -> Job | None:
        """Return the job for a missing image of a light element, of the material with the fewest samples first."""
        unconverged = (target for target in self._targets() if target.live.needs_only_light())
        return _first_missing_job(self._linear_mix, unconverged, self._images.light)

    def _missing_image_job(self, control: ActiveControl) -> Job | None:
        """Return a job for a term whose image differs from the target and has no operator that updates it.

        Visible terms that are not exact come first; among them those of the edited material, and cheap ones.
        """
        candidates, region = list(self._missing_bases(control)), self._images.region
        if not candidates:
            return None

        def rank(item: tuple[TermTarget, EditBasis | None]) -> tuple[int, ...]:
            target, basis = item
            return not is_visible(target, region) or is_exact_within(target, region), *_cost(target, basis, control)

        target, basis = min(candidates, key=rank)
        form = None if basis is None else self._form(target, basis)
        if basis is not None and form is not None:
            return self._operator_job(target, basis, form)
        # if no operator fits, the image of older curves remains until the drag ends
        whole = Shade.for_target(
            target, self._images.light, is_refinement=target.live.is_converged or target.live.has_preview()
        )
        return self._early_job(whole, [candidate for candidate, basis in candidates if basis is None]) or whole

    def _early_job(self, whole: Shade, candidates: Sequence[TermTarget]) -> Job | None:
        """Return a job that shows a costly term sooner: its visible region, or a finer preview of all costly terms.

        candidates: terms to be shaded, including that of `whole`.
        """
        region_job = make_region_job(whole, candidates, self._images.region)
        own_target = whole.target
        detail = own_target.live.ready.detail
        if own_target.live.ready.fidelity != Fidelity.PREVIEW or own_target.live.ready.light != whole.light:
            return region_job
        costly = [target for target in candidates if _needs_angles(target) and target.live.ready.detail == detail]
        if own_target not in costly:
            return region_job
        num_left = sum(target.material.num_samples for target in costly)
        if region_job is not None:
            num_left = sum(np.count_nonzero(p.material.lies_in(region_job.region)) for p in costly)
        if not should_refine(num_left, detail):
            return region_job
        return SparsePreview.for_targets(self._images, costly, "a preview").with_detail(
            detail + 1, is_refinement=whole.is_refinement
        )

    def _missing_bases(self, control: ActiveControl) -> Iterator[tuple[TermTarget, EditBasis | None]]:
        for target in self._targets():
            live = target.live
            changed = set(live.changed_curves())
            basis = control.edit_basis(live, changed)
            if not live.is_converged:
                # its operator along a curve gives the image as well, and exactly
                is_whole = basis is not None and basis.is_complete and self._form(target, basis) == EXACT
                yield target, basis if is_whole else None
            elif changed and not self._continues_with_operator(target, basis):
                first = next(name for name in live.target_bands if name in changed)
                new_basis = basis or CurveBasis.from_curve(live.term.curve(first))
                yield target, new_basis if self._reaches_target(target, new_basis, changed) else None

    def _form(self, target: TermTarget, basis: EditBasis) -> Compression | None:
        """Return the operator form that fits the memory budget; None: the term is shaded instead."""
        return operator_form(target.material, basis.num_columns, self._images.cache.budget_bytes)

    def _reaches_target(self, target: TermTarget, basis: EditBasis, changed: set[str]) -> bool:
        """Return whether an operator would reach the target; a subsampled one excludes changes of other curves."""
        form = self._form(target, basis)
        return form is not None and (form.step == 1 or can_resume_from(target.live.ready, changed, basis))

    def _continues_with_operator(self, target: TermTarget, basis: EditBasis | None) -> bool:
        """Return whether the active operator should be reused: it covers some changed curves, and no other basis is
        better.
        """
        live = target.live
        active, changed = live.ready.basis, set(live.changed_curves())
        if active is None or changed.isdisjoint(active.affected_curves):
            return False
        if self._images.operator(target.material, live) is None:
            return False
        return changed <= set(active.affected_curves) or basis is None or not changed <= set(basis.affected_curves)

    def _prepared_job(self, control: ActiveControl) -> Job | None:
        """Return the operator job for the prepared control.

        A parameter whose only curve has a complete operator needs no other: that operator is exact.
        """
        prepared = control.prepared_control
        if prepared is None or not prepared.target.material.num_samples:
            return None
        if prepared.basis is None:
            return texel_sum.job_for(prepared.target)
        live, basis, active = prepared.target.live, prepared.basis, prepared.target.live.ready.basis
        form = self._form(prepared.target, basis)
        if live.changed_curves() or form is None:
            return None
        has_operator = active is not None and self._images.operator(prepared.target.material, live) is not None
        is_enough = active is not None and (
            active == basis or (active.is_complete and active.affected_curves == basis.affected_curves)
        )
        return None if has_operator and is_enough else self._operator_job(prepared.target, basis, form)

    def _exact_operator_job(self, control: ActiveControl) -> Job | None:
        """Return the job for the exact operator of a term with a coarse one; frames continue meanwhile."""
        for target in self._targets():
            basis, active = target.live.ready.basis, self._images.operator(target.material, target.live)
            if basis is not None and active is not None and active.has_merged_lights:
                return PrecomputeOperator.for_target(target, basis, EXACT)
        return None

    def _operator_job(self, target: TermTarget, basis: EditBasis, form: Compression) -> PrecomputeOperator:
        """Return an operator job; a coarse operator comes first if the exact one takes long and the edit can use it."""
        images, (_, material, live) = self._images, target
        if form != EXACT or images.cache.contains(images.operator_key(material, live, basis, live.target_bands)):
            return PrecomputeOperator.for_target(target, basis, form)
        lights = images.transfer.num_lights if live.light.has_direct_environment else 0
        is_merged_first = use_coarse(material, basis.num_columns, lights, images.cache.budget_bytes)
        can_go_on = can_resume_from(live.ready, live.changed_curves(), basis)
        return PrecomputeOperator.for_target(target, basis, MERGED_LIGHT if is_merged_first and can_go_on else form)

    def _refinement_job(self) -> Job | None:
        """Return a job that makes a nearly exact image exact."""
        for target in self._targets():
            live = target.live
            if live.is_converged and not live.changed_curves():
                job = self._resum_job(target) if live.ready.rounding > 0 else None
                if job is None and live.ready.fidelity < Fidelity.EXACT:
                    job = Shade.for_target(target, self._images.light, is_refinement=True)
                if job is not None:
                    return job
        return None

    def _resum_job(self, target: TermTarget) -> Job | None:
        """Return the job that resums an image that was accumulated in steps."""
        return self._linear_mix.resum_job(target) if target.live.ready.basis is None else operator.resum_job(target)

    def _prefetch_job(self, control: ActiveControl, look: Look) -> Job | None:
        """Return a job that prefetches results for the active control, if nothing else is missing."""
        if control.edits_light and self._incremental.fits_budget():
            rows_job = self._rows_job()
            if rows_job is not None:
                return rows_job
        return self._dragged_light_job(control, look)

    def _rows_job(self) -> Job | None:
        """Return the next missing rows, of the material with the fewest samples first; None if there are none.

        A term whose own curve moves would need other rows after each edit, so it is skipped.
        """
        extensible = (p for p in self._targets() if p.live.is_converged or p.live.needs_only_light())
        return _first_missing_job(self._incremental, extensible, self._images.light)

    def _dragged_light_job(self, control: ActiveControl, look: Look) -> Job | None:
        """Return the job for an image of the dragged light, of the material with the fewest samples first; lowest
        priority.

        The direct image is subtracted when the light moves; the complete image serves changes of its gain. None if the
        light has moved already, or if the memory budget is used up.
        """
        images = self._images
        dragged = control.dragged_light(look)
        if dragged is None or all(source.geometry != dragged for source in images.light.local):
            return None
        elements = list(element_gains(single_source(images.light, dragged)))  # direct light comes first
        targets = list(self._targets())
        missing = [(e, p) for e in elements for p in targets if images.image_in(p.material, p.live, e) is None]
        num_bytes = sum(shaded_bytes(target.material.num_samples) for _, target in missing)
        if not missing or num_bytes > images.cache.budget_bytes - images.cache.used_bytes:
            return None
        element, target = min(missing, key=lambda item: (elements.index(item[0]), item[1].material.num_samples))
        return Shade.for_target(target, element, is_refinement=True)

    def _targets(self) -> Iterator[TermTarget]:
        """Yield all terms that are visible in this view."""
        return (TermTarget(self._images, material, live) for material, live in self._images.terms())

    def _unconverged_targets(self) -> list[TermTarget]:
        """Return the terms without a converged image in the target light."""
        return [target for target in self._targets() if not target.live.is_converged]


def _first_missing_job(strategy: LightStrategy, targets: Iterable[TermTarget], light: Illumination) -> Job | None:
    """Return the first job that a strategy needs, of the material with the fewest samples first."""
    missing = [(target, jobs[0]) for target in targets if (jobs := strategy.prepare(target, light))]
    return min(missing, key=lambda item: item[0].material.num_samples)[1] if missing else None


def _cost(target: TermTarget, basis: EditBasis | None, control: ActiveControl) -> tuple[bool, bool, int]:
    """Sort key of jobs: terms with only flat curves are cheap, since evaluating angles takes nearly all the time."""
    prepared = control.prepared_control
    is_other_material = prepared is None or prepared.target.material is not target.material
    return is_other_material, basis is not None or _needs_angles(target), target.material.num_samples


def _needs_angles(target: TermTarget) -> bool:
    """Return whether a term has a curve that is not flat."""
    return any(c.kinds.size for c in contract_levels(target.live.term, target.live.target_bands, None))
