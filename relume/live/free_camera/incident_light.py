"""Incident radiance coefficients at probes, summed over light sources."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.live.fixed_camera.illumination import Illumination, element_gains
from relume.live.free_camera.hard_shadow_lights import HardShadowLight
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.look.model import Rgb
from relume.transport.incident_coefficients import add_scaled

F32 = NDArray[np.float32]


class IncidentCoefficients(NamedTuple):
    """Incident radiance coefficients of all probes.

    Attributes:
        total: sum of all light except that of hard-shadow lights.
        non_environment: sum of light other than the environment's own, including local hard-shadow lights.
        hard_shadow_lights: their visibility is traced per pixel.
    """

    total: Shaped[F32, "probes 3 K"]
    non_environment: Shaped[F32, "probes 3 K"]
    hard_shadow_lights: tuple[HardShadowLight, ...] = ()

    def copy(self) -> IncidentCoefficients:
        """Return a copy that may be modified."""
        return self._replace(total=self.total.copy(), non_environment=self.non_environment.copy())


class PartialCoefficients(NamedTuple):
    """Incident radiance coefficients of some probes.

    Attributes:
        vectors: possibly truncated to fewer functions. rows: the probes; None: all.
    """

    vectors: Shaped[F32, "m 3 functions"]
    rows: Shaped[NDArray[np.intp], " m"] | None = None


def combine(
    transfer: FreeCameraTransfer,
    light: Illumination,
    get_vectors: Callable[[Illumination], PartialCoefficients],
    hard_shadow_lights: tuple[HardShadowLight, ...] = (),
    indirect: Sequence[tuple[PartialCoefficients, Rgb]] | None = None,
    rows: Shaped[NDArray[np.intp], " n"] | None = None,
) -> IncidentCoefficients:
    """Sum coefficients over sources; transport is linear in them.

    Args:
        transfer: transfer of the probes. light: the illumination.
        get_vectors: returns those of one light element, without sun disks that are hard-shadow lights.
        hard_shadow_lights: hard-shadow lights of the light.
        indirect: indirect light with its gains, instead of that from `get_vectors`.
        rows: probes to evaluate, the others are undefined; None: all.
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
    """Return the coefficients of all probes, computed if they are not cached.

    Args:
        transfer: transfer of the probes. light: the illumination. has_hard_shadows: pixels trace hard-shadow lights.
    """
    hard_shadow_lights = transfer.hard_shadow_lights(light, None) if has_hard_shadows else ()
    return combine(
        transfer,
        light,
        lambda element: PartialCoefficients(transfer.vectors(element, has_hard_shadows)),
        hard_shadow_lights,
    )
