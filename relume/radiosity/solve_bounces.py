"""Indirect light of patches, bounce by bounce, until it is isotropic.

    t^0: from the lights;   L^b = F t^b;   t^(b+1)(c) = mean over the rays r of c of π L^b(hit(c, r), −ω_r) h(ω_r)

The first bounces keep directions, the more of them the more light highlights reflect. Later light has come from
everywhere: from then on a patch radiates isotropically, with the mean of its directional light
(`relume.radiosity.bounce`). For direct light, sharp highlights use tables in place of the low-degree basis
(`relume.radiosity.highlight_transport`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.radiosity.bounce import bounces, one_bounce, preview_bounces
from relume.radiosity.coarse_irradiance import incident_fast
from relume.radiosity.outgoing_radiance import EMPTY_BINS, OutgoingHighlights, OutgoingRadiance, first_bounce, pad
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import IncidentLight, ReflectanceOperator

F32 = NDArray[np.float32]

_MIN_DIRECTIONAL_BOUNCES, _MAX_DIRECTIONAL_BOUNCES = 2, 4
_ENERGY_CUTOFF = 0.1  # fraction of the light that highlights have reflected at each bounce


def solve_indirect(
    patches: PatchLight,
    reflectance_operator: ReflectanceOperator,
    incident: IncidentLight,
    first: int,
    last: int,
    outgoing_highlights: OutgoingHighlights | None = None,
) -> OutgoingRadiance:
    """Return the outgoing radiance of all patches by bounces `first` to `last`.

    Args:
        patches: patches of the bake. reflectance_operator: reflectance operator of the patches.
        incident: direct light. first: at least 1. last: at least `first`.
        outgoing_highlights: sharp highlights and their direct light; None: these use the low-degree basis.
    """
    gather_hits, rho = patches.gather_hits, reflectance_operator.reflectance

    def reflect(outgoing: OutgoingRadiance) -> OutgoingRadiance:
        return first_bounce(
            reflectance_operator,
            patches.incident_light(outgoing.outgoing_light(patches, to_narrow_lobes=False), outgoing.rows),
        )

    first_outgoing = first_bounce(reflectance_operator, incident, outgoing_highlights)
    return _sum_bounces(
        patches,
        reflectance_operator,
        first_outgoing,
        first,
        last,
        reflect,
        lambda even, num: bounces(gather_hits, rho, even, num),
    )


def _num_directional_bounces(reflectance_operator: ReflectanceOperator) -> int:
    """Return the number of bounces with directions: until highlights have reflected little at each."""
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


def solve_indirect_fast(
    patches: PatchLight,
    reflectance_operator: ReflectanceOperator,
    incident: IncidentLight,
    first: int,
    last: int,
    outgoing_highlights: OutgoingHighlights | None = None,
) -> OutgoingRadiance:
    """Approximate `solve_indirect` for an active edit: direction bins, and fewer rays for isotropic light.

    Args:
        patches, reflectance_operator, incident, first, last, outgoing_highlights: as in `solve_indirect`.
    """
    gather_hits, few_rays, rho = patches.gather_hits, patches.few_rays, reflectance_operator.reflectance

    def reflect(outgoing: OutgoingRadiance) -> OutgoingRadiance:
        return first_bounce(
            reflectance_operator,
            incident_fast(patches, outgoing.outgoing_light(patches, to_narrow_lobes=False), outgoing.rows),
        )

    return _sum_bounces(
        patches, reflectance_operator, first_bounce(reflectance_operator, incident, outgoing_highlights), first, last,
        reflect,
        lambda even, num: preview_bounces(gather_hits, few_rays, rho, even, num),
    )  # fmt: skip


def _sum_bounces(
    patches: PatchLight, reflectance_operator: ReflectanceOperator, first_outgoing: OutgoingRadiance, first: int,
    last: int,
    reflect: Callable[[OutgoingRadiance], OutgoingRadiance], sum_isotropic: Callable[[F32, int], F32],
) -> OutgoingRadiance:  # fmt: skip
    """Sum bounces between patches.

    Args:
        first_outgoing: reflected direct light.
        reflect: reflects directional light once more.
        sum_isotropic: sums isotropic light over further bounces.
    """
    outgoing, bounce_index = first_outgoing, 1
    num_directional = min(last, _num_directional_bounces(reflectance_operator)) if len(first_outgoing.rows) else 1
    total, coefficients = (
        float(first == 1) * array.astype(np.float64)
        for array in (first_outgoing.isotropic, first_outgoing.coefficients)
    )
    while bounce_index < num_directional:
        outgoing, bounce_index = reflect(outgoing), bounce_index + 1
        if bounce_index >= first:
            total, coefficients = total + outgoing.isotropic, coefficients + outgoing.coefficients
    if bounce_index < last:
        isotropic = outgoing.mean_to_others(patches)
        start = max(first, bounce_index + 1)
        for _ in range(start - bounce_index):
            isotropic = one_bounce(patches.gather_hits, reflectance_operator.reflectance, isotropic)
        total += sum_isotropic(isotropic, last - start)
    outgoing_fields = total.astype(np.float32), first_outgoing.rows, coefficients.astype(np.float32)
    return OutgoingRadiance(
        *outgoing_fields, first_outgoing.roughening, first_outgoing.bins if first == 1 else EMPTY_BINS
    )


def solve_indirect_preview(
    patches: PatchLight, reflectance_operator: ReflectanceOperator, incident: IncidentLight, first: int, last: int
) -> Shaped[F32, "padded 3"]:
    """Approximate `solve_indirect` by the mean radiance toward other patches, without directions.

    Args:
        patches, reflectance_operator, incident, first, last: as in `solve_indirect`.
    """
    isotropic = patches.mean_to_others(*reflectance_operator.apply(incident), reflectance_operator.rows)
    for _ in range(first - 1):
        isotropic = one_bounce(patches.gather_hits, reflectance_operator.reflectance, isotropic)
    return pad(
        preview_bounces(
            patches.gather_hits, patches.few_rays, reflectance_operator.reflectance, isotropic, last - first
        )
    )
