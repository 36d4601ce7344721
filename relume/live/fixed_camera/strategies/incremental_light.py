"""Incremental light updates: reference image + transport rows · ΔL + direct light of moved lights, per term.

An edit of a diffuse color or of the number of bounces changes only the outgoing radiance of patches; an edit of a local
light also changes its direct light. The rows of all terms are precomputed when such a control is prepared (after the
image has converged) or first edited. From then on each frame shows the last exact image plus the change. It is never
labeled exact: when the drag ends, everything that has changed is shaded.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, element_gains, is_same_environment, single_source
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback, ignore_result
from relume.live.fixed_camera.strategies import linear_mix
from relume.live.fixed_camera.strategies.moved_lights import MovedLights
from relume.live.fixed_camera.strategies.shading import Shading
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency, smallest_material
from relume.live.fixed_camera.view_images import OutgoingChange, TermTarget, ViewImages
from relume.math.haar import haar
from relume.operators.indirect import IndirectOperator, expected_light, num_channels, precompute_rows, row_bytes
from relume.operators.shade import shaded_bytes
from relume.transport.outgoing_patch_light import isotropic

F32 = NDArray[np.float32]


def can_follow(situation: Situation) -> bool:
    """Return whether transport rows can bring every term to the target light, and gains alone cannot."""
    light, unconverged = situation.images.light, situation.unconverged
    is_reached = all(_is_applicable(target, light) for target in unconverged)
    is_moved = any(not linear_mix.is_applicable(target, light) for target in unconverged)
    return bool(unconverged) and is_reached and is_moved and _fits_budget(situation.images)


def _is_applicable(target: TermTarget, light: Illumination) -> bool:
    """Return whether the reference image of a term differs only in local lights and indirect light."""
    reference = target.live.ready.reference
    return (
        target.live.needs_only_light()
        and reference is not None
        and reference.light is not None
        and is_same_environment(reference.light, light)
    )


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    has_rows = target.images.transfer.indirect is None or _rows(target) is not None
    return has_rows and _is_applicable(target, light)


def _fits_budget(images: ViewImages) -> bool:
    """Return whether all needed rows fit half of the memory budget."""
    if images.transfer.indirect is None:
        return True
    needed = sum(row_bytes(m.num_samples, num_channels(t.term, t.target_bands)) for m, t in images.terms())
    return 2 * needed <= images.cache.budget_bytes


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    live, images = target.live, target.images
    reference, rows, moved_lights = live.ready.reference, _rows(target), MovedLights(images)
    if reference is None or reference.light is None:
        return
    image = live.ready.image  # only the picture's own state refers to it
    np.copyto(image, reference.image)
    moved_lights.add_change(target, reference.light, light, image)
    if rows is not None:
        change = _outgoing_change(images, reference.light, light)
        rows.add(change.coefficients, image)
        if change.mirrors is not None:
            mirror_bits = images.transfer.mirror_lights_of(images.view, target.material.index)
            if mirror_bits is not None:
                moved_lights.add_mirror_lights(target, change.mirrors.rays(mirror_bits), image)
    live.set_ready(replace(live.ready, image=image, fidelity=Fidelity.INCREMENTAL, bands=reference.bands, light=light))


def _outgoing_change(images: ViewImages, before: Illumination, after: Illumination) -> OutgoingChange:
    """Return the change of patch radiance and of mirror lights, computed once a frame."""
    last = images.outgoing_change
    if last is None or (last.before, last.after) != (before, after):
        indirect = images.transfer.indirect
        assert indirect is not None
        change = indirect.preview_delta(before, after)
        mirrors = images.transfer.mirror_lights_delta(before, after)
        change_in_highlights = change if mirrors is None else change - mirrors.patch_radiance
        coefficients = haar(change_in_highlights).astype(np.float32)
        images.outgoing_change = last = OutgoingChange(before, after, coefficients, mirrors)
    return last


def _rows_key(target: TermTarget) -> tuple[Hashable, ...]:
    images, material, live = target
    return images.transfer.key, *images.view.sample_key(material.index), "rows", live.model, *live.target_rows_key


def _rows(target: TermTarget) -> IndirectOperator | None:
    return target.images.cache.get_cached(_rows_key(target), IndirectOperator)


def _rows_job(situation: Situation) -> Job | None:
    """Return the next missing rows, of the material with the fewest samples first; None if there are none.

    A term whose own curve moves would need other rows after each edit, so it is skipped.
    """
    if situation.images.transfer.indirect is None:
        return None
    extensible = (t for t in situation.targets if t.live.is_converged or t.live.needs_only_light())
    return smallest_material((t, _rows_job_of(t) if _rows(t) is None else None) for t in extensible)


def _rows_job_of(target: TermTarget) -> Job:
    """Return the job for the operator from the outgoing radiance of patches to the image of a term.

    The rows serve any similar light, so they can be precomputed before it changes.
    """
    images, material, live = target
    term, bands, light, key = live.term, live.target_bands, images.light, _rows_key(target)

    def precompute(progress: ProgressCallback, is_canceled: CancelCheck) -> IndirectOperator:
        indirect = images.transfer.indirect
        assert indirect is not None
        radiance, view = indirect.preview(light), images.view
        receivers, rays = (
            view.receivers(material.index, is_lit=False),
            view.gather_rays(material.index, isotropic(radiance)),
        )
        expected = expected_light(radiance[: indirect.num_patches])
        return precompute_rows(term, bands, receivers, rays, expected, progress, is_canceled)

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> IndirectOperator:
        num_bytes = row_bytes(material.num_samples, num_channels(term, bands))
        return images.cache.get(key, IndirectOperator, num_bytes, lambda: precompute(progress, is_canceled))

    label = f"{target.name}, indirect light"
    return Job(("rows", *key), label, Priority.CONTROL, run, ignore_result, state="precomputing")


def _dragged_light_job(situation: Situation) -> Job | None:
    """Return the next rows if the light changes during a drag and only rows can follow it."""
    return _rows_job(situation) if situation.control.edits_light and can_follow(situation) else None


def _prefetch_job(situation: Situation) -> Job | None:
    """Return the next rows for the dragged light, or else the next image of it."""
    can_prefetch = situation.control.edits_light and _fits_budget(situation.images)
    return (_rows_job(situation) if can_prefetch else None) or _source_image_job(situation)


def _source_image_job(situation: Situation) -> Job | None:
    """Return the job for an image of the dragged light, of the material with the fewest samples first.

    The direct image is subtracted when the light moves; the complete image serves changes of its gain. None if the
    light has moved already, or if the memory budget is used up.
    """
    images, targets = situation.images, situation.targets
    dragged = situation.control.dragged_light(situation.look)
    if dragged is None or all(source.geometry != dragged for source in images.light.local):
        return None
    elements = list(element_gains(single_source(images.light, dragged)))  # direct light comes first
    missing = [(e, t) for e in elements for t in targets if images.image_in(t.material, t.live, e) is None]
    num_bytes = sum(shaded_bytes(target.material.num_samples) for _, target in missing)
    if not missing or num_bytes > images.cache.budget_bytes - images.cache.used_bytes:
        return None
    element, target = min(missing, key=lambda item: (elements.index(item[0]), item[1].material.num_samples))
    return Shading.for_target(target, element).job(Priority.REFINEMENT)


INCREMENTAL_LIGHT = Strategy(
    name="incremental light",
    needs="transport rows of all terms; the reference image",
    cost="rows · ΔL, and the moved lights at all samples",
    fidelity=Fidelity.INCREMENTAL,
    changes_light=True,
    is_ready=_is_ready,
    update=_update,
    jobs={Urgency.DRAGGED_LIGHT: _dragged_light_job, Urgency.PREFETCH: _prefetch_job},
)
