"""Antialiasing for the free camera: pixels on geometric edges get a few more rays and average them.

A cheaper variant of the adaptive sampling of fixed views (`relume.camera.view_samples`): edges are detected from the
centers of adjacent pixels, and the number of rays is limited by the frame time.
"""

from __future__ import annotations

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.probes.stored_scene import StoredScene
from relume.raytrace.camera_rays import Hits

F32 = NDArray[np.float32]

# four positions in distinct rows and columns, pixel units
EDGE_SAMPLE_POSITIONS = ((np.array([(1, 0), (3, 1), (0, 2), (2, 3)]) + 0.5) / 4).astype(np.float32)
_MAX_EXTRA_RAYS = 0.5  # per pixel of the image
_COS_CREASE = np.float32(np.cos(np.radians(20.0)))
_DEPTH_EDGE = np.float32(0.02)  # offset from the plane of the adjacent surface, as a fraction of the distance


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def is_edge(material, normals, hits, directions, p, q):  # type: ignore[no-untyped-def]
    """Return whether two pixels show different materials, or one material with another normal or offset.

    Args:
        material, normals: of faces. (faces,), (faces, 3). hits: `Hits` of the pixels' rays. directions: of these rays.
            (pixels, 3) float32. p, q: the pixels.
    """
    # no branches: Numba would count array references in each, which took two thirds of the time
    (face, _, distance), cosine, plane_distance = hits, np.float32(0), np.float32(0)
    f, g = face[p], face[q]
    a, b = max(f, 0), max(g, 0)
    for axis in range(3):
        cosine += normals[a, axis] * normals[b, axis]
        plane_distance += normals[a, axis] * (distance[q] * directions[q, axis] - distance[p] * directions[p, axis])
    # abs: a front face and a back face are adjacent only across an edge
    is_bent = (abs(cosine) < _COS_CREASE) | (abs(plane_distance) > _DEPTH_EDGE * min(distance[p], distance[q]))
    is_environment, is_different = (f < 0) | (g < 0), (material[a] != material[b]) | is_bent
    return (f != g) & (is_environment | is_different)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _mark(material, normals, hits, directions, width, height, start, stop, edge_mask):  # type: ignore[no-untyped-def]
    """Mark pixels [start, stop) and their right and lower neighbors across edges; threads may mark a pixel twice."""
    column = start % width
    for p in range(start, stop):
        if column < width - 1 and is_edge(material, normals, hits, directions, p, p + 1):
            edge_mask[p] = edge_mask[p + 1] = True
        column = column + 1 if column < width - 1 else 0
        if p < width * (height - 1) and is_edge(material, normals, hits, directions, p, p + width):
            edge_mask[p] = edge_mask[p + width] = True


def find_edges(
    stored_scene: StoredScene, hits: Hits, directions: Shaped[F32, "n 3"], size: tuple[int, int]
) -> Shaped[NDArray[np.int32], " m"]:
    """Return the pixels on edges in row-major order.

    Args:
        stored_scene: the scene. hits: hits of the rays through all pixel centers. directions: directions of these rays.
        size: width and height in pixels.
    """
    width, height = size
    edge_mask = np.zeros(width * height, np.bool_)
    args = stored_scene.face_material, stored_scene.face_normal, hits, directions, width, height
    parallel_for_chunks(lambda start, stop: _mark(*args, start, stop, edge_mask), width * height)
    return np.flatnonzero(edge_mask).astype(np.int32)


def samples_per_edge(num_edges: int, num_pixels: int) -> int:
    """Return the number of extra rays per edge pixel, limited so that frames of foliage take no longer than others."""
    return min(len(EDGE_SAMPLE_POSITIONS), int(_MAX_EXTRA_RAYS * num_pixels) // max(1, num_edges))


def resolve(
    values: Shaped[F32, " rays *channels"], owner: Shaped[NDArray[np.int32], " m"], num_pixels: int
) -> Shaped[F32, " pixels *channels"]:
    """Average all rays of each pixel.

    Args:
        values: values of the rays through all pixel centers, then of the extra rays.
        owner: pixels of the extra rays.
    Returns:
        The mean per pixel, num_pixels in all.
    """
    if not len(owner):
        return values
    flat = values.reshape(len(values), -1)
    out = flat[:num_pixels].copy()
    _mean(flat, owner, num_pixels, out)
    return out.reshape(num_pixels, *values.shape[1:])


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _mean(values, owner, num_pixels, out):  # type: ignore[no-untyped-def]
    num = np.zeros(num_pixels, np.uint8)
    for r in range(owner.shape[0]):
        num[owner[r]] += 1
        for c in range(out.shape[1]):
            out[owner[r], c] += values[num_pixels + r, c]
    for p in range(num_pixels):
        if num[p]:
            for c in range(out.shape[1]):
                out[p, c] /= np.float32(1 + num[p])
