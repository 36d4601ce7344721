"""First hits of rays, and the rays of a camera through positions on the image plane."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges, num_threads, parallel_for_chunks
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.ray_packet import (
    LANES,
    enable_first_lanes,
    enable_stochastic_alpha,
    get_hit,
    get_uv,
    new_packet,
    set_direction,
    set_origin,
    trace_hits,
)
from relume.scene.model import Camera

F32 = NDArray[np.float32]

_RAYS_PER_RANGE, _RANGES_PER_THREAD = 8192, 4  # minimum; maximum: scheduling a range takes as long as 700 rays
_BY_DIRECTION = np.float32(0)  # the alpha sample is a hash of the direction


class Hits(NamedTuple):
    """First hits of n rays.

    Attributes:
        face: index of the triangle, -1 if the ray leaves the scene.
        uv: barycentric coordinates of its second and third corner.
        distance: distance along the unit direction; infinite if nothing is hit.
    """

    face: Shaped[NDArray[np.int32], " n"]
    uv: Shaped[F32, "n 2"]
    distance: Shaped[F32, " n"]

    def rows(self, rows: NDArray[Any] | slice) -> Hits:
        """Select rays."""
        return Hits(self.face[rows], self.uv[rows], self.distance[rows])

    @staticmethod
    def concatenate(batches: Sequence[Hits]) -> Hits:
        """Concatenate hits."""
        return Hits(*map(np.concatenate, zip(*batches, strict=True)))


@nb.njit(nogil=True, cache=True)
def _trace(tracer, origins, directions, alpha_sample, start, stop, hits):  # type: ignore[no-untyped-def]
    """Trace rays [start, stop). origins, alpha_sample: of n rays, or one for all."""
    last_origin, last_alpha_sample = origins.shape[0] - 1, alpha_sample.shape[0] - 1
    packet = new_packet(tracer)
    for k in range(LANES):  # Embree does not modify origins
        set_origin(packet, k, origins[0, 0], origins[0, 1], origins[0, 2])
    for first in range(start, stop, LANES):
        width = min(LANES, stop - first)
        enable_first_lanes(packet, width)
        for k in range(LANES):
            r = first + min(k, width - 1)
            if last_origin > 0:
                set_origin(packet, k, origins[r, 0], origins[r, 1], origins[r, 2])
            set_direction(packet, k, directions[r, 0], directions[r, 1], directions[r, 2], np.float32(np.inf))
            enable_stochastic_alpha(packet, k, alpha_sample[min(r, last_alpha_sample)])
        trace_hits(packet)
        for k in range(width):
            r = first + k
            hits.face[r], hits.distance[r] = get_hit(packet, k)
            if hits.face[r] >= 0:  # otherwise the packet contains values of an earlier ray
                hits.uv[r, 0], hits.uv[r, 1] = get_uv(packet, k)


def trace_rays(
    scene: EmbreeScene,
    origin: F32,
    directions: Shaped[F32, "n 3"],
    alpha_sample: F32 | np.float32 = _BY_DIRECTION,
    start: Shaped[F32, " n"] | None = None,
) -> Hits:
    """Find the first hits of rays from one origin, or from one origin each.

    Args:
        scene: the triangles. origin: (3,) or (n, 3). directions: unit.
        alpha_sample: alpha sample of each ray (n,), or one for all, in (0, 1] for blended surfaces or a constant of
            `alpha_filter`.
        start: distances from the origin at which the rays begin, as from `near_distances`; None: zero.
    Returns:
        Hits with distances from `origin`.
    """
    if start is not None:
        hits = trace_rays(scene, origin + start[:, None] * directions, directions, alpha_sample)
        return hits._replace(distance=hits.distance + start)
    n = len(directions)
    origins = np.ascontiguousarray(origin, np.float32).reshape(-1, 3)
    is_coherent, alpha_samples = len(origins) == 1, np.atleast_1d(alpha_sample)
    hits = Hits(np.empty(n, np.int32), np.zeros((n, 2), np.float32), np.empty(n, np.float32))
    args = scene.hit_tracer(coherent=is_coherent), origins, directions, alpha_samples
    rays_per_range = max(_RAYS_PER_RANGE, n // (_RANGES_PER_THREAD * num_threads()))
    for_ranges(lambda start, stop: _trace(*args, start, stop, hits), n, rays_per_range)
    return hits


def near_distances(camera: Camera, directions: Shaped[F32, "n 3"]) -> Shaped[F32, " n"] | None:
    """Return the distances from a camera to its near plane along rays; None if nothing is clipped.

    Args:
        camera: the camera. directions: of rays through its image, unit.
    """
    if camera.near == 0:
        return None
    cosine = directions @ -camera.to_world[:3, 2].astype(np.float32)
    return np.asarray(np.float32(camera.near) / np.maximum(cosine, np.float32(1e-6)), np.float32)


def camera_directions(
    camera: Camera, size: tuple[int, int], x: Shaped[F32, " n"], y: Shaped[F32, " n"]
) -> Shaped[F32, "n 3"]:
    """Compute unit world directions through image positions.

    Args:
        camera: the camera. size: width and height in pixels.
        x, y: pixels from the left and from the top.
    """
    width, height = size
    half_height = np.tan(camera.yfov / 2)
    out = np.empty((len(x), 3), np.float32)
    camera_arguments = (
        np.ascontiguousarray(camera.to_world[:3, :3], np.float64),
        half_height * width / height,
        half_height,
        width,
        height,
    )
    parallel_for_chunks(lambda start, stop: _aim(*camera_arguments, x, y, start, stop, out), len(x))
    return out


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _aim(rotation, half_width, half_height, width, height, x, y, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute directions [start, stop) in float64: pixels of wide images are 1e-4 apart."""
    for r in range(start, stop):
        right, up = (2 * x[r] / width - 1) * half_width, (1 - 2 * y[r] / height) * half_height
        length = math.sqrt(right * right + up * up + 1)
        for axis in range(3):
            along = rotation[axis, 0] * right + rotation[axis, 1] * up - rotation[axis, 2]
            out[r, axis] = along / length
