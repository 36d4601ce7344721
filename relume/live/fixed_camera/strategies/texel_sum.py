"""Edits of a BTF: its texels are summed again in cached incident light.

Repetition and the number of components do not change incident light: such images are exact. A rotated BTF is lit
approximately and shaded when the drag ends.
"""

from __future__ import annotations

from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback, ignore_result
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency
from relume.live.fixed_camera.texel_light_cache import get_texel_light, is_cacheable, put_texel_light
from relume.live.fixed_camera.view_images import TermTarget
from relume.operators.texel_light import BtfIncidentLight, fits_budget


def _cached_light(target: TermTarget) -> BtfIncidentLight | None:
    images, material, live = target
    btf_ref = live.term.texels
    return None if btf_ref is None else get_texel_light(images, material, btf_ref, live.light)


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    btf_ref = target.live.term.texels
    if btf_ref is None or target.live.is_converged or not fits_budget(btf_ref, target.material.num_samples):
        return False
    return _cached_light(target) is not None


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    images, material, live = target
    btf_ref, cached = live.term.texels, _cached_light(target)
    if btf_ref is None or cached is None:
        return
    image = cached.shade(btf_ref, images.unlit_samples(material)).image
    fidelity = Fidelity.EXACT if cached.rotation == btf_ref.rotation else Fidelity.INCREMENTAL
    live.set_ready(DisplayedImage(image, fidelity, dict(live.target_bands), live.light))


def _prepared_job(situation: Situation) -> Job | None:
    """Return the job for the incident light that an edit of the prepared BTF needs first; None if it needs none."""
    prepared = situation.control.prepared_control
    if prepared is None or prepared.basis is not None:
        return None
    target = prepared.target
    images, material, live = target
    btf_ref, light = live.term.texels, live.light
    if btf_ref is None or not material.num_samples or not is_cacheable(images, material, btf_ref):
        return None
    if _cached_light(target) is not None:
        return None

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> BtfIncidentLight:
        return put_texel_light(images, material, btf_ref, light, progress, is_canceled)

    key = "texel light", *images.image_key(material, live, light)
    return Job(key, target.label, Priority.CONTROL, run, ignore_result, state="precomputing")


TEXEL_SUM = Strategy(
    name="texel sum",
    needs="the incident light of a BTF term",
    cost="a texel per sample",
    fidelity=Fidelity.EXACT,
    is_ready=_is_ready,
    update=_update,
    jobs={Urgency.PREPARED_CONTROL: _prepared_job},
)
