"""Shade the image of a term anew: what no other strategy reaches, and exactly when nobody edits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.live_term import LiveTerm
from relume.live.fixed_camera.strategies import operator, sparse_preview
from relume.live.fixed_camera.strategies.shading import Shading
from relume.live.fixed_camera.strategies.sparse_preview import SparsePreview
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency
from relume.live.fixed_camera.view_images import TermTarget
from relume.operators.edit_basis import EditBasis
from relume.transport.roughness_ranges import contract_levels
from relume.views.view import Tile

F32 = NDArray[np.float32]

_MIN_HIDDEN_SAMPLES = 20_000  # samples outside the region; with fewer, an extra frame does not pay off


def _image_job(situation: Situation) -> Job | None:
    """Return a job for a term whose image differs from the target and has no operator that updates it.

    Visible terms that are not exact come first; among them those of the edited material, and cheap ones.
    """
    candidates, region = list(operator.missing_images(situation)), situation.images.region
    if not candidates:
        return None

    def rank(item: tuple[TermTarget, EditBasis | None]) -> tuple[int, ...]:
        target, basis = item
        return not target.is_visible(region) or target.is_exact_within(region), *_cost(target, basis, situation)

    target, basis = min(candidates, key=rank)
    form = None if basis is None else operator.form_of(target, basis)
    if basis is not None and form is not None:
        return operator.job_for(target, basis, form)
    # if no operator fits, the image of older curves remains until the drag ends
    can_wait = target.live.is_converged or target.live.has_preview()
    priority = Priority.REFINEMENT if can_wait else Priority.IMAGE
    to_shade = [candidate for candidate, basis in candidates if basis is None]
    whole = Shading.for_target(target, situation.images.light)
    return _early_job(situation, whole, to_shade, priority) or whole.job(priority)


def _early_job(
    situation: Situation, whole: Shading, candidates: Sequence[TermTarget], priority: Priority
) -> Job | None:
    """Return a job that shows a costly term sooner: its visible region, or a finer preview of all costly terms.

    candidates: terms to be shaded, including that of `whole`.
    """
    ready, detail = whole.target.live.ready, whole.target.live.ready.detail
    region = _early_region(whole, candidates, situation.images.region)
    region_job = None if region is None else _region_job(whole, region, priority)
    if ready.fidelity != Fidelity.PREVIEW or ready.light != whole.light:
        return region_job
    costly = [target for target in candidates if _needs_angles(target) and target.live.ready.detail == detail]
    if whole.target not in costly:
        return region_job
    num_left = sum(
        target.material.num_samples if region is None else int(target.material.lies_in(region).sum())
        for target in costly
    )
    if not sparse_preview.is_finer_worthwhile(num_left, detail):
        return region_job
    finer = SparsePreview.for_targets(situation.images, costly, whole.light, detail + 1)
    return finer.job("a preview", situation.on_preview, priority)


def _early_region(whole: Shading, candidates: Sequence[TermTarget], region: Tile | None) -> Tile | None:
    """Return the visible region if it is shaded first; None if the complete image is shaded at once.

    If a large image is zoomed or exceeds its window, most samples are not visible. Partial results are cached, so the
    complete image costs no more.
    """
    images, material, live = target = whole.target
    # samples of a narrow lobe are split by the complete image
    if region is None or live.lobe is not None or target.is_exact_within(region) or not _allows_partial(live):
        return None
    num_visible = np.count_nonzero(material.lies_in(region))
    if images.is_cached(material, live) or not 0 < num_visible < material.num_samples:
        return None
    num_hidden = sum(np.count_nonzero(~candidate.material.lies_in(region)) for candidate in candidates)
    return region if num_hidden > _MIN_HIDDEN_SAMPLES else None


def _allows_partial(live: LiveTerm) -> bool:
    """Return whether a part of the newest image may be replaced: no steps are added to it, and its light is current."""
    return not live.is_converged and live.ready.light == live.light


def _region_job(whole: Shading, region: Tile, priority: Priority) -> Job:
    """Return the job that shades the samples of a term in a region; its result is rows of the image, valid there."""
    images, material, live = target = whole.target

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> F32:
        return whole.shade_samples(material.lies_in(region), progress, is_canceled)

    def apply(rows: F32) -> None:
        is_current = target.exists() and whole.key == images.image_key(material, live, live.light)
        if is_current and _allows_partial(live):
            image = live.ready.with_samples(rows, material.lies_in(region))
            live.set_ready(replace(live.ready, image=image, exact_region=(whole.key, region)))

    return Job(("region", region, *whole.key), whole.label, priority, run, apply, is_resumable=True)


def _refinement_job(situation: Situation) -> Job | None:
    """Return a job that shades a nearly exact image."""
    for target in situation.targets:
        live = target.live
        if live.is_converged and not live.changed_curves() and not live.is_exact():
            return Shading.for_target(target, situation.images.light).job(Priority.REFINEMENT)
    return None


def _cost(target: TermTarget, basis: EditBasis | None, situation: Situation) -> tuple[bool, bool, int]:
    """Sort key of jobs: terms with only flat curves are cheap, since evaluating angles takes nearly all the time."""
    prepared = situation.control.prepared_control
    is_other_material = prepared is None or prepared.target.material is not target.material
    return is_other_material, basis is not None or _needs_angles(target), target.material.num_samples


def _needs_angles(target: TermTarget) -> bool:
    """Return whether a term has a curve that is not flat."""
    return any(c.kinds.size for c in contract_levels(target.live.term, target.live.target_bands, None))


SHADE = Strategy(
    name="shade",
    needs="view samples",
    cost="nothing; its job contracts all curves at every sample",
    fidelity=Fidelity.EXACT,
    jobs={Urgency.IMAGE: _image_job, Urgency.REFINEMENT: _refinement_job},
)
