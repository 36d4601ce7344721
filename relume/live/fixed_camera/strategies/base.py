"""A route: one way in which the image of a term comes from what it shows to what is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import Job, TermTarget


class LightStrategy(Protocol):
    """From the anchor of a term, an exact image, to the same curves in another light.

    Attributes:
        fidelity: of the images it leads to.
    """

    fidelity: Fidelity

    def applicable(self, target: TermTarget, light: Illumination) -> bool:
        """Whether it leads from the term's anchor to this light, once all that it needs has been made."""
        ...

    def prepare(self, target: TermTarget, light: Illumination) -> Sequence[Job]:
        """What must be made before it does; nothing where it does at once."""
        ...

    def evaluate(self, target: TermTarget, light: Illumination) -> None:
        """Put the image in this light; the route must reach it and need nothing."""
        ...
