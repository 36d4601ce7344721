"""Normals at ray hits without textures, for edge detection and ray merging."""

from __future__ import annotations

import math

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.raytrace.camera_rays import Hits
from relume.raytrace.ray_origins import inner_barycentrics
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.shading_normals import MIN_FACING

F32 = NDArray[np.float32]

_HITS_PER_RANGE = 16_384


@nb.njit(nogil=True, cache=True, inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


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
def _normals(mesh, normals, face, uv, directions, start, stop, out):  # type: ignore[no-untyped-def]
    """Compute the normals at hits [start, stop). out: output. (n, 3) float32"""
    for k in range(start, stop):
        d = np.float64(directions[k, 0]), np.float64(directions[k, 1]), np.float64(directions[k, 2])
        view_direction = -d[0], -d[1], -d[2]
        if face[k] < 0:
            out[k, 0], out[k, 1], out[k, 2] = view_direction
            continue
        f = face[k]
        i, j, m = mesh.faces[f, 0], mesh.faces[f, 1], mesh.faces[f, 2]
        barycentrics = inner_barycentrics(mesh, f, uv[k, 0], uv[k, 1])
        face_normal = np.float64(mesh.normal[f, 0]), np.float64(mesh.normal[f, 1]), np.float64(mesh.normal[f, 2])
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
    out = np.empty((len(directions), 3), np.float32)
    args = geometry.origins, geometry.normals, hits.face, hits.uv, directions
    for_ranges(lambda start, stop: _normals(*args, start, stop, out), len(directions), _HITS_PER_RANGE)
    return out
