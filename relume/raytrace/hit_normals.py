"""Normals at ray hits without textures, for edge detection and ray merging."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.raytrace.barycentric import EDGE_OFFSET_FRACTION
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.shading_normals import MIN_FACING

F32 = NDArray[np.float32]

_HITS_PER_RANGE = 16_384


@nb.njit(nogil=True, cache=True, inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@nb.njit(nogil=True, cache=True, inline="always")
def _subtract(a, b):  # type: ignore[no-untyped-def]
    return np.float64(a[0]) - b[0], np.float64(a[1]) - b[1], np.float64(a[2]) - b[2]


@nb.njit(nogil=True, cache=True, inline="always")
def _unit(v, fallback):  # type: ignore[no-untyped-def]
    """Normalize a vector; return the fallback for zero."""
    length = math.sqrt(_dot(v, v))
    if length <= 1e-12:
        return fallback
    return v[0] / length, v[1] / length, v[2] / length


@nb.njit(nogil=True, cache=True, inline="always")
def _flip(v, is_flipped):  # type: ignore[no-untyped-def]
    return (-v[0], -v[1], -v[2]) if is_flipped else (v[0], v[1], v[2])


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _inner_barycentrics(uv, edges, twice_area, epsilon):  # type: ignore[no-untyped-def]
    """Move barycentric coordinates off edges; see `relume.raytrace.barycentric`. edges: opposite to corners"""
    per_area = 1 / max(twice_area, 1e-20)
    a = max(1.0 - uv[0] - uv[1], min(epsilon * edges[0], 0.1 * twice_area) * per_area)
    b = max(np.float64(uv[0]), min(epsilon * edges[1], 0.1 * twice_area) * per_area)
    c = max(np.float64(uv[1]), min(epsilon * edges[2], 0.1 * twice_area) * per_area)
    total = a + b + c
    return a / total, b / total, c / total


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _normals(positions, normals, faces, face, uv, directions, epsilon, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute the normals at hits [start, stop). out: output. (n, 3) float32"""
    for k in range(start, stop):
        d = np.float64(directions[k, 0]), np.float64(directions[k, 1]), np.float64(directions[k, 2])
        view_direction = -d[0], -d[1], -d[2]
        if face[k] < 0:
            out[k, 0], out[k, 1], out[k, 2] = view_direction
            continue
        i, j, m = faces[face[k], 0], faces[face[k], 1], faces[face[k], 2]
        ab, ac, bc = (
            _subtract(positions[j], positions[i]), _subtract(positions[m], positions[i]), _subtract(positions[m],
            positions[j]),
        )  # fmt: skip
        normal = ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]
        twice_area = math.sqrt(_dot(normal, normal))
        edges = math.sqrt(_dot(bc, bc)), math.sqrt(_dot(ac, ac)), math.sqrt(_dot(ab, ab))
        barycentrics = _inner_barycentrics(uv[k], edges, twice_area, epsilon)
        face_normal = _unit(normal, view_direction)
        face_normal = _flip(face_normal, _dot(face_normal, d) > 0)
        x, y, z = 0.0, 0.0, 0.0
        for weight, corner in ((barycentrics[0], i), (barycentrics[1], j), (barycentrics[2], m)):
            x, y, z = x + weight * normals[corner, 0], y + weight * normals[corner, 1], z + weight * normals[corner, 2]
        n = _unit((x, y, z), face_normal)
        n = _flip(n, _dot(n, face_normal) < 0)
        deficit = max(MIN_FACING + _dot(n, d), 0.0)
        n = n[0] - deficit * d[0], n[1] - deficit * d[1], n[2] - deficit * d[2]
        out[k, 0], out[k, 1], out[k, 2] = _unit(n, view_direction)


def normals_at(geometry: SceneBuffers, hits: Hits, directions: Shaped[F32, "n 3"]) -> Shaped[F32, "n 3"]:
    """Interpolate normals at ray hits. Reference: `relume.raytrace.surface_interaction.surface_at` without materials.

    Args:
        geometry: the triangles. hits: the first hits of rays. directions: directions of the rays, unit.
    Returns:
        Normals toward the viewer; the reversed direction for rays without a hit.
    """
    out, epsilon = np.empty((len(directions), 3), np.float32), EDGE_OFFSET_FRACTION * geometry.epsilon
    args = geometry.positions, geometry.normals, geometry.faces, hits.face, hits.uv, directions, epsilon
    for_ranges(lambda start, stop: _normals(*args, start, stop, out), len(directions), _HITS_PER_RANGE)
    return out
