"""Update strategies: each is a way to bring the image of a term to its target."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination
from relume.live.fixed_camera.jobs import Job, TermTarget


class LightStrategy(Protocol):
    """Updates a term's reference image, which is exact, to the same curves in another light.

    Attributes:
        fidelity: fidelity of the resulting images.
    """

    fidelity: Fidelity

    def applicable(self, target: TermTarget, light: Illumination) -> bool:
        """Return whether it can update the reference image to this light, after its jobs have run."""
        ...

    def prepare(self, target: TermTarget, light: Illumination) -> Sequence[Job]:
        """Return the jobs that it needs first; empty if it can update at once."""
        ...

    def evaluate(self, target: TermTarget, light: Illumination) -> None:
        """Update the image to this light; it must be applicable and need no jobs."""
        ...
