"""What comes directly from a local light that moves: shadows traced at few points and predicted between them.

Points that follow each other are neighbours in the picture. Of a block of 64, every fourth is traced against all
samples of the light. Where all these rays agree, the light reaches the other points too, or none of them; where they do
not, all others are traced as well. So edges of shadows are traced, but for shadows so thin that no ray asks about them:
they come when the light rests and `relume.trace.local_shadows` traces every ray.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.light.gather_rays import shift_of
from relume.light.local import LocalLight, light_sample
from relume.light.strata import Strata
from relume.parallel import for_shares
from relume.points import Points
from relume.trace.embree import EmbreeScene, occluded, packet_arguments
from relume.trace.local_shadows import shadow_ray
from relume.trace.packet import LANES, aim, ask_first, is_free, new_packet, set_origin, take_chance, trace_shadows
from relume.uncounted import UNCOUNTED

F32 = NDArray[np.float32]

BLOCK = 64


class PreviewLight(NamedTuple):
    """What a light of unit emission gives to n points.

    Attributes:
        arriving: E of each point. (n,) float32
        visible: sample k of a point in bit k & 7 of byte k >> 3. (n, ceil(samples / 8)) uint8
    """

    arriving: F32
    visible: NDArray[np.uint8]


@nb.njit(nogil=True, cache=True, inline="always")
def is_probe(k):  # type: ignore[no-untyped-def]
    """Tell whether a point of a block is traced in any case: the corners of squares of 4 × 4 along a Morton curve."""
    return k & 3 == (k >> 2) & 3


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _flush(occluded, packet, waiting, seen):  # type: ignore[no-untyped-def]
    """Trace the rays of the first lanes, which belong to rays of the block; returns how many reach the light."""
    ask_first(packet, waiting)
    trace_shadows(occluded, packet)
    num_seen = 0
    for lane in range(waiting):
        is_seen = is_free(packet, lane)
        seen[packet.owner[lane]] = is_seen
        num_seen += 1 if is_seen else 0
    return num_seen


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _ask(occluded, packet, position, chance, first, width, rays, given, are_probes, seen):  # type: ignore[no-untyped-def]
    """Trace the rays that would bring light to the probes of a block, or to its other points.

    Returns:
        How many rays were traced, and how many of them reach the light.
    """
    asked, num_seen = 0, 0
    for r in range(given.shape[0]):
        k = r & (BLOCK - 1)
        if k >= width or given[r] <= 0 or is_probe(k) != are_probes:
            continue
        lane, p = asked & (LANES - 1), first + k
        packet.owner[lane] = r
        set_origin(packet, lane, position[p, 0], position[p, 1], position[p, 2])
        take_chance(packet, lane, chance[min(p, chance.shape[0] - 1)])
        aim(packet, lane, rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3])
        asked += 1
        if lane == LANES - 1:
            num_seen += _flush(occluded, packet, LANES, seen)
    if asked & (LANES - 1):
        num_seen += _flush(occluded, packet, asked & (LANES - 1), seen)
    return asked, num_seen


@nb.njit(nogil=True, cache=True, **UNCOUNTED)
def _aim(light, strata, off_surface, points, first, width, rays, given):  # type: ignore[no-untyped-def]
    """Aim the rays of a block's points, sample after sample of `BLOCK` each: direction and end, and w · cos θi."""
    position, normal, _, seed, _ = points
    for k in range(width):
        p = first + k
        x, y, z = position[p, 0], position[p, 1], position[p, 2]
        shift_u, shift_v = shift_of(strata, seed[p])
        for sample in range(strata.uv.shape[0]):
            r = sample * BLOCK + k
            dx, dy, dz, distance, weight, nx, ny, nz = light_sample(light, strata, sample, shift_u, shift_v, x, y, z)
            given[r] = weight * (dx * normal[p, 0] + dy * normal[p, 1] + dz * normal[p, 2])
            rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3] = shadow_ray(dx, dy, dz, distance, nx, ny, nz, off_surface)


@nb.njit(nogil=True, cache=True)
def _light(  # type: ignore[no-untyped-def]
    occluded, scene, arguments, light, strata, off_surface, points, start, stop, arriving, bits
):
    """Light points [start, stop); start is a multiple of `BLOCK`."""
    packet = new_packet(scene, arguments)
    num_rays = BLOCK * strata.uv.shape[0]
    rays, given, seen = (
        np.empty((num_rays, 4), np.float32),
        np.empty(num_rays, np.float32),
        np.empty(num_rays, np.bool_),
    )
    for first in range(start, stop, BLOCK):
        width = min(BLOCK, stop - first)
        _aim(light, strata, off_surface, points, first, width, rays, given)
        asked, num_seen = _ask(occluded, packet, points.position, points.chance, first, width, rays, given, True, seen)
        if asked > 0 and num_seen == 0:
            continue
        is_open = asked > 0 and num_seen == asked
        if not is_open:
            _ask(occluded, packet, points.position, points.chance, first, width, rays, given, False, seen)
        for sample in range(strata.uv.shape[0]):
            byte, bit = sample >> 3, np.uint8(1 << (sample & 7))
            for k in range(width):
                r = sample * BLOCK + k
                if given[r] > 0 and (is_open or seen[r]):
                    arriving[first + k] += given[r]
                    bits[first + k, byte] |= bit


def preview_light(
    scene: EmbreeScene, off_surface: float, light: LocalLight, strata: Strata, points: Points
) -> PreviewLight:
    """Light points, tracing where shadows end and predicting elsewhere.

    Args:
        scene: the triangles that may be in the way.
        off_surface: metres by which rays end before the light's own surface.
        light: the light. strata: its samples, from `strata_of`; the points' seeds shift them.
        points: n points that the light may reach, neighbours in the picture mostly next to each other.
    """
    num, num_bytes = points.num_points, (len(strata.uv) + 7) // 8
    found = PreviewLight(np.zeros(num, np.float32), np.zeros((num, num_bytes), np.uint8))
    arguments = packet_arguments(coherent=True)
    args = (light, strata, np.float32(off_surface), points)

    def kernel(start: int, stop: int) -> None:
        first, last = start * BLOCK, min(stop * BLOCK, num)
        _light(occluded, scene.handle, arguments.ctypes.data, *args, first, last, *found)

    for_shares(kernel, -(-num // BLOCK))
    return found
