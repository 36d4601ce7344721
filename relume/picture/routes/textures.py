"""A texture that looks different from every side, in hand: its texels are summed anew in light that is kept.

How often it repeats and how many components are summed change no light: such images are exact. One that was turned is
lit nearly, and shaded when the hand rests.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Literal

from relume.brdf.terms.btf import Texels
from relume.operators.arrived import Arrived, is_quick
from relume.picture.arrivals import keep_arrived, known_arrived, may_be_kept
from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Cancelled, Place, Progress
from relume.picture.light import Light
from relume.picture.shown import Shown


def step(place: Place) -> None:
    """Show a term's texture as it is wanted, where it shows nothing and what arrives at it is known."""
    images, material, live = place
    texels = live.term.texels
    if texels is None or live.is_firm:
        return
    known = known_arrived(images, material, texels, live.light)
    if known is not None and is_quick(texels, material.num_samples):
        image = known.sent(texels, images.unlit(material)).image
        fidelity = Fidelity.EXACT if known.rotation == texels.rotation else Fidelity.COARSE
        live.put(Shown(image, fidelity, dict(live.target), live.light))


@dataclass(frozen=True, eq=False)
class Arrive:
    """What arrives at a texture that a hand has taken hold of; found in the memory from then on."""

    place: Place
    texels: Texels
    light: Light
    key: tuple[Hashable, ...]
    state: Literal["freezing", "shading"] = "freezing"
    refines = False
    goes_on = False

    @property
    def what(self) -> str:
        """In words."""
        return f"{self.place.name}, {self.place.live.term.label}"

    def make(self, progress: Progress, cancelled: Cancelled) -> Arrived:
        """See `Job`."""
        return keep_arrived(self.place.images, self.place.material, self.texels, self.light, progress, cancelled)

    def install(self, made: Arrived) -> None:
        """See `Job`; the memory has it, which is enough."""


def job_for(place: Place) -> Arrive | None:
    """What a hand on a term's texture must wait for before it is followed; None where there is no need."""
    images, material, live = place
    texels = live.term.texels
    if texels is None or not material.num_samples or not may_be_kept(images, material, texels):
        return None
    if known_arrived(images, material, texels, live.light) is not None:
        return None
    key = (*images.key_of_image(material, live, live.light), "arrived")
    return Arrive(place, texels, live.light, key)
