"""Which samples of a local light each point sees, in packets of 16 neighbouring points × one sample; and their sum.

Both ends of a shadow ray lie off their surfaces, on the sides that face each other: neither shadows itself.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.light.local import LocalLight, light_sample
from relume.parallel import for_ranges
from relume.trace.embree import EmbreeScene, aligned, occluded16, packet_arguments
from relume.trace.gather_rays import Pattern, shift_of

F32 = NDArray[np.float32]

# rows of RTCRay16, 16 floats each, after the origin
_NEAR, _DIRECTION, _FAR, _MASK = 3, 4, 8, 9
_POINTS_A_RANGE = 4096


@nb.njit(nogil=True, cache=True, inline="always")
def shadow_ray(dx, dy, dz, distance, nx, ny, nz, off_surface):  # type: ignore[no-untyped-def]
    """Direction and end of the ray to a sample of a light (see `light_sample`), off whose surface it ends."""
    # not normalised, but where it never ends: it ends at one
    length, far = (np.float32(1), distance) if distance == np.inf else (distance, np.float32(1))
    return length * dx + off_surface * nx, length * dy + off_surface * ny, length * dz + off_surface * nz, far


@nb.njit(nogil=True, cache=True)
def _trace(  # type: ignore[no-untyped-def]
    occluded, scene, arguments, light, pattern, off_surface, points, normals, numbers, start, stop, bits
):
    """Points [start, stop); start is a multiple of 16."""
    ray = aligned(12 * 16)
    words = ray.view(np.uint32)
    words[_MASK * 16 : (_MASK + 1) * 16] = 0xFFFFFFFF
    valid = aligned(16).view(np.int32)
    for first in range(start, stop, 16):
        width = min(16, stop - first)
        for sample in range(pattern.uv.shape[0]):
            active = 0
            for k in range(16):
                p = first + min(k, width - 1)
                x, y, z = points[p, 0], points[p, 1], points[p, 2]
                shift_u, shift_v = shift_of(pattern, numbers[p])
                dx, dy, dz, distance, weight, nx, ny, nz = light_sample(
                    light, pattern, sample, shift_u, shift_v, x, y, z
                )
                above = dx * normals[p, 0] + dy * normals[p, 1] + dz * normals[p, 2] > 0
                is_asked = k < width and above and weight > 0
                valid[k] = -1 if is_asked else 0
                active += 1 if is_asked else 0
                along_x, along_y, along_z, far = shadow_ray(dx, dy, dz, distance, nx, ny, nz, off_surface)
                ray[k], ray[16 + k], ray[32 + k] = x, y, z
                ray[_DIRECTION * 16 + k] = along_x
                ray[(_DIRECTION + 1) * 16 + k] = along_y
                ray[(_DIRECTION + 2) * 16 + k] = along_z
                ray[_NEAR * 16 + k] = 0
                ray[_FAR * 16 + k] = far
            if active == 0:
                continue
            occluded(np.int64(valid.ctypes.data), scene, np.int64(ray.ctypes.data), arguments)
            for k in range(width):
                # Embree sets tfar to minus infinity where something is in the way
                if valid[k] != 0 and ray[_FAR * 16 + k] > 0:
                    bits[first + k, sample >> 3] |= np.uint8(1 << (sample & 7))


def trace_local(
    scene: EmbreeScene,
    off_surface: float,
    light: LocalLight,
    pattern: Pattern,
    points: F32,
    normals: F32,
    numbers: NDArray[np.uint32],
) -> NDArray[np.uint8]:
    """Trace every point against every sample that is above its horizon and gives it light.

    Args:
        off_surface: metres by which rays end before the light's own surface.
        points: off the surface already. normals: shading normals. (n, 3) float32
        numbers: seed the shifts of the pattern. (n,) uint32
    Returns:
        Sample k of a point in bit k & 7 of byte k >> 3. (n, ceil(samples / 8)) uint8
    """
    bits = np.zeros((len(points), (len(pattern.uv) + 7) // 8), np.uint8)
    arguments = packet_arguments(coherent=True)
    args = (light, pattern, np.float32(off_surface), points, normals, numbers)
    for_ranges(
        lambda start, stop: _trace(occluded16, scene.handle, arguments.ctypes.data, *args, start, stop, bits),
        len(points),
        _POINTS_A_RANGE,
    )
    return bits


@nb.njit(nogil=True, cache=True)
def _arriving(light, pattern, points, normals, numbers, visible, start, stop, out):  # type: ignore[no-untyped-def]
    for p in range(start, stop):
        x, y, z = points[p, 0], points[p, 1], points[p, 2]
        shift_u, shift_v = shift_of(pattern, numbers[p])
        total = 0.0
        for sample in range(pattern.uv.shape[0]):
            if (visible[p, sample >> 3] >> (sample & 7)) & 1:
                dx, dy, dz, _, weight, _, _, _ = light_sample(light, pattern, sample, shift_u, shift_v, x, y, z)
                total += weight * max(dx * normals[p, 0] + dy * normals[p, 1] + dz * normals[p, 2], np.float32(0))
        out[p] = total


def arriving(
    light: LocalLight,
    pattern: Pattern,
    points: F32,
    normals: F32,
    numbers: NDArray[np.uint32],
    visible: NDArray[np.uint8],
) -> F32:
    """E of points under a light of unit emission; arguments and bits as of `trace_local`. (n,) float32"""
    out = np.empty(len(points), np.float32)
    args = (light, pattern, points, normals, numbers, visible)
    for_ranges(lambda start, stop: _arriving(*args, start, stop, out), len(points), _POINTS_A_RANGE)
    return out
