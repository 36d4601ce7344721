"""Terms in the light before an edit: what other surfaces receive from the edited one follows when the drag ends.

An edit of a curve or a parameter changes the light that the edited surface reflects to all others, and so the light of
every image. If the albedo changes little, each term shows its reference image during the drag, the edited one with its
operator in the light of that reference. Direct light is then exact, and indirect light is that of before. A narrow
lobe, which an operator does not resolve, is ray traced with few rays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.brdf.albedo import max_albedo_change
from relume.brdf.lobe_sampling import lobe_curves
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, equal_up_to_reflectances
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.fixed_camera.protocols import LightQuality, LobeShader
from relume.live.fixed_camera.strategies import operator
from relume.live.fixed_camera.strategies.lobe_image import has_round_narrow_lobe, lobe_image
from relume.live.fixed_camera.strategies.shading import average_split
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency
from relume.live.fixed_camera.view_images import TermTarget
from relume.operators.shade import ShadedTerm, shade

_MAX_ALBEDO_CHANGE = 0.25


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    images, material, live = target
    reference = live.ready.reference
    if reference is None or reference.light is None or not _is_similar(reference.light, light):
        return False
    changed = set(reference.changed_curves(live.target_bands))
    if not changed or _lobe_shader(target, reference) is not None:
        return True
    basis = reference.basis
    if basis is None or not basis.is_valid_for(live.document) or not changed <= set(basis.affected_curves):
        return False
    return images.operator(material, live, reference) is not None


def _is_similar(before: Illumination, after: Illumination) -> bool:
    """Return whether two lights differ only in reflectances, and little: other surfaces would show a larger change."""
    return (
        equal_up_to_reflectances(before, after)
        and before.paths == after.paths
        and [(each.images, each.normals, each.uv) for each in before.reflectances]
        == [(each.images, each.normals, each.uv) for each in after.reflectances]
        and max_albedo_change(before.reflectances, after.reflectances) <= _MAX_ALBEDO_CHANGE
    )


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    images, material, live = target
    reference = live.ready.reference
    assert reference is not None
    state = replace(live.ready, fidelity=Fidelity.APPROXIMATE, light=light)
    if (shader := _lobe_shader(target, reference)) is not None:
        image = lobe_image(target, light, shader, live.document, live.view_factor)
        live.set_ready(replace(state, image=image, bands=live.target_bands, traces_lobe=True))
        return
    if live.keeps_showing(reference):
        live.keep_image(light)
        return
    steps = images.operator(material, live, reference)
    if steps is not None:
        reference = live.mark_lobe(operator.advance(reference, live.target_bands, steps, None))
    np.copyto(state.image, reference.image)  # only the picture's own state refers to it
    live.set_ready(replace(state, bands=reference.bands, reference=reference, traces_lobe=reference.traces_lobe))


def _lobe_shader(target: TermTarget, reference: DisplayedImage) -> LobeShader | None:
    """Return what shows a term by few rays along its narrow lobe; None if an operator shows it without noise."""
    live, shader = target.live, target.images.lobe_shader
    shapes_lobe = {curve.name for curve in lobe_curves(live.document)}
    if shader is None or shader.light != reference.light or not has_round_narrow_lobe(live):
        return None
    is_shaped = not shapes_lobe.isdisjoint(reference.changed_curves(live.target_bands))
    return shader if is_shaped else None


def _preparation_job(situation: Situation) -> Job | None:
    """Return the job that prepares lobe rays if the edited control changes the width of a lobe."""
    prepared, images = situation.control.prepared_control, situation.images
    light, shader = images.light, images.lobe_shader
    if prepared is None or prepared.basis is None or not light.paths.has_indirect:
        return None
    live, is_prepared = prepared.target.live, shader is not None and shader.light == light
    # during a drag, the light of its beginning is needed
    if is_prepared or not live.is_converged or live.ready.light != light or not live.changes_lobe(prepared.basis):
        return None

    def apply(shader: LobeShader) -> None:
        images.lobe_shader = shader

    return Job(
        ("lobe rays", images.transfer.key, light),
        f"{prepared.target.name}, reflections",
        Priority.CONTROL,
        lambda progress, is_canceled: images.transfer.few_lobe_rays(light, is_canceled),
        apply,
        state="precomputing",
    )


def _lobe_job(situation: Situation) -> Job | None:
    """Return the job that shows a narrow lobe by more rays when the drag rests, before all light is solved anew."""
    for target in situation.targets:
        live, ready, reference = target.live, target.live.ready, target.live.ready.reference
        if live.lobe is None or reference is None or reference.light is None:
            continue
        is_traced = ready.light == live.light and ready.fidelity == Fidelity.APPROXIMATE and ready.traces_lobe
        if is_traced and reference.changed_curves(live.target_bands):
            return _more_rays(target, reference.light)
    return None


def _more_rays(target: TermTarget, patch_light: Illumination) -> Job:
    """Return the job that shades a term by some rays a sample. patch_light: whose light of patches is known"""
    images, material, live = target
    light, ready, lobe, term, bands = live.light, live.ready, live.lobe, live.term, live.target_bands
    assert lobe is not None  # few rays were traced along it

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> ShadedTerm:
        light_args = light, is_canceled, LightQuality.EXACT, lobe, patch_light
        incident = images.incident_light(material, *light_args)
        rows = shade(term, bands, *incident, progress, is_canceled).rows(material.num_samples)
        split = images.split_light(material, light, lobe, lambda: rows, is_canceled, patch_light)
        return ShadedTerm.from_rows(average_split(rows, term, bands, split, is_canceled))

    def apply(result: ShadedTerm) -> None:
        if target.exists() and live.ready is ready:
            live.set_ready(replace(ready, image=result.image, fidelity=Fidelity.INCREMENTAL, bands=bands))

    key = "some lobe rays", *images.image_key(material, live, live.light)
    return Job(key, target.label, Priority.REFINEMENT, run, apply)


EARLIER_REFLECTANCES = Strategy(
    name="earlier reflectances",
    needs="the reference image; the operator of the edited term in its light",
    cost="a copy of each image, and a step of the edited one",
    fidelity=Fidelity.APPROXIMATE,
    changes_light=True,
    is_ready=_is_ready,
    update=_update,
    jobs={Urgency.PREVIEW: _lobe_job, Urgency.PREPARED_CONTROL: _preparation_job},
)
