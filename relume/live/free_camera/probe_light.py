"""Incident coefficients of one session's free-camera image, under changing light.

Exact coefficients are computed when a drag ends. During a drag, direct light is computed in every frame for visible
probes. If lights change, so is indirect light if these probes and the patches are few. Otherwise it takes longer than
a frame: it is computed in the background, and frames use the latest result (`Priority.UPDATE`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.errors import CancelledError
from relume.core.thread_pools import low_priority
from relume.live.fixed_camera.illumination import Illumination, element_gains, equal_up_to_reflectances
from relume.live.fixed_camera.jobs import CancelCheck, Job, Priority, ProgressCallback
from relume.live.free_camera.incident_light import IncidentCoefficients, PartialCoefficients, combine, combine_all
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import Rgb
from relume.transport.incident_coefficients import add_scaled

F32 = NDArray[np.float32]

MAX_PROBES_IN_FRAME = 60_000
"""Probes whose indirect light is computed within a frame when lights change: a tenth of a second of processor time."""
_PROBES_PER_PATCH = 3  # that take as long as the bounces of one patch


class IndirectCoefficients(NamedTuple):
    """Indirect illumination of probes.

    Attributes:
        light: the illumination. is_complete: nonzero for evaluated probes.
        exact: cached coefficients of some elements, with their gains. approximate: of the others, for evaluated probes.
    """

    light: Illumination
    is_complete: Shaped[NDArray[np.uint8], " probes"]
    exact: Mapping[Illumination, tuple[PartialCoefficients, Rgb]]
    approximate: Sequence[tuple[PartialCoefficients, Rgb]]

    @property
    def contributions(self) -> Sequence[tuple[PartialCoefficients, Rgb]]:
        """All coefficients, with their gains."""
        return [*self.exact.values(), *self.approximate]


def _indirect_only(light: Illumination) -> Illumination:
    return light._replace(paths=light.paths.without_direct())


def _indirect_elements(light: Illumination) -> dict[Illumination, Rgb]:
    """Indirect elements of a light, with their gains."""
    return {element: gain for element, gain in element_gains(light).items() if element.paths.has_indirect}


def _is_cached(transfer: FreeCameraTransfer, light: Illumination) -> bool:
    """Return whether all indirect illumination of a light is cached."""
    return all(transfer.has_vectors(element, without_sun_disks=False) for element in _indirect_elements(light))


def _indirect_of(
    transfer: FreeCameraTransfer, light: Illumination, is_needed: Shaped[NDArray[np.uint8], " probes"]
) -> IndirectCoefficients:
    """Return the indirect illumination of some probes, exact if cached, else approximate.

    Args:
        transfer: of the probes. light: the illumination. is_needed: nonzero for probes to evaluate.
    """
    exact = {
        element: (PartialCoefficients(transfer.vectors(element, without_sun_disks=False)), gain)
        for element, gain in _indirect_elements(light).items()
        if transfer.has_vectors(element, without_sun_disks=False)
    }
    return _extend(transfer, IndirectCoefficients(light, np.zeros_like(is_needed), exact, ()), is_needed)


def _extend(
    transfer: FreeCameraTransfer, indirect: IndirectCoefficients, is_needed: Shaped[NDArray[np.uint8], " probes"]
) -> IndirectCoefficients:
    """Evaluate indirect illumination for probes that became visible.

    Args:
        transfer, is_needed: as in `_indirect_of`. indirect: the current result.
    """
    new = np.flatnonzero(is_needed & ~indirect.is_complete)
    if not len(new):
        return indirect
    contributions = [
        (PartialCoefficients(transfer.fast_vectors(element, new, without_sun_disks=False), new), gain)
        for element, gain in _indirect_elements(indirect.light).items()
        if element not in indirect.exact
    ]
    return indirect._replace(
        is_complete=indirect.is_complete | is_needed, approximate=[*indirect.approximate, *contributions]
    )


def update_reflectances(
    transfer: FreeCameraTransfer,
    before: Illumination,
    previous: IncidentCoefficients,
    light: Illumination,
    rows: Shaped[NDArray[np.intp], " n"],
) -> IncidentCoefficients:
    """Return approximate coefficients of some probes after a change of reflectances: the previous ones plus the change.

    Args:
        transfer: of the probes. before: a light of the same sources. previous: its exact coefficients.
        light: the illumination. rows: the probes.
    """
    delta, incident = transfer.indirect_delta(before, light, rows), previous.copy()
    for into in (incident.total, incident.non_environment):
        add_scaled(into, delta, np.ones(3, np.float32), rows)
    return incident


class LightRequest(NamedTuple):
    """The requested light.

    Attributes:
        light: light of the look. has_hard_shadows: pixels trace hard-shadow lights.
    """

    light: Illumination
    has_hard_shadows: bool


class _UpdatedIncident(NamedTuple):
    """Exact coefficients plus a change of indirect light.

    Attributes:
        base: the exact coefficients. light: the illumination. is_complete: nonzero for updated probes. (probes,) uint8
    """

    base: IncidentCoefficients
    light: Illumination
    is_complete: NDArray[np.uint8]
    incident: IncidentCoefficients


class _CoarseIncident(NamedTuple):
    """Coefficients of a frame, and their inputs."""

    direct: LightRequest
    is_needed: NDArray[np.uint8]
    indirect: IndirectCoefficients
    incident: IncidentCoefficients


class ProbeLightState:
    """State of one image; used from one thread at a time.

    Attributes:
        version: increases with each update during an edit.
    """

    def __init__(self, transfer: FreeCameraTransfer) -> None:
        self._transfer = transfer
        self._exact: tuple[LightRequest, IncidentCoefficients] | None = None
        self._updated: _UpdatedIncident | None = None
        self._indirect: IndirectCoefficients | None = None
        self._coarse: _CoarseIncident | None = None
        self.version = 0

    def is_available(self, request: LightRequest) -> bool:
        """Return whether exact coefficients need no computation."""
        is_exact = self._exact is not None and self._exact[0] == request
        return is_exact or all(
            self._transfer.has_vectors(element, request.has_hard_shadows) for element in element_gains(request.light)
        )

    def only_indirect_pending(self, request: LightRequest) -> bool:
        """Return whether only indirect light differs from the last exact coefficients."""
        if self._exact is None:
            return False
        before, has_hard_shadows = self._exact[0]
        return has_hard_shadows == request.has_hard_shadows and equal_up_to_reflectances(before, request.light)

    def exact(self, request: LightRequest) -> IncidentCoefficients:
        """Return exact coefficients of all probes."""
        if self._exact is None or self._exact[0] != request:
            self.restart_from(
                *request, combine_all(self._transfer, request.light, has_hard_shadows=request.has_hard_shadows)
            )
        assert self._exact is not None
        return self._exact[1]

    def restart_from(self, light: Illumination, has_hard_shadows: bool, incident: IncidentCoefficients) -> None:
        """Set exact coefficients.

        Args:
            light, has_hard_shadows: see `LightRequest`. incident: the coefficients.
        """
        self._exact = LightRequest(light, has_hard_shadows), incident
        self._updated = self._indirect = self._coarse = None

    def fast(self, request: LightRequest, is_needed: Shaped[NDArray[np.uint8], " probes"]) -> IncidentCoefficients:
        """Return approximate coefficients of some probes; indirect light may be some frames old.

        Args:
            request: the requested light. is_needed: nonzero for probes to evaluate.
        """
        if self.only_indirect_pending(request):
            assert self._exact is not None
            return self._exact[1] if self._updated is None else self._updated.incident
        self._indirect = indirect = self._latest_indirect(request.light, is_needed)
        direct = request._replace(light=request.light._replace(reflectances=()))
        last = self._coarse
        is_same = last is not None and last.indirect is indirect and last.is_needed is is_needed
        if last is None or not is_same or last.direct != direct:
            self._coarse = last = _CoarseIncident(
                direct, is_needed, indirect, self._solve_direct(request, is_needed, indirect)
            )
        return last.incident

    def _solve_direct(
        self, request: LightRequest, is_needed: NDArray[np.uint8], indirect: IndirectCoefficients
    ) -> IncidentCoefficients:
        """Compute direct light, and add indirect light."""
        transfer, (light, has_hard_shadows), rows = self._transfer, request, np.flatnonzero(is_needed)

        def get_vectors(element: Illumination) -> PartialCoefficients:
            if transfer.has_vectors(element, has_hard_shadows):
                return PartialCoefficients(transfer.vectors(element, has_hard_shadows))
            return PartialCoefficients(transfer.fast_vectors(element, rows, has_hard_shadows), rows)

        hard_shadow_lights = transfer.hard_shadow_lights(light, rows) if has_hard_shadows else ()
        return combine(transfer, light, get_vectors, hard_shadow_lights, indirect.contributions, rows)

    def _latest_indirect(self, light: Illumination, is_needed: NDArray[np.uint8]) -> IndirectCoefficients:
        """Return the latest indirect light; compute it if there is none, or if few probes need another."""
        transfer, last = self._transfer, self._indirect
        follows = self._fits_in_frame(is_needed)
        is_outdated = follows and self._is_indirect_outdated(light)
        if last is None or is_outdated or last.light.paths.has_indirect != light.paths.has_indirect:
            before = light if follows or self._exact is None else self._exact[0].light
            is_reusable = before.paths.has_indirect == light.paths.has_indirect and _is_cached(transfer, before)
            last = _indirect_of(transfer, before if is_reusable else light, is_needed)
        return _extend(transfer, last, is_needed)

    def _fits_in_frame(self, is_needed: NDArray[np.uint8]) -> bool:
        """Return whether the indirect light of these probes takes no longer than a frame may."""
        cost = np.count_nonzero(is_needed) + _PROBES_PER_PATCH * self._transfer.num_patches
        return bool(cost <= MAX_PROBES_IN_FRAME)

    def next_job(self, request: LightRequest, is_needed: Shaped[NDArray[np.uint8], " probes"]) -> Job:
        """Return the job for missing light: indirect light of some probes first, then all exact coefficients.

        Args:
            request, is_needed: as in `fast`, which must have been called.
        """
        transfer, light = self._transfer, request.light
        if self.only_indirect_pending(request):
            assert self._exact is not None
            before, base = self._exact[0].light, self._exact[1]
            last = self._updated
            if last is None or last.light != light or (is_needed & ~last.is_complete).any():
                return _update_job(
                    light, lambda: self._update_reflectances(before, base, light, is_needed), self._set_updated
                )
        elif self._is_indirect_outdated(light):
            return _update_job(light, lambda: _indirect_of(transfer, light, is_needed), self._set_indirect)
        return Job(
            ("probe light", transfer.key, *request),
            "light at the probes",
            Priority.REFINEMENT,
            lambda progress, is_canceled: _exact_coefficients(transfer, request, progress, is_canceled),
            lambda incident: self.restart_from(*request, incident),
        )

    def _is_indirect_outdated(self, light: Illumination) -> bool:
        """Return whether frames use indirect illumination of another light."""
        last = self._indirect
        return last is not None and light.paths.has_indirect and _indirect_only(last.light) != _indirect_only(light)

    def _update_reflectances(
        self, before: Illumination, base: IncidentCoefficients, light: Illumination, is_needed: NDArray[np.uint8]
    ) -> _UpdatedIncident:
        incident = update_reflectances(self._transfer, before, base, light, np.flatnonzero(is_needed))
        return _UpdatedIncident(base, light, is_needed, incident)

    def _set_updated(self, updated: _UpdatedIncident) -> None:
        if self._exact is not None and updated.base is self._exact[1]:  # else the light has moved
            self._updated, self.version = updated, self.version + 1

    def _set_indirect(self, indirect: IndirectCoefficients) -> None:
        if self._indirect is not None:  # else all is exact by now
            self._indirect, self.version = indirect, self.version + 1


def _update_job(light: Illumination, compute: Callable[[], Any], apply: Callable[[Any], None]) -> Job:
    """Return the job for approximate indirect light during a drag, in threads with lower priority than frames.

    Args:
        light: of the look when the job was created. compute: computes it. apply: receives the result.
    """

    def run(progress: ProgressCallback, is_canceled: CancelCheck) -> Any:
        with low_priority():
            return compute()

    return Job(("indirect light", light), "indirect light", Priority.UPDATE, run, apply)


def _exact_coefficients(
    transfer: FreeCameraTransfer, request: LightRequest, progress: ProgressCallback, is_canceled: CancelCheck
) -> IncidentCoefficients:
    """Compute exact coefficients source by source; `is_canceled` is polled before each."""
    (light, has_hard_shadows), done = request, 0
    num = len(element_gains(light))

    def get_vectors(element: Illumination) -> PartialCoefficients:
        nonlocal done
        if is_canceled():
            raise CancelledError("the light at the probes was canceled")
        vectors, done = transfer.vectors(element, has_hard_shadows), done + 1
        progress(done / num)
        return PartialCoefficients(vectors)

    hard_shadow_lights = transfer.hard_shadow_lights(light, None) if has_hard_shadows else ()
    return combine(transfer, light, get_vectors, hard_shadow_lights)
