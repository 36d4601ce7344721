"""A texture that looks different from every side, in hand: its texels are summed anew in light that is kept.

How often it repeats and how many components are summed change no light: such images are exact. One that was turned is
lit nearly, and shaded when the hand rests.
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
    """Show a term's texture as it is wanted, where it shows nothing and what arrives at it is known."""
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
    """What arrives at a texture that a hand has taken hold of; found in the memory from then on."""

    target: TermTarget
    btf_ref: BtfRef
    light: Illumination
    key: tuple[Hashable, ...]
    state: Literal["precomputing", "shading"] = "precomputing"
    is_refinement = False
    is_resumable = False

    @property
    def label(self) -> str:
        """In words."""
        return f"{self.target.name}, {self.target.live.term.label}"

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> BtfIncidentLight:
        """See `Job`."""
        return put_texel_light(
            self.target.images, self.target.material, self.btf_ref, self.light, progress, is_canceled
        )

    def install(self, result: BtfIncidentLight) -> None:
        """See `Job`; the memory has it, which is enough."""


def job_for(target: TermTarget) -> SumTexels | None:
    """What a hand on a term's texture must wait for before it is followed; None where there is no need."""
    images, material, live = target
    btf_ref = live.term.texels
    if btf_ref is None or not material.num_samples or not is_cacheable(images, material, btf_ref):
        return None
    if get_texel_light(images, material, btf_ref, live.light) is not None:
        return None
    key = (*images.image_key(material, live, live.light), "arrived")
    return SumTexels(target, btf_ref, live.light, key)
