"""Edits of a BTF: its texels are summed again in cached incident light.

Repetition and the number of components do not change incident light: such images are exact. A rotated BTF is lit
approximately and shaded when the drag ends.
"""

from __future__ import annotations

from collections.abc import Hashable

from relume.brdf.terms.btf import BtfRef
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback, ignore_result
from relume.live.fixed_camera.material_image import MaterialImage
from relume.live.fixed_camera.strategies.strategy import Situation, Strategy, Urgency
from relume.live.fixed_camera.view_images import TermTarget, ViewImages
from relume.operators.texel_light import BtfIncidentLight, collect_light, fits_budget, incident_light_bytes

_BUDGET_DIVISOR = 4  # each takes at most this fraction of the memory budget


def _light_key(
    images: ViewImages, material: MaterialImage, btf_ref: BtfRef, light: Illumination
) -> tuple[Hashable, ...]:
    grid_bytes = (array.tobytes() for array in btf_ref.btf.grid)
    return images.transfer.key, *images.view.sample_key(material.index), light, "arrived", *grid_bytes


def is_cacheable(images: ViewImages, material: MaterialImage, btf_ref: BtfRef) -> bool:
    """Return whether the incident light of a material fits the memory budget.

    Args:
        images: of a view. material: its image. btf_ref: its BTF.
    """
    return _BUDGET_DIVISOR * incident_light_bytes(btf_ref, material.num_samples) <= images.cache.budget_bytes


def _texel_light(
    images: ViewImages, material: MaterialImage, btf_ref: BtfRef, light: Illumination
) -> BtfIncidentLight | None:
    """Return the cached incident light of a material, or None; the rotation of the BTF may differ."""
    return images.cache.get_cached(_light_key(images, material, btf_ref, light), BtfIncidentLight)


def put_texel_light(
    images: ViewImages,
    material: MaterialImage,
    btf_ref: BtfRef,
    light: Illumination,
    progress: ProgressCallback,
    is_canceled: CancelCheck,
) -> BtfIncidentLight:
    """Return the incident light of a material in the frames of its BTF, computed and cached; replaces another rotation.

    Args:
        images: of a view. material: its image. btf_ref: its BTF. light: the illumination.
        progress: called with the fraction done. is_canceled: polled regularly.
    Raises:
        CancelledError: `is_canceled` returned true.
    """
    cached = _texel_light(images, material, btf_ref, light)
    if cached is not None and cached.rotation == btf_ref.rotation:
        return cached
    incident = collect_light(btf_ref, *images.incident_light(material, light, is_canceled), progress, is_canceled)
    key = _light_key(images, material, btf_ref, light)
    images.cache.evict(key)
    images.cache.get(key, BtfIncidentLight, incident.num_bytes, lambda: incident)
    return incident  # another session may have cached another rotation


def _cached_light(target: TermTarget) -> BtfIncidentLight | None:
    images, material, live = target
    btf_ref = live.term.texels
    return None if btf_ref is None else _texel_light(images, material, btf_ref, live.light)


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
