"""Jobs that compute incident coefficients in the background; each is a `relume.live.fixed_camera.jobs.Job`."""

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
    """Computes exact coefficients when the drag ends.

    Attributes:
        has_hard_shadows: pixels trace hard-shadow lights. on_done: receives the result.
    """

    transfer: FreeCameraTransfer
    light: Illumination
    has_hard_shadows: bool
    on_done: Callable[[Illumination, bool, IncidentCoefficients], None]

    label = "light at the probes"
    state: ClassVar[Literal["shading"]] = "shading"
    is_refinement = True
    is_resumable = False

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Equal for jobs of one light."""
        return self.transfer.key, "incident coefficients", self.light, self.has_hard_shadows

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> IncidentCoefficients:
        """Compute it source by source. Raises CancelledError if `is_canceled`, polled before each, returned true."""
        num, done = len(element_gains(self.light)), 0

        def get_vectors(element: Illumination) -> PartialCoefficients:
            nonlocal done
            if is_canceled():
                raise CancelledError("the light at the probes was canceled")
            vectors, done = self.transfer.vectors(element, self.has_hard_shadows), done + 1
            progress(done / num)
            return PartialCoefficients(vectors)

        hard_shadow_lights = self.transfer.hard_shadow_lights(self.light, None) if self.has_hard_shadows else ()
        return combine(self.transfer, self.light, get_vectors, hard_shadow_lights)

    def install(self, result: IncidentCoefficients) -> None:
        """Pass the result on."""
        self.on_done(self.light, self.has_hard_shadows, result)


@dataclass(frozen=True)
class IncrementalProbeLightJob:
    """Computes approximate indirect light during a drag: some frames late, and not canceled by newer looks.

    Attributes:
        light: light of the look when the job was created. compute: computes it. on_done: receives the result.
    """

    light: Illumination
    compute: Callable[[], Any]
    on_done: Callable[[Any], None]

    label = "indirect light"
    state: ClassVar[Literal["updating"]] = "updating"
    is_refinement = False
    is_resumable = False

    @property
    def key(self) -> tuple[Hashable, ...]:
        """Equal for jobs of one light."""
        return "light that follows", self.light

    def run(self, progress: ProgressCallback, is_canceled: CancelCheck) -> Any:
        """Compute it in threads with lower priority than frames."""
        with low_priority():
            return self.compute()

    def install(self, result: Any) -> None:
        """Pass the result on."""
        self.on_done(result)
