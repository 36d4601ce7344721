"""What comes straight from a local light that moves: shadows traced at few points and predicted between them.

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

from relume.light.local import LocalLight, light_sample
from relume.parallel import for_shares
from relume.trace.embree import EmbreeScene, aligned, occluded16, packet_arguments
from relume.trace.gather_rays import Pattern, shift_of
from relume.trace.local_shadows import shadow_ray

F32 = NDArray[np.float32]

BLOCK = 64
# rows of RTCRay16, 16 floats each, after the origin
_NEAR, _DIRECTION, _FAR, _MASK = 3, 4, 8, 9


class RoughLight(NamedTuple):
    """Of a light of unit emission.

    Attributes:
        arriving: E of each point. (n,) float32
        visible: sample k of a point in bit k & 7 of byte k >> 3. (n, ceil(samples / 8)) uint8
    """

    arriving: F32
    visible: NDArray[np.uint8]


class _Packet(NamedTuple):
    """Sixteen rays that wait to be traced. lane: which ray of the block each is. (16,)"""

    ray: F32
    valid: NDArray[np.int32]
    lane: NDArray[np.int64]
    scene: int
    arguments: int


@nb.njit(nogil=True, cache=True, inline="always")
def is_probe(k):  # type: ignore[no-untyped-def]
    """Whether a point of a block is traced in any case: the corners of each square of 4 × 4 along a Morton curve."""
    return k & 3 == (k >> 2) & 3


@nb.njit(nogil=True, cache=True)
def _flush(occluded, packet, waiting, seen):  # type: ignore[no-untyped-def]
    """Trace the rays of the first lanes; returns how many of them reach the light."""
    for lane in range(16):
        packet.valid[lane] = -1 if lane < waiting else 0
    occluded(np.int64(packet.valid.ctypes.data), packet.scene, np.int64(packet.ray.ctypes.data), packet.arguments)
    num_seen = 0
    for lane in range(waiting):
        # Embree sets tfar to minus infinity where something is in the way
        is_seen = packet.ray[_FAR * 16 + lane] > 0
        seen[packet.lane[lane]] = is_seen
        num_seen += 1 if is_seen else 0
    return num_seen


@nb.njit(nogil=True, cache=True)
def _ask(occluded, packet, points, first, width, rays, given, are_probes, seen):  # type: ignore[no-untyped-def]
    """Trace the rays that would bring light to the probes of a block, or to its other points.

    Returns:
        How many rays were traced, and how many of them reach the light.
    """
    ray, asked, num_seen = packet.ray, 0, 0
    for r in range(given.shape[0]):
        k = r & (BLOCK - 1)
        if k >= width or given[r] <= 0 or is_probe(k) != are_probes:
            continue
        lane = asked & 15
        packet.lane[lane] = r
        for axis in range(3):
            ray[axis * 16 + lane] = points[first + k, axis]
            ray[(_DIRECTION + axis) * 16 + lane] = rays[r, axis]
        ray[_NEAR * 16 + lane], ray[_FAR * 16 + lane] = 0, rays[r, 3]
        asked += 1
        if lane == 15:
            num_seen += _flush(occluded, packet, 16, seen)
    if asked & 15:
        num_seen += _flush(occluded, packet, asked & 15, seen)
    return asked, num_seen


@nb.njit(nogil=True, cache=True)
def _aim(light, pattern, off_surface, points, normals, numbers, first, width, rays, given):  # type: ignore[no-untyped-def]
    """The rays of a block's points, sample after sample of `BLOCK` each: direction and end, and w · cos θi."""
    for k in range(width):
        p = first + k
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        shift_u, shift_v = shift_of(pattern, numbers[p])
        for sample in range(pattern.uv.shape[0]):
            r = sample * BLOCK + k
            dx, dy, dz, distance, weight, nx, ny, nz = light_sample(light, pattern, sample, shift_u, shift_v, x, y, z)
            given[r] = weight * (dx * normals[p, 0] + dy * normals[p, 1] + dz * normals[p, 2])
            rays[r, 0], rays[r, 1], rays[r, 2], rays[r, 3] = shadow_ray(dx, dy, dz, distance, nx, ny, nz, off_surface)


@nb.njit(nogil=True, cache=True)
def _light(  # type: ignore[no-untyped-def]
    occluded, scene, arguments, light, pattern, off_surface, points, normals, numbers, start, stop, arriving, bits
):
    """Points [start, stop); start is a multiple of `BLOCK`."""
    ray = aligned(12 * 16)
    ray.view(np.uint32)[_MASK * 16 : (_MASK + 1) * 16] = 0xFFFFFFFF
    packet = _Packet(ray, aligned(16).view(np.int32), np.zeros(16, np.int64), scene, arguments)
    num_rays = BLOCK * pattern.uv.shape[0]
    rays, given, seen = (
        np.empty((num_rays, 4), np.float32),
        np.empty(num_rays, np.float32),
        np.empty(num_rays, np.bool_),
    )
    for first in range(start, stop, BLOCK):
        width = min(BLOCK, stop - first)
        _aim(light, pattern, off_surface, points, normals, numbers, first, width, rays, given)
        asked, num_seen = _ask(occluded, packet, points, first, width, rays, given, True, seen)
        if asked > 0 and num_seen == 0:
            continue
        is_open = asked > 0 and num_seen == asked
        if not is_open:
            _ask(occluded, packet, points, first, width, rays, given, False, seen)
        for sample in range(pattern.uv.shape[0]):
            byte, bit = sample >> 3, np.uint8(1 << (sample & 7))
            for k in range(width):
                r = sample * BLOCK + k
                if given[r] > 0 and (is_open or seen[r]):
                    arriving[first + k] += given[r]
                    bits[first + k, byte] |= bit


def light_roughly(
    scene: EmbreeScene,
    off_surface: float,
    light: LocalLight,
    pattern: Pattern,
    points: F32,
    normals: F32,
    numbers: NDArray[np.uint32],
) -> RoughLight:
    """Light points, tracing where shadows end and predicting elsewhere; arguments as of `trace_local`."""
    found = RoughLight(np.zeros(len(points), np.float32), np.zeros((len(points), (len(pattern.uv) + 7) // 8), np.uint8))
    arguments = packet_arguments(coherent=True)
    args = (light, pattern, np.float32(off_surface), points, normals, numbers)

    def kernel(start: int, stop: int) -> None:
        first, last = start * BLOCK, min(stop * BLOCK, len(points))
        _light(occluded16, scene.handle, arguments.ctypes.data, *args, first, last, *found)

    for_shares(kernel, -(-len(points) // BLOCK))
    return found
