"""What comes directly from a local light that moves: shadows traced at few points and predicted between them.

Points that follow each other are neighbours in the picture. Of a block of 64, every fourth is traced against all
samples of the light. Where all these rays agree, the light reaches the other points too, or none of them; where they do
not, all others are traced as well. So edges of shadows are traced, but for shadows so thin that no ray asks about them:
they come when the light rests and `relume.raytrace.light_visibility` traces every ray.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.core.numba_options import UNCOUNTED
from relume.core.thread_pools import parallel_for_chunks
from relume.lights.light_sampling import LightStrata
from relume.lights.local_lights import LocalLight, light_sample
from relume.raytrace.embree import EmbreeScene, occluded, packet_arguments
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.raytrace.light_visibility import shadow_ray
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
    """What a light of unit emission gives to n points.

    Attributes:
        irradiance: E of each point. (n,) float32
        visible: sample k of a point in bit k & 7 of byte k >> 3. (n, ceil(samples / 8)) uint8
    """

    irradiance: F32
    visible: NDArray[np.uint8]


@nb.njit(nogil=True, cache=True, inline="always")
def is_seed_sample(k):  # type: ignore[no-untyped-def]
    """Tell whether a point of a block is traced in any case: the corners of squares of 4 × 4 along a Morton curve."""
    return k & 3 == (k >> 2) & 3


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _flush(occluded, packet, num_waiting, visible):  # type: ignore[no-untyped-def]
    """Trace the rays of the first lanes, which belong to rays of the block; returns how many reach the light."""
    enable_first_lanes(packet, num_waiting)
    trace_shadows(occluded, packet)
    num_visible = 0
    for lane in range(num_waiting):
        is_lane_visible = is_unoccluded(packet, lane)
        visible[packet.owner[lane]] = is_lane_visible
        num_visible += 1 if is_lane_visible else 0
    return num_visible


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _trace_points(occluded, packet, position, alpha_sample, first, width, rays, contribution, are_seeds, visible):  # type: ignore[no-untyped-def]
    """Trace the rays that would bring light to the probes of a block, or to its other points.

    Returns:
        How many rays were traced, and how many of them reach the light.
    """
    num_rays, num_visible = 0, 0
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
            num_visible += _flush(occluded, packet, LANES, visible)
    if num_rays & (LANES - 1):
        num_visible += _flush(occluded, packet, num_rays & (LANES - 1), visible)
    return num_rays, num_visible


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _aim(light, strata, surface_offset, points, first, width, rays, contribution):  # type: ignore[no-untyped-def]
    """Aim the rays of a block's points, sample after sample of `BLOCK` each: direction and end, and w · cos θi."""
    position, normal, _, seed, _ = points
    for k in range(width):
        p = first + k
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = cranley_patterson_offset(strata, seed[p])
        for sample in range(strata.uv.shape[0]):
            r = sample * BLOCK + k
            dx, dy, dz, distance, weight, nx, ny, nz = light_sample(light, strata, sample, shift_u, shift_v, x, y, z)
            contribution[r] = weight * (dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2])
            rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3] = shadow_ray(
                dx, dy, dz, distance, nx, ny, nz, surface_offset
            )


@nb.njit(nogil=True, cache=True)
def _light_block(  # type: ignore[no-untyped-def]
    occluded, scene, arguments, light, strata, surface_offset, points, start, stop, irradiance, bits
):
    """Light points [start, stop); start is a multiple of `BLOCK`."""
    packet = new_packet(scene, arguments)
    num_rays = BLOCK * strata.uv.shape[0]
    rays, contribution, visible = (
        np.empty((num_rays, 4), np.float32),
        np.empty(num_rays, np.float32),
        np.empty(num_rays, np.bool_),
    )
    for first in range(start, stop, BLOCK):
        width = min(BLOCK, stop - first)
        _aim(light, strata, surface_offset, points, first, width, rays, contribution)
        num_traced, num_visible = _trace_points(
            occluded, packet, points.position, points.alpha_sample, first, width, rays, contribution, True, visible
        )
        if num_traced > 0 and num_visible == 0:
            continue
        is_fully_lit = num_traced > 0 and num_visible == num_traced
        if not is_fully_lit:
            _trace_points(
                occluded, packet, points.position, points.alpha_sample, first, width, rays, contribution, False, visible
            )
        for sample in range(strata.uv.shape[0]):
            byte, bit = sample >> 3, np.uint8(1 << (sample & 7))
            for k in range(width):
                r = sample * BLOCK + k
                if contribution[r] > 0 and (is_fully_lit or visible[r]):
                    irradiance[first + k] += contribution[r]
                    bits[first + k, byte] |= bit


def trace_moving_light(
    scene: EmbreeScene, surface_offset: float, light: LocalLight, strata: LightStrata, points: SurfacePoints
) -> MovingLight:
    """Light points, tracing where shadows end and predicting elsewhere.

    Args:
        scene: the triangles that may be in the way.
        surface_offset: metres by which rays end before the light's own surface.
        light: the light. strata: its samples, from `make_light_strata`; the points' seeds shift them.
        points: n points that the light may reach, neighbours in the picture mostly next to each other.
    """
    num, num_bytes = points.num_points, (len(strata.uv) + 7) // 8
    moving_light = MovingLight(np.zeros(num, np.float32), np.zeros((num, num_bytes), np.uint8))
    arguments = packet_arguments(coherent=True)
    args = (light, strata, np.float32(surface_offset), points)

    def kernel(start: int, stop: int) -> None:
        first, last = start * BLOCK, min(stop * BLOCK, num)
        _light_block(occluded, scene.handle, arguments.ctypes.data, *args, first, last, *moving_light)

    parallel_for_chunks(kernel, -(-num // BLOCK))
    return moving_light
