"""Light vectors made beside the frames; both are a `relume.live.fixed_camera.jobs.Job`."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from relume.core.errors import CancelledError
from relume.core.thread_pools import low_priority
from relume.live.fixed_camera.illumination import Illumination, element_gains
from relume.live.fixed_camera.jobs import CancelCheck, ProgressCallback
from relume.live.free_camera.probe_light.incident import IncidentCoefficients, PartialCoefficients, combine
from relume.live.free_camera.protocol import FreeCameraTransfer


@dataclass(frozen=True)
class ProbeLightJob:
    """What arrives, exactly, when a hand rests.

    Attributes:
        has_hard_shadows: pixels find the shadows of beams. on_done: gets it when it is there.
    """

    transfer: FreeCameraTransfer
    light: Illumination
    has_hard_shadows: bool
    on_done: Callable[[Illumination, bool, IncidentCoefficients], None]

    label = "light on the points"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Jobs of one light are one."""
        return self.transfer.key, "incident coefficients", self.light, self.has_hard_shadows

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> IncidentCoefficients:
        """Find it, source by source. Raises CancelledError where `is_canceled`, asked before each, said so."""
        num, done = len(element_gains(self.light)), 0

        def get_vectors(element: Illumination) -> PartialCoefficients:
            nonlocal done
            if is_canceled():
                raise CancelledError("light on the points was cancelled")
            vectors, done = self.transfer.vectors(element, self.has_hard_shadows), done + 1
            progress(done / num)
            return PartialCoefficients(vectors)

        hard_shadow_lights = self.transfer.hard_shadow_lights(self.light, None) if self.has_hard_shadows else ()
        return combine(self.transfer, self.light, get_vectors, hard_shadow_lights)

    def install(self, result: IncidentCoefficients) -> None:
        """Hand it over."""
        self.on_done(self.light, self.has_hard_shadows, result)


@dataclass(frozen=True)
class IncrementalProbeLightJob:
    """What surfaces send each other under a hand, quickly: some frames behind it, and never given up for a newer look.

    Attributes:
        light: of the look when it was begun. compute: finds it. on_done: gets it when it is there.
    """

    light: Illumination
    compute: Callable[[], Any]
    on_done: Callable[[Any], None]

    label = "light between surfaces"
    state: ClassVar[Literal["updating"]] = "updating"
    is_refinement = False
    is_resumable = False

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Jobs of one light are one."""
        return "light that follows", self.light

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Any:
        """Find it, by threads that let frames go first."""
        with low_priority():
            return self.compute()

    def install(self, result: Any) -> None:
        """Hand it over."""
        self.on_done(result)
