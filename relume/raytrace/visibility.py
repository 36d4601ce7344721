"""Visibility of light triangles from any points: one bit per pair, traced in packets of 16 points per light.

`relume.raytrace.visibility_masks` traces the bits of a bake's view samples, with fewer rays;
`relume.raytrace.local_light_visibility` traces those of local lights.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges, parallel_for_chunks
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.ray_packet import (
    FAR,
    LANES,
    enable_lane,
    enable_stochastic_alpha,
    is_unoccluded,
    new_packet,
    set_direction,
    set_origin,
    trace_shadows,
)
from relume.raytrace.surface_points import FIXED_ALPHA_SAMPLE

F32 = NDArray[np.float32]

_POINTS_PER_RANGE = 512
NO_EXCLUSION = np.zeros((1, 3), np.float32)  # a normal without any light above its horizon


@nb.njit(nogil=True, cache=True)
def _trace(  # type: ignore[no-untyped-def]
    tracer, origins, normals, excluded_normals, alpha_sample, directions, start, stop, bits
):
    """Trace points [start, stop) against all lights; returns the number of rays. start is a multiple of 16."""
    packet = new_packet(tracer)
    facing = np.empty(LANES, np.bool_)
    num_lights = directions.shape[0]
    num_rays = 0
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        for k in range(LANES):
            p = first + min(k, width - 1)
            set_origin(packet, k, origins[p, 0], origins[p, 1], origins[p, 2])
            enable_stochastic_alpha(packet, k, alpha_sample[min(p, alpha_sample.shape[0] - 1)])
        for light in range(num_lights):
            x, y, z = directions[light, 0], directions[light, 1], directions[light, 2]
            num_active = 0
            for k in range(LANES):
                p = first + min(k, width - 1)
                is_above = normals[p, 0] * x + normals[p, 1] * y + normals[p, 2] * z > 0
                q = min(p, excluded_normals.shape[0] - 1)
                is_excluded = excluded_normals[q, 0] * x + excluded_normals[q, 1] * y + excluded_normals[q, 2] * z > 0
                facing[k] = is_above and not is_excluded and k < width
                enable_lane(packet, k, facing[k])
                num_active += 1 if facing[k] else 0
            if num_active == 0:
                continue
            num_rays += num_active
            for k in range(LANES):
                set_direction(packet, k, x, y, z, FAR)
            trace_shadows(packet)
            byte, bit = light >> 3, np.uint8(1 << (light & 7))
            for k in range(width):
                if facing[k] and is_unoccluded(packet, k):
                    bits[first + k, byte] |= bit
    return num_rays


@dataclass(frozen=True)
class VisibilityBits:
    """Visibility of m lights from n points, and its cost.

    Attributes:
        visible: light k of a point at bit k & 7 of byte k >> 3; ceil(m / 8) bytes.
        num_rays: number of traced rays. trace_s: wall time of tracing alone.
    """

    visible: Shaped[NDArray[np.uint8], "n bytes"]
    num_rays: int
    trace_s: float


def trace_visibility(
    scene: EmbreeScene,
    origins: Shaped[F32, "n 3"],
    normals: Shaped[F32, "n 3"],
    directions: Shaped[F32, "m 3"],
    alpha_sample: Shaped[F32, " #n"] = FIXED_ALPHA_SAMPLE,
    excluded_normals: Shaped[F32, "#n 3"] = NO_EXCLUSION,
) -> VisibilityBits:
    """Trace every point against every light above its horizon.

    Args:
        scene: the occluding triangles.
        origins: positions, offset from the surface.
        normals: shading normals; lights below their horizon are not traced and count as occluded.
        directions: unit, toward the lights.
        alpha_sample: alpha samples for the rays at blended surfaces; see `SurfacePoints`.
        excluded_normals: other normals; lights above their horizon are not traced and count as occluded too.
    Cost: O(n · m · log triangles) time.
    """
    bits = np.zeros((len(origins), (len(directions) + 7) // 8), np.uint8)
    args = scene.shadow_tracer(coherent=True), origins, normals, excluded_normals, alpha_sample, directions
    counts: list[int] = []

    def kernel(start: int, stop: int) -> None:
        counts.append(_trace(*args, start, stop, bits))

    start_time = time.perf_counter()
    for_ranges(kernel, len(origins), _POINTS_PER_RANGE)
    return VisibilityBits(bits, sum(counts), time.perf_counter() - start_time)


def above_horizon(normals: Shaped[F32, "n 3"], directions: Shaped[F32, "m 3"]) -> Shaped[NDArray[np.uint8], "n bytes"]:
    """Return the visibility of lights that nothing occludes: all above the horizons, bits as in `VisibilityBits`."""
    return np.packbits(normals @ directions.T > 0, axis=1, bitorder="little")


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _select_bits(visible, rows, lights, start, stop, out):  # type: ignore[no-untyped-def]
    for i in range(start, stop):
        for k in range(len(lights)):
            light = lights[k]
            bit = (visible[rows[i], light >> 3] >> (light & 7)) & 1
            out[i, k >> 3] |= np.uint8(bit << (k & 7))


def select_visibility(
    visible: Shaped[NDArray[np.uint8], "n bytes"],
    rows: Shaped[NDArray[np.intp], " m"],
    lights: Shaped[NDArray[np.intp], " N"],
) -> Shaped[NDArray[np.uint8], "m out_bytes"]:
    """Select visibility bits of some points and some lights.

    Args:
        visible: visibility bits of all points and lights, as in `VisibilityBits`. rows: the points. lights: the lights.
    Returns:
        Their bits, renumbered; ceil(N / 8) bytes
    """
    out = np.zeros((len(rows), -(-len(lights) // 8)), np.uint8)
    parallel_for_chunks(lambda start, stop: _select_bits(visible, rows, lights, start, stop, out), len(rows))
    return out
