"""Indirect light of patches, bounce by bounce, until it is isotropic.

    t^0: from the lights;   L^b = F t^b;   t^(b+1)(c) = mean over the rays r of c of π L^b(hit(c, r), −ω_r) h(ω_r)

The first bounces keep directions, the more of them the more light highlights reflect. Later light has come from
everywhere: from then on a patch radiates isotropically, with the mean of its directional light
(`relume.radiosity.bounce`). For direct light, sharp highlights use tables in place of the low-degree basis
(`relume.radiosity.highlight_transport`).
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.radiosity.bounce import bounces, one_bounce, preview_bounces
from relume.radiosity.outgoing_radiance import (
    EMPTY_BINS,
    OutgoingHighlights,
    OutgoingRadiance,
    first_bounce,
    isotropic_radiance,
)
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator

F32 = NDArray[np.float32]

_MIN_DIRECTIONAL_BOUNCES, _MAX_DIRECTIONAL_BOUNCES = 2, 4
_ENERGY_CUTOFF = 0.1  # fraction of the light that highlights have reflected at each bounce


class Directions(Enum):
    """Directions of light between patches: exact, by bins, or none after the first reflection, see `solve_isotropic`.

    The latter two are approximations for edits; isotropic light uses few rays from its second bounce on.
    """

    EXACT = "exact"
    BINNED = "binned"
    NONE = "none"


def solve_bounces(
    patches: PatchLight,
    reflectance_operator: ReflectanceOperator,
    incident: IncidentLight,
    first: int,
    last: int,
    outgoing_highlights: OutgoingHighlights | None = None,
    directions: Directions = Directions.EXACT,
) -> OutgoingRadiance:
    """Return the outgoing radiance of all patches by bounces `first` to `last`.

    Args:
        patches: patches of the bake. reflectance_operator: reflectance operator of the patches.
        incident: direct light. first: at least 1. last: at least `first`.
        outgoing_highlights: sharp highlights and their direct light; None: these use the low-degree basis.
        directions: of light between patches, exact or binned.
    """
    gather_hits, rho = patches.gather_hits, reflectance_operator.reflectance
    first_outgoing = outgoing = first_bounce(reflectance_operator, incident, outgoing_highlights)
    total, coefficients = (
        float(first == 1) * array.astype(np.float64)
        for array in (first_outgoing.isotropic, first_outgoing.coefficients)
    )
    num_directional, bounce_index = min(last, _num_directional_bounces(reflectance_operator)), 1
    while bounce_index < num_directional:
        outgoing, bounce_index = _reflect(patches, reflectance_operator, outgoing, directions), bounce_index + 1
        if bounce_index >= first:
            total, coefficients = total + outgoing.isotropic, coefficients + outgoing.coefficients
    if bounce_index < last:
        start = max(first, bounce_index + 1)
        isotropic = _bounce_times(start - bounce_index, patches, reflectance_operator, outgoing.mean_to_others(patches))
        total += (
            bounces(gather_hits, rho, isotropic, last - start)
            if directions is Directions.EXACT
            else preview_bounces(gather_hits, patches.few_rays, rho, isotropic, last - start)
        )
    outgoing_fields = total.astype(np.float32), first_outgoing.rows, coefficients.astype(np.float32)
    return OutgoingRadiance(
        *outgoing_fields, first_outgoing.roughening, first_outgoing.bins if first == 1 else EMPTY_BINS
    )


def solve_isotropic(
    patches: PatchLight,
    reflectance_operator: ReflectanceOperator,
    incident: IncidentLight,
    mean_reflectance: Shaped[F32, "G 3 J"],
    first: int,
    last: int,
) -> OutgoingRadiance:
    """Return the outgoing radiance of all patches by bounces, isotropic from the first reflection on, by few rays.

    Args:
        patches, reflectance_operator, incident, first, last: as in `solve_bounces`.
        mean_reflectance: from `PatchLight.mean_reflectance`.
    """
    rows, rho = reflectance_operator.rows, reflectance_operator.reflectance
    outgoing = np.asarray(rho / np.float32(np.pi) * incident.irradiance, np.float32)
    outgoing[rows] += np.einsum("gck,gck->gc", mean_reflectance, incident.coefficients)
    isotropic = _bounce_times(first - 1, patches, reflectance_operator, outgoing)
    return isotropic_radiance(preview_bounces(patches.gather_hits, patches.few_rays, rho, isotropic, last - first))


def _reflect(
    patches: PatchLight, reflectance_operator: ReflectanceOperator, outgoing: OutgoingRadiance, directions: Directions
) -> OutgoingRadiance:
    """Return the light of one further bounce."""
    light = outgoing.outgoing_light(patches, is_smoothed=False, is_positive=False)
    incident = patches.incident_light(light, outgoing.rows, is_binned=directions is Directions.BINNED)
    return first_bounce(reflectance_operator, incident)


def _bounce_times(count: int, patches: PatchLight, reflectance_operator: ReflectanceOperator, isotropic: F32) -> F32:
    """Return isotropic light after some more bounces."""
    for _ in range(count):
        isotropic = one_bounce(patches.gather_hits, reflectance_operator.reflectance, isotropic)
    return isotropic


def _num_directional_bounces(reflectance_operator: ReflectanceOperator) -> int:
    """Return the number of bounces with directions: until highlights have reflected little at each."""
    if not len(reflectance_operator.rows):
        return 1
    mean_reflectance = float(reflectance_operator.reflectance[reflectance_operator.rows].sum(dtype=np.float64)) / max(
        1, reflectance_operator.reflectance.size
    )
    return int(
        np.clip(
            np.ceil(np.log(_ENERGY_CUTOFF) / np.log(np.clip(mean_reflectance, 1e-6, 0.999))),
            _MIN_DIRECTIONAL_BOUNCES,
            _MAX_DIRECTIONAL_BOUNCES,
        )
    )
