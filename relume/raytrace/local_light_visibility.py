"""Visibility of the samples of a local light from each point, in packets of 16 neighboring points, and irradiance.

Both ends of a shadow ray are offset from their surfaces on the sides that face each other, to prevent self-shadowing.
For lights with many samples, the 16 points first trace one ray each to a group of four adjacent samples: if all agree,
all points see all four samples or none.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.lights.light_sampling import LightStrata
from relume.lights.local_lights import LocalLight, light_sample
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.gather_rays import cranley_patterson_offset
from relume.raytrace.ray_packet import (
    LANES,
    enable_lane,
    enable_stochastic_alpha,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]

MIN_GROUPED_SAMPLES = 1024  # number of samples from which groups of four are traced singly only if neighbors disagree
_POINTS_PER_RANGE = 4096
_GROUP_SIZE = 4


@nb.njit(nogil=True, cache=True, inline="always")
def shadow_ray(dx, dy, dz, distance, nx, ny, nz, lift):  # type: ignore[no-untyped-def]
    """Compute the shadow ray to a light sample; it ends off the light's surface.

    Args:
        dx, dy, dz, distance, nx, ny, nz, lift: from `light_sample`.
    Returns:
        Direction (three), not normalized if the ray ends, and the ray's length in units of the direction's length.
    """
    # not normalized, so that the ray ends at 1; normalized for infinite rays
    length, num_lengths = (np.float32(1), distance) if distance == np.inf else (distance, np.float32(1))
    return (
        length * dx + lift * nx,
        length * dy + lift * ny,
        length * dz + lift * nz,
        num_lengths,
    )


@nb.njit(nogil=True, cache=True, inline="always")
def _aim_packet(packet, light, strata, points, first, width, sample, num_samples):  # type: ignore[no-untyped-def]
    """Aim shadow rays of points [first, first + width) at one light sample, or at several adjacent ones.

    Args:
        packet, light, strata, points: as in `_trace`.
        sample, num_samples: lane k uses sample `sample` + k mod `num_samples`; a power of two.
    Returns:
        Number of active rays, whose points this sample may light.
    """
    position, normal, _, seed, alpha_sample = points
    num_active = 0
    for k in range(LANES):
        p = first + min(k, width - 1)
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = cranley_patterson_offset(strata, seed[p])
        dx, dy, dz, distance, weight, nx, ny, nz, lift = light_sample(
            light, strata, sample + (k & (num_samples - 1)), shift_u, shift_v, x, y, z
        )
        is_above = dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2] > 0
        is_active = k < width and is_above and weight > 0
        enable_lane(packet, k, is_active)
        num_active += 1 if is_active else 0
        along_x, along_y, along_z, num_lengths = shadow_ray(dx, dy, dz, distance, nx, ny, nz, lift)
        set_origin(packet, k, x, y, z)
        enable_stochastic_alpha(packet, k, alpha_sample[min(p, alpha_sample.shape[0] - 1)])
        set_direction(packet, k, along_x, along_y, along_z, num_lengths)
    return num_active


@nb.njit(nogil=True, cache=True, inline="always")
def _count_unoccluded(packet, width):  # type: ignore[no-untyped-def]
    """Count the traced rays that are unoccluded."""
    count = 0
    for k in range(width):
        count += 1 if packet.is_active[k] != 0 and is_unoccluded(packet, k) else 0
    return count


@nb.njit(nogil=True, cache=True)
def _trace(tracer, light, strata, points, start, stop, bits):  # type: ignore[no-untyped-def]
    """Trace points [start, stop); start is a multiple of 16."""
    packet, num = new_packet(tracer), strata.uv.shape[0]
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        for group in range(0, num, _GROUP_SIZE):
            all_unoccluded = False
            if (
                num >= MIN_GROUPED_SAMPLES
                and _aim_packet(packet, light, strata, points, first, width, group, _GROUP_SIZE) == width
            ):
                trace_shadows(packet)
                num_unoccluded = _count_unoccluded(packet, width)
                if num_unoccluded == 0:
                    continue
                all_unoccluded = num_unoccluded == width
            for sample in range(group, min(group + _GROUP_SIZE, num)):
                if _aim_packet(packet, light, strata, points, first, width, sample, 1) == 0:
                    continue
                if not all_unoccluded:
                    trace_shadows(packet)
                for k in range(width):
                    if packet.is_active[k] != 0 and (all_unoccluded or is_unoccluded(packet, k)):
                        bits[first + k, sample >> 3] |= np.uint8(1 << (sample & 7))


def trace_light_visibility(
    scene: EmbreeScene, light: LocalLight, strata: LightStrata, points: SurfacePoints
) -> Shaped[NDArray[np.uint8], "n bytes"]:
    """Trace every point against every light sample above its horizon with nonzero weight.

    Args:
        scene: the occluding triangles.
        light: the light. strata: its samples, from `make_light_strata`, shifted by the points' seeds.
        points: n points that the light may reach, ordered by neighborhood.
    Returns:
        Visibility of sample k at bit k & 7 of byte k >> 3; ceil(samples / 8) bytes
    """
    bits = np.zeros((points.num_points, (len(strata.uv) + 7) // 8), np.uint8)
    args = scene.shadow_tracer(coherent=True), light, strata, points
    for_ranges(lambda start, stop: _trace(*args, start, stop, bits), points.num_points, _POINTS_PER_RANGE)
    return bits


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _sum_irradiance(light, strata, points, visible, start, stop, irradiance):  # type: ignore[no-untyped-def]
    """Add the irradiance of points [start, stop) from visible samples to `irradiance`. (n,)"""
    position, normal, _, seed, _ = points
    for p in range(start, stop):
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = cranley_patterson_offset(strata, seed[p])
        total = 0.0
        for sample in range(strata.uv.shape[0]):
            if (visible[p, sample >> 3] >> (sample & 7)) & 1:
                dx, dy, dz, _, weight, _, _, _, _ = light_sample(light, strata, sample, shift_u, shift_v, x, y, z)
                total += weight * max(dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2], np.float32(0))
        irradiance[p] = total


def compute_irradiance(
    light: LocalLight, strata: LightStrata, points: SurfacePoints, visible: Shaped[NDArray[np.uint8], "n bytes"]
) -> Shaped[F32, " n"]:
    """Irradiance E of points under a light of unit emission (see `relume.lights.local_lights`).

    Args:
        light, strata, points: as in `trace_light_visibility`. visible: its result.
    """
    out = np.empty(points.num_points, np.float32)
    args = (light, strata, points, visible)
    for_ranges(lambda start, stop: _sum_irradiance(*args, start, stop, out), points.num_points, _POINTS_PER_RANGE)
    return out
