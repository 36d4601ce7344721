"""A route: one way in which the image of a term comes from what it shows to what is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from relume.picture.fidelity import Fidelity
from relume.picture.jobs import Job, Place
from relume.picture.light import Light


class LightRoute(Protocol):
    """From the anchor of a term, an exact image, to the same curves in another light.

    Attributes:
        fidelity: of the images it leads to.
    """

    fidelity: Fidelity

    def reaches(self, place: Place, light: Light) -> bool:
        """Whether it leads from the term's anchor to this light, once all that it needs has been made."""
        ...

    def needs(self, place: Place, light: Light) -> Sequence[Job]:
        """What must be made before it does; nothing where it does at once."""
        ...

    def apply(self, place: Place, light: Light) -> None:
        """Put the image in this light; the route must reach it and need nothing."""
        ...
