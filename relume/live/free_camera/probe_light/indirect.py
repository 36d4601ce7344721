"""What surfaces send each other while a hand moves: of the light as it was some frames ago, and of a change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination, element_gains
from relume.live.free_camera.probe_light.incident import IncidentCoefficients, PartialCoefficients
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import Rgb
from relume.transport.incident_coefficients import add_scaled

F32 = NDArray[np.float32]


class IndirectCoefficients(NamedTuple):
    """What surfaces send to points under a light.

    Attributes:
        light: that they send. is_complete: points that all of it has been found for. (points,) uint8
        exact: what is known of some sources, with their gains. approximate: of the others, of points that were asked
            about.
    """

    light: Illumination
    is_complete: NDArray[np.uint8]
    exact: Mapping[Illumination, tuple[PartialCoefficients, Rgb]]
    approximate: Sequence[tuple[PartialCoefficients, Rgb]]

    @property
    def contributions(self) -> Sequence[tuple[PartialCoefficients, Rgb]]:
        """All of it."""
        return [*self.exact.values(), *self.approximate]


def same_indirect(first: Illumination, second: Illumination) -> bool:
    """Whether surfaces send each other the same under two lights."""
    return _indirect_only(first) == _indirect_only(second)


def _indirect_only(light: Illumination) -> Illumination:
    return light._replace(paths=light.paths.without_direct())


def _indirect_elements(light: Illumination) -> dict[Illumination, Rgb]:
    """What surfaces send of the light of each source, gain 1, and its gain."""
    return {element: gain for element, gain in element_gains(light).items() if element.paths.has_indirect}


def is_cached(transfer: FreeCameraTransfer, light: Illumination) -> bool:
    """Whether all that surfaces send under a light is there at once."""
    return all(transfer.has_vectors(element, without_sun_disks=False) for element in _indirect_elements(light))


def indirect_of(
    transfer: FreeCameraTransfer, light: Illumination, is_needed: NDArray[np.uint8]
) -> IndirectCoefficients:
    """Find what surfaces send to some points, exactly where that is known, else quickly.

    Args:
        transfer: of the points. light: that surfaces send. is_needed: points that are asked about. (points,) uint8
    """
    exact = {
        element: (PartialCoefficients(transfer.vectors(element, without_sun_disks=False)), gain)
        for element, gain in _indirect_elements(light).items()
        if transfer.has_vectors(element, without_sun_disks=False)
    }
    return extend(transfer, IndirectCoefficients(light, np.zeros_like(is_needed), exact, ()), is_needed)


def extend(
    transfer: FreeCameraTransfer, indirect: IndirectCoefficients, is_needed: NDArray[np.uint8]
) -> IndirectCoefficients:
    """Find the same for points that it has not been found for: those that an eye sees since.

    Args:
        transfer, is_needed: as of `indirect_of`. indirect: what has been found.
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
    rows: NDArray[np.intp],
) -> IncidentCoefficients:
    """Find what arrives at some points where surfaces reflect otherwise than before, quickly: what arrived, changed.

    Args:
        transfer: of the points. before: a light of the same sources. previous: what arrives of it, exactly.
        light: that arrives. rows: points that are asked about. (n,)
    """
    delta, incident = transfer.indirect_delta(before, light, rows), previous.copy()
    for into in (incident.total, incident.non_environment):
        add_scaled(into, delta, np.ones(3, np.float32), rows)
    return incident
