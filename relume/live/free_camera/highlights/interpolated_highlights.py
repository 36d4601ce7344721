"""Environment highlights between probes: each pixel evaluates a lobe, and probes interpolate the rest.

    B(pixel) = L(pixel) + Σ_probes w (B − L),   L(ωo) = a(θo) (V L̄(ωm, σ) + Σ_lights V_j L̄_j(ωm, σ))

L is the environment in a lobe (`relume.live.free_camera.basis.highlight_lobes`) times its visibility from a probe: a
control variate. In fine frames, and if one lobe would fit the highlight badly, it is L_2, the environment in two lobes.
It is the part that varies fastest on curved surfaces, twice as fast as normals. B is summed over lights
(`relume.live.free_camera.highlights.light_sum_kernel`), or it is Σ_k p_k t_k of the environment, if the basis
represents that. Next to bright regions the basis rings, so its value is clamped to multiples of L_2; the larger the
residual of the basis, the smaller the multiple. Lights are summed for the normal of a probe: if a normal map perturbs
normals by more than the width of a lobe, only L_2 is used.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.basis.highlight_lobes import Lobes
from relume.live.free_camera.basis.table_index import view_direction
from relume.live.free_camera.highlights.environment_lobe_lookup import (
    PrefilteredEnvironment,
    add_environment_in_lobe,
    evaluate_lobe,
    evaluate_two_lobes,
)
from relume.live.free_camera.shade_probes import ProbeRadiance
from relume.probes.stored_scene import ViewedProbes

F32 = NDArray[np.float32]

NORMAL_VARIANCE_FACTOR = np.float32(4)  # a reflected direction turns twice as far as the normal


class ProbeHighlights(NamedTuple):
    """The environment's highlights at probes.

    Attributes:
        lobe_visibility: along lobes, from `relume.live.free_camera.highlights.lobe_visibility`.
        light_sums: from `relume.live.free_camera.highlights.light_sum_kernel`.
    """

    lobe_visibility: Shaped[F32, "probes 3"]
    light_sums: Shaped[F32, "probes 3"]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _add_highlights(viewed, lobes, environment, highlights, normal_variation, is_fine, start, stop, scratch, outgoing):  # type: ignore[no-untyped-def]
    """Add B − L to the radiance of probes rows[start:stop]. scratch: (2, 3). outgoing: `ProbeRadiance`"""
    material, normal, (lobe_visibility, light_sums) = viewed.material, viewed.points.normal, highlights
    (radiance, basis_radiance), lobe_radiance, two_lobe_radiance = outgoing, scratch[0], scratch[1]
    for p in viewed.rows[start:stop]:
        lobe = lobes.lobe_index[material[p]]
        if lobe < 0:
            continue
        n = normal[p, 0], normal[p, 1], normal[p, 2]
        x, y, z = view_direction(viewed, p)
        d = -x, -y, -z
        visibility = lobe_visibility[p, 0], lobe_visibility[p, 1], lobe_visibility[p, 2]
        for channel in range(3):
            lobe_radiance[channel] = two_lobe_radiance[channel] = 0
        row, fraction, direction_1, direction_2, weight_1, sigma_1, sigma_2 = evaluate_two_lobes(lobes, lobe, n, d)
        add_environment_in_lobe(environment, visibility, direction_1, sigma_1, weight_1, two_lobe_radiance)
        add_environment_in_lobe(
            environment, visibility, direction_2, sigma_2, np.float32(1) - weight_1, two_lobe_radiance
        )
        if is_fine or lobes.is_two[lobe]:
            lobe_radiance[0], lobe_radiance[1], lobe_radiance[2] = (
                two_lobe_radiance[0],
                two_lobe_radiance[1],
                two_lobe_radiance[2],
            )
        else:
            _, _, direction, single_sigma = evaluate_lobe(lobes, lobe, n, d)
            add_environment_in_lobe(environment, visibility, direction, single_sigma, np.float32(1), lobe_radiance)
        max_ratio, lower = lobes.max_ratio[lobe], lobes.lobe_confidence[lobe, row]
        confidence = lower + fraction * (lobes.lobe_confidence[lobe, row + 1] - lower)
        sigma_1 = min(sigma_1, sigma_2)
        normal_factor = sigma_1 * sigma_1 / (sigma_1 * sigma_1 + NORMAL_VARIANCE_FACTOR * normal_variation[material[p]])
        for channel in range(3):
            two_lobe_radiance[channel] += normal_factor * (
                light_sums[p, channel] - (np.float32(1) - confidence) * two_lobe_radiance[channel]
            )
        for group in range(radiance.shape[1]):
            for channel in range(3):
                lower = lobes.albedo[lobe, row, group, channel]
                albedo = environment.gain[channel] * (
                    lower + fraction * (lobes.albedo[lobe, row + 1, group, channel] - lower)
                )
                estimate = albedo * two_lobe_radiance[channel]
                clamped = min(max(basis_radiance[p, group, channel], estimate / max_ratio), estimate * max_ratio)
                radiance[p, group, channel] += clamped - albedo * lobe_radiance[channel]


def add_environment_highlights(
    viewed: ViewedProbes,
    lobes: Lobes,
    environment: PrefilteredEnvironment,
    highlights: ProbeHighlights,
    normal_variation: Shaped[F32, " materials"],
    outgoing: ProbeRadiance,
    *,
    is_fine: bool,
) -> None:
    """Add the probes' environment highlights, minus the lobes that pixels evaluate.

    Args:
        viewed: the probes to evaluate. lobes: of all materials. environment: prefiltered.
        highlights: of all probes. normal_variation: of `StoredScene`.
        outgoing: its radiance is added to. is_fine: pixels evaluate two lobes, not one.
    """
    args = viewed, lobes, environment, highlights, normal_variation, is_fine

    def add(start: int, stop: int) -> None:
        _add_highlights(*args, start, stop, np.empty((2, 3), np.float32), outgoing)

    parallel_for_chunks(add, len(viewed.rows))
