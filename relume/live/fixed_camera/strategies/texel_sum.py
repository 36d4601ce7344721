"""Edits of a BTF: its texels are summed again in cached incident light.

Repetition and the number of components do not change incident light: such images are exact. A rotated BTF is lit
approximately and shaded when the drag ends.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Literal

from relume.brdf.terms.btf import BtfRef
from relume.live.fixed_camera.displayed import DisplayedImage
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback, TermTarget
from relume.live.fixed_camera.texel_light_cache import get_texel_light, is_cacheable, put_texel_light
from relume.operators.texel_light import BtfIncidentLight, fits_budget


def step(target: TermTarget) -> None:
    """Update a term's BTF image if it has none and its incident light is cached."""
    images, material, live = target
    btf_ref = live.term.texels
    if btf_ref is None or live.is_converged:
        return
    cached = get_texel_light(images, material, btf_ref, live.light)
    if cached is not None and fits_budget(btf_ref, material.num_samples):
        image = cached.shade(btf_ref, images.unlit_samples(material)).image
        fidelity = Fidelity.EXACT if cached.rotation == btf_ref.rotation else Fidelity.COARSE
        live.set_ready(DisplayedImage(image, fidelity, dict(live.target_bands), live.light))


@dataclass(frozen=True, eq=False)
class SumTexels:
    """Incident light of a BTF that is edited; cached."""

    target: TermTarget
    btf_ref: BtfRef
    light: Illumination
    key: tuple[Hashable, ...]
    state: Literal["precomputing", "shading"] = "precomputing"
    is_refinement = False
    is_resumable = False

    @property
    def label(self) -> str:
        """Text for the user."""
        return f"{self.target.name}, {self.target.live.term.label}"

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> BtfIncidentLight:
        """See `Job`."""
        return put_texel_light(
            self.target.images, self.target.material, self.btf_ref, self.light, progress, is_canceled
        )

    def install(self, result: BtfIncidentLight) -> None:
        """See `Job`; the result is in the cache, so nothing is left to do."""


def job_for(target: TermTarget) -> SumTexels | None:
    """Return the job that an edit of a term's BTF needs first; None if it needs none."""
    images, material, live = target
    btf_ref = live.term.texels
    if btf_ref is None or not material.num_samples or not is_cacheable(images, material, btf_ref):
        return None
    if get_texel_light(images, material, btf_ref, live.light) is not None:
        return None
    key = (*images.image_key(material, live, live.light), "arrived")
    return SumTexels(target, btf_ref, live.light, key)
