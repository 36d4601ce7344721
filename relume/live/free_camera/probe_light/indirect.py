"""Indirect illumination of probes during an edit: that of the light some frames ago, and its change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination, element_gains
from relume.live.free_camera.probe_light.incident import IncidentCoefficients, PartialCoefficients
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import Rgb
from relume.transport.incident_coefficients import add_scaled

F32 = NDArray[np.float32]


class IndirectCoefficients(NamedTuple):
    """Indirect illumination of probes.

    Attributes:
        light: the illumination. is_complete: nonzero for evaluated probes.
        exact: cached coefficients of some elements, with their gains.
        approximate: approximation of the others, for evaluated probes.
    """

    light: Illumination
    is_complete: Shaped[NDArray[np.uint8], " probes"]
    exact: Mapping[Illumination, tuple[PartialCoefficients, Rgb]]
    approximate: Sequence[tuple[PartialCoefficients, Rgb]]

    @property
    def contributions(self) -> Sequence[tuple[PartialCoefficients, Rgb]]:
        """All coefficients, with their gains."""
        return [*self.exact.values(), *self.approximate]


def same_indirect(first: Illumination, second: Illumination) -> bool:
    """Return whether two lights have the same indirect illumination."""
    return _indirect_only(first) == _indirect_only(second)


def _indirect_only(light: Illumination) -> Illumination:
    return light._replace(paths=light.paths.without_direct())


def _indirect_elements(light: Illumination) -> dict[Illumination, Rgb]:
    """Indirect elements of a light, with their gains."""
    return {element: gain for element, gain in element_gains(light).items() if element.paths.has_indirect}


def is_cached(transfer: FreeCameraTransfer, light: Illumination) -> bool:
    """Return whether all indirect illumination of a light is cached."""
    return all(transfer.has_vectors(element, without_sun_disks=False) for element in _indirect_elements(light))


def indirect_of(
    transfer: FreeCameraTransfer, light: Illumination, is_needed: Shaped[NDArray[np.uint8], " probes"]
) -> IndirectCoefficients:
    """Return the indirect illumination of some probes, exact if cached, else approximate.

    Args:
        transfer: transfer of the probes. light: the illumination. is_needed: nonzero for probes to evaluate.
    """
    exact = {
        element: (PartialCoefficients(transfer.vectors(element, without_sun_disks=False)), gain)
        for element, gain in _indirect_elements(light).items()
        if transfer.has_vectors(element, without_sun_disks=False)
    }
    return extend(transfer, IndirectCoefficients(light, np.zeros_like(is_needed), exact, ()), is_needed)


def extend(
    transfer: FreeCameraTransfer, indirect: IndirectCoefficients, is_needed: Shaped[NDArray[np.uint8], " probes"]
) -> IndirectCoefficients:
    """Evaluate indirect illumination for probes that became visible.

    Args:
        transfer, is_needed: as in `indirect_of`. indirect: the current result.
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
        transfer: transfer of the probes. before: a light of the same sources. previous: its exact coefficients.
        light: the illumination. rows: the probes.
    """
    delta, incident = transfer.indirect_delta(before, light, rows), previous.copy()
    for into in (incident.total, incident.non_environment):
        add_scaled(into, delta, np.ones(3, np.float32), rows)
    return incident
