"""Direct light of a local light during a drag: shadows traced at few points and predicted between them.

Successive points are neighbors in the image. In a block of 64, every fourth point is traced against all samples of the
light. If all these rays agree, the light is visible or occluded for the other points too; otherwise all of them are
traced. So shadow edges are traced, except for shadows so thin that no ray hits them: they appear when the light stops
and `relume.raytrace.local_light_visibility` traces every ray.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.lights.light_sampling import LightStrata
from relume.lights.local_lights import LocalLight, light_sample
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.raytrace.local_light_visibility import shadow_ray
from relume.raytrace.ray_packet import (
    LANES,
    enable_first_lanes,
    enable_stochastic_alpha,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

BLOCK = 64


class MovingLight(NamedTuple):
    """Direct light of a light of unit emission at n points.

    Attributes:
        irradiance: E of each point.
        visible: visibility of sample k at bit k & 7 of byte k >> 3; ceil(samples / 8) bytes.
    """

    irradiance: Shaped[F32, " n"]
    visible: Shaped[NDArray[np.uint8], "n bytes"]


@nb.njit(nogil=True, cache=True, inline="always")
def is_seed_sample(k):  # type: ignore[no-untyped-def]
    """True if point k of a block is always traced: the corners of squares of 4 × 4 along a Morton curve."""
    return k & 3 == (k >> 2) & 3


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _flush(packet, num_waiting, visible):  # type: ignore[no-untyped-def]
    """Trace the rays in the first lanes; returns the number of rays that reach the light."""
    enable_first_lanes(packet, num_waiting)
    trace_shadows(packet)
    num_visible = 0
    for lane in range(num_waiting):
        is_lane_visible = is_unoccluded(packet, lane)
        visible[packet.owner[lane]] = is_lane_visible
        num_visible += 1 if is_lane_visible else 0
    return num_visible


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _trace_points(packet, points, first, width, rays, contribution, are_seeds, visible):  # type: ignore[no-untyped-def]
    """Trace the rays with a contribution from the seed points of a block, or from its other points.

    Returns:
        Number of traced rays, and number of rays that reach the light.
    """
    position, alpha_sample, num_rays, num_visible = points.position, points.alpha_sample, 0, 0
    for r in range(contribution.shape[0]):
        k = r & (BLOCK - 1)
        if k >= width or contribution[r] <= 0 or is_seed_sample(k) != are_seeds:
            continue
        lane, p = num_rays & (LANES - 1), first + k
        packet.owner[lane] = r
        set_origin(packet, lane, position[p, 0], position[p, 1], position[p, 2])
        enable_stochastic_alpha(packet, lane, alpha_sample[min(p, alpha_sample.shape[0] - 1)])
        set_direction(packet, lane, rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3])
        num_rays += 1
        if lane == LANES - 1:
            num_visible += _flush(packet, LANES, visible)
    if num_rays & (LANES - 1):
        num_visible += _flush(packet, num_rays & (LANES - 1), visible)
    return num_rays, num_visible


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _aim(light, strata, points, first, width, rays, contribution):  # type: ignore[no-untyped-def]
    """Aim the rays of a block's points, `BLOCK` rays per sample: direction and end, and w · cos θi."""
    position, normal, _, seed, _ = points
    for k in range(width):
        p = first + k
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = cranley_patterson_offset(strata, seed[p])
        for sample in range(strata.uv.shape[0]):
            r = sample * BLOCK + k
            dx, dy, dz, distance, weight, nx, ny, nz, lift = light_sample(
                light, strata, sample, shift_u, shift_v, x, y, z
            )
            contribution[r] = weight * (dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2])
            rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3] = shadow_ray(dx, dy, dz, distance, nx, ny, nz, lift)


@nb.njit(nogil=True, cache=True)
def _light_block(tracer, light, strata, points, start, stop, irradiance, bits):  # type: ignore[no-untyped-def]
    """Compute the light at points [start, stop); start is a multiple of `BLOCK`."""
    packet = new_packet(tracer)
    num_rays = BLOCK * strata.uv.shape[0]
    rays, contribution, visible = (
        np.empty((num_rays, 4), np.float32),
        np.empty(num_rays, np.float32),
        np.empty(num_rays, np.bool_),
    )
    for first in range(start, stop, BLOCK):
        width = min(BLOCK, stop - first)
        _aim(light, strata, points, first, width, rays, contribution)
        num_traced, num_visible = _trace_points(packet, points, first, width, rays, contribution, True, visible)
        if num_traced > 0 and num_visible == 0:
            continue
        is_fully_lit = num_traced > 0 and num_visible == num_traced
        if not is_fully_lit:
            _trace_points(packet, points, first, width, rays, contribution, False, visible)
        for sample in range(strata.uv.shape[0]):
            byte, bit = sample >> 3, np.uint8(1 << (sample & 7))
            for k in range(width):
                r = sample * BLOCK + k
                if contribution[r] > 0 and (is_fully_lit or visible[r]):
                    irradiance[first + k] += contribution[r]
                    bits[first + k, byte] |= bit


def trace_moving_light(
    scene: EmbreeScene, light: LocalLight, strata: LightStrata, points: SurfacePoints
) -> MovingLight:
    """Compute the light at points; trace shadow edges and predict elsewhere.

    Args:
        scene: the occluding triangles.
        light: the light. strata: its samples, from `make_light_strata`, shifted by the points' seeds.
        points: n points that the light may reach, mostly ordered by neighborhood.
    """
    num, num_bytes = points.num_points, (len(strata.uv) + 7) // 8
    moving_light = MovingLight(np.zeros(num, np.float32), np.zeros((num, num_bytes), np.uint8))
    args = scene.shadow_tracer(coherent=True), light, strata, points

    def kernel(start: int, stop: int) -> None:
        first, last = start * BLOCK, min(stop * BLOCK, num)
        _light_block(*args, first, last, *moving_light)

    parallel_for_chunks(kernel, -(-num // BLOCK))
    return moving_light
