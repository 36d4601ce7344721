"""First hits of rays, and the camera's rays: what each position of the image plane sees first."""

from __future__ import annotations

from dataclasses import dataclass

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.parallel import for_ranges
from relume.scene.model import Camera
from relume.trace.embree import EmbreeScene, aligned, intersect16, packet_arguments

F32 = NDArray[np.float32]

_FLOATS_A_PACKET = 12 * 16 + 9 * 16  # RTCRay16, then RTCHit16 with its instance ids
_NEAR, _DIRECTION, _FAR, _MASK = 3, 4, 8, 9
_U, _V, _PRIMITIVE, _GEOMETRY = 15, 16, 17, 18
_NOTHING = 0xFFFFFFFF


@dataclass(frozen=True)
class Hits:
    """First hits of n rays.

    Attributes:
        face: index of the triangle, -1 where the ray leaves the scene. (n,) int32
        uv: barycentric coordinates of its second and third corner. (n, 2) float32
        distance: along the unit direction; infinite where nothing is hit. (n,) float32
    """

    face: NDArray[np.int32]
    uv: F32
    distance: F32


@nb.njit(nogil=True, cache=True)
def _trace(intersect, scene, arguments, origins, directions, start, stop, face, uv, distance):  # type: ignore[no-untyped-def]
    """Trace rays [start, stop). origins: (n, 3), or (1, 3) where all rays come from one point."""
    last_origin = origins.shape[0] - 1
    packet = aligned(_FLOATS_A_PACKET)
    words = packet.view(np.uint32)
    valid = aligned(16).view(np.int32)
    for first in range(start, stop, 16):
        width = min(16, stop - first)
        words[_MASK * 16 : (_MASK + 1) * 16] = _NOTHING
        words[_GEOMETRY * 16 : (_GEOMETRY + 2) * 16] = _NOTHING
        for k in range(16):
            r = first + min(k, width - 1)
            valid[k] = -1 if k < width else 0
            for axis in range(3):
                packet[axis * 16 + k] = origins[min(r, last_origin), axis]
                packet[(_DIRECTION + axis) * 16 + k] = directions[r, axis]
            packet[_NEAR * 16 + k] = 0
            packet[_FAR * 16 + k] = np.inf
        intersect(np.int64(valid.ctypes.data), scene, np.int64(packet.ctypes.data), arguments)
        for k in range(width):
            r = first + k
            hit = words[_GEOMETRY * 16 + k] != _NOTHING
            face[r] = np.int32(words[_PRIMITIVE * 16 + k]) if hit else -1
            uv[r, 0] = packet[_U * 16 + k]
            uv[r, 1] = packet[_V * 16 + k]
            distance[r] = packet[_FAR * 16 + k] if hit else np.inf


def trace_from(scene: EmbreeScene, origin: F32, directions: F32) -> Hits:
    """First hits of rays from one point, or from a point each.

    Args:
        origin: (3,) float32, or (n, 3). directions: unit. (n, 3) float32
    """
    n = len(directions)
    origins = np.ascontiguousarray(origin, np.float32).reshape(-1, 3)
    is_coherent = len(origins) == 1
    hits = Hits(np.empty(n, np.int32), np.empty((n, 2), np.float32), np.empty(n, np.float32))
    arguments = packet_arguments(is_coherent)
    for_ranges(
        lambda start, stop: _trace(
            intersect16, scene.handle, arguments.ctypes.data, origins, directions, start, stop,
            hits.face, hits.uv, hits.distance,
        ),
        n,
        8192,
    )  # fmt: skip
    return hits


def camera_directions(camera: Camera, size: tuple[int, int], x: F32, y: F32) -> F32:
    """World directions through image positions, unit.

    Args:
        size: width and height in pixels. x, y: pixels from the left and from the top. (n,) float32
    Returns:
        (n, 3) float32
    """
    width, height = size
    half = np.tan(camera.yfov / 2)
    local = np.stack(
        [(2 * x / width - 1) * half * width / height, (1 - 2 * y / height) * half, np.full_like(x, -1)], axis=-1
    ).astype(np.float64)
    world = local @ camera.to_world[:3, :3].T
    return np.asarray(world / np.linalg.norm(world, axis=-1, keepdims=True), np.float32)
