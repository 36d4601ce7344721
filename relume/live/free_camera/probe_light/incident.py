"""What arrives at the points of a moving picture: summed over sources."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination, element_gains
from relume.live.free_camera.hard_shadows.lights import HardShadowLight
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import Rgb
from relume.transport.incident_coefficients import add_scaled

F32 = NDArray[np.float32]


class IncidentCoefficients(NamedTuple):
    """What arrives at points.

    Attributes:
        total: light vectors of all light but that of beams. (points, 3, K) float32
        non_environment: of that which is not the sky's own, lamps that are beams included. (points, 3, K) float32
        hard_shadow_lights: whose shadows pixels find by themselves.
    """

    total: F32
    non_environment: F32
    hard_shadow_lights: tuple[HardShadowLight, ...] = ()

    def copy(self) -> IncidentCoefficients:
        """One that may be added to."""
        return self._replace(total=self.total.copy(), non_environment=self.non_environment.copy())


class PartialCoefficients(NamedTuple):
    """Light vectors of some points.

    Attributes:
        vectors: of fewer functions, maybe. (m, 3, ≤ K) float32. rows: the points. (m,); None: all.
    """

    vectors: F32
    rows: NDArray[np.intp] | None = None


def combine(
    transfer: FreeCameraTransfer,
    light: Illumination,
    get_vectors: Callable[[Illumination], PartialCoefficients],
    hard_shadow_lights: tuple[HardShadowLight, ...] = (),
    indirect: Sequence[tuple[PartialCoefficients, Rgb]] | None = None,
    rows: NDArray[np.intp] | None = None,
) -> IncidentCoefficients:
    """Sum over sources: transport is linear in them.

    Args:
        transfer: of the points. light: that arrives.
        get_vectors: finds those of one source and one kind of way, suns that are beams left out.
        hard_shadow_lights: of the light.
        indirect: what surfaces send, with its gains, in place of what `get_vectors` finds of it.
        rows: points that are asked about, the others have anything; None: all.
    """
    total, non_environment = (np.zeros(transfer.vectors_shape, np.float32) for _ in range(2))
    hard_shadow_keys = {hard_shadow_light.key for hard_shadow_light in hard_shadow_lights}
    for element, gain in element_gains(light).items():
        if element.paths.has_indirect and indirect is not None:
            continue
        contribution = get_vectors(element)
        if not (element.paths.direct and any(geometry in hard_shadow_keys for geometry, _ in element.local)):
            _add(total, contribution, gain, rows)
        if not element.has_direct_environment:
            _add(non_environment, contribution, gain, rows)
    for contribution, gain in indirect or ():
        for into in (total, non_environment):
            _add(into, contribution, gain, rows)
    return IncidentCoefficients(total, non_environment, hard_shadow_lights)


def _add(total: F32, contribution: PartialCoefficients, gain: Rgb, default_rows: NDArray[np.intp] | None) -> None:
    has_all_probes = contribution.rows is None
    rows = default_rows if has_all_probes else contribution.rows
    add_scaled(total, contribution.vectors, np.array(gain, np.float32), rows, has_all_rows=has_all_probes)


def combine_all(
    transfer: FreeCameraTransfer, light: Illumination, *, has_hard_shadows: bool = False
) -> IncidentCoefficients:
    """Find what arrives at all points, where it is not known too.

    Args:
        transfer: of the points. light: that arrives. has_hard_shadows: pixels find the shadows of beams.
    """
    hard_shadow_lights = transfer.hard_shadow_lights(light, None) if has_hard_shadows else ()
    return combine(
        transfer,
        light,
        lambda element: PartialCoefficients(transfer.vectors(element, has_hard_shadows)),
        hard_shadow_lights,
    )
