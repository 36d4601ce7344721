"""Which samples of a local light each point sees, in packets of 16 neighbouring points × one sample; and their sum.

Both ends of a shadow ray lie off their surfaces, on the sides that face each other: neither shadows itself. Of lights
of very many samples, four that lie side by side are asked by 16 points together, each of which asks for one of them:
where all agree, all see all four or none.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.light.gather_rays import shift_of
from relume.light.local import LocalLight, light_sample
from relume.light.strata import Strata
from relume.parallel import for_ranges
from relume.points import Points
from relume.trace.embree import EmbreeScene, occluded, packet_arguments
from relume.trace.packet import LANES, aim, ask, is_free, new_packet, set_origin, take_chance, trace_shadows
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

MANY = 1024  # samples, of which four side by side are traced one by one only where neighbours do not see them alike
_POINTS_A_RANGE = 4096
_SIDE_BY_SIDE = 4


@nb.njit(nogil=True, cache=True, inline="always")
def shadow_ray(dx, dy, dz, distance, nx, ny, nz, off_surface):  # type: ignore[no-untyped-def]
    """Aim the shadow ray to a sample of a light, off whose surface it ends.

    Args:
        dx, dy, dz, distance, nx, ny, nz: from `light_sample`. off_surface: metres.
    Returns:
        Direction (three), not normalised where the ray ends, and how many times its length the ray is long.
    """
    # not normalised, but where it never ends: it ends at one
    length, far = (np.float32(1), distance) if distance == np.inf else (distance, np.float32(1))
    return length * dx + off_surface * nx, length * dy + off_surface * ny, length * dz + off_surface * nz, far


@nb.njit(nogil=True, cache=True, inline="always")
def _aim_packet(packet, light, strata, off_surface, points, first, width, sample, spread):  # type: ignore[no-untyped-def]
    """Aim shadow rays of points [first, first + width) at one sample of a light, or at several side by side.

    Args:
        packet, light, strata, off_surface, points: as in `_trace`.
        sample, spread: lane k's is `sample` + k mod `spread`; a power of two.
    Returns:
        How many of them are to be traced: those of points that this sample may light.
    """
    position, normal, _, seed, chance = points
    active = 0
    for k in range(LANES):
        p = first + min(k, width - 1)
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = shift_of(strata, seed[p])
        dx, dy, dz, distance, weight, nx, ny, nz = light_sample(
            light, strata, sample + (k & (spread - 1)), shift_u, shift_v, x, y, z
        )
        above = dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2] > 0
        is_asked = k < width and above and weight > 0
        ask(packet, k, is_asked)
        active += 1 if is_asked else 0
        along_x, along_y, along_z, far = shadow_ray(dx, dy, dz, distance, nx, ny, nz, off_surface)
        set_origin(packet, k, x, y, z)
        take_chance(packet, k, chance[min(p, chance.shape[0] - 1)])
        aim(packet, k, along_x, along_y, along_z, far)
    return active


@nb.njit(nogil=True, cache=True, inline="always")
def _num_free(packet, width):  # type: ignore[no-untyped-def]
    """Count the traced rays that met nothing."""
    found = 0
    for k in range(width):
        found += 1 if packet.is_asked[k] != 0 and is_free(packet, k) else 0
    return found


@nb.njit(nogil=True, cache=True)
def _trace(  # type: ignore[no-untyped-def]
    occluded, scene, arguments, light, strata, off_surface, points, start, stop, bits
):
    """Trace points [start, stop); start is a multiple of 16."""
    packet, num = new_packet(scene, arguments), strata.uv.shape[0]
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        for group in range(0, num, _SIDE_BY_SIDE):
            is_free_of_all = False
            if (
                num >= MANY
                and _aim_packet(packet, light, strata, off_surface, points, first, width, group, _SIDE_BY_SIDE) == width
            ):
                trace_shadows(occluded, packet)
                free = _num_free(packet, width)
                if free == 0:
                    continue
                is_free_of_all = free == width
            for sample in range(group, min(group + _SIDE_BY_SIDE, num)):
                if _aim_packet(packet, light, strata, off_surface, points, first, width, sample, 1) == 0:
                    continue
                if not is_free_of_all:
                    trace_shadows(occluded, packet)
                for k in range(width):
                    if packet.is_asked[k] != 0 and (is_free_of_all or is_free(packet, k)):
                        bits[first + k, sample >> 3] |= np.uint8(1 << (sample & 7))


def trace_local(
    scene: EmbreeScene, off_surface: float, light: LocalLight, strata: Strata, points: Points
) -> NDArray[np.uint8]:
    """Trace every point against every sample of a light that is above its horizon and gives it light.

    Args:
        scene: the triangles that may be in the way.
        off_surface: metres by which rays end before the light's own surface.
        light: the light. strata: its samples, from `strata_of`; the points' seeds shift them.
        points: n points that the light may reach; neighbours follow each other.
    Returns:
        Sample k of a point in bit k & 7 of byte k >> 3. (n, ceil(samples / 8)) uint8
    """
    bits = np.zeros((points.num_points, (len(strata.uv) + 7) // 8), np.uint8)
    arguments = packet_arguments(coherent=True)
    args = (light, strata, np.float32(off_surface), points)
    for_ranges(
        lambda start, stop: _trace(occluded, scene.handle, arguments.ctypes.data, *args, start, stop, bits),
        points.num_points,
        _POINTS_A_RANGE,
    )
    return bits


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _arriving(light, strata, points, visible, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum what points [start, stop) see of a light into `out`. (n,)"""
    position, normal, _, seed, _ = points
    for p in range(start, stop):
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = shift_of(strata, seed[p])
        total = 0.0
        for sample in range(strata.uv.shape[0]):
            if (visible[p, sample >> 3] >> (sample & 7)) & 1:
                dx, dy, dz, _, weight, _, _, _ = light_sample(light, strata, sample, shift_u, shift_v, x, y, z)
                total += weight * max(dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2], np.float32(0))
        out[p] = total


def arriving(light: LocalLight, strata: Strata, points: Points, visible: NDArray[np.uint8]) -> F32:
    """Irradiance of points under a light of unit emission.

    Args:
        light, strata, points: as `trace_local` had them. visible: what it returned. (n, bytes) uint8
    Returns:
        E over the unit of emission (see `relume.light.local`). (n,) float32
    """
    out = np.empty(points.num_points, np.float32)
    args = (light, strata, points, visible)
    for_ranges(lambda start, stop: _arriving(*args, start, stop, out), points.num_points, _POINTS_A_RANGE)
    return out
