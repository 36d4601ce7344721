"""Ray origins on triangles: off their plane by a bound of rounding, and off their edges.

Triangles that share a vertex have the largest of their offsets (`relume.math.plane_rounding`), because a large and a
small one may lie in one plane.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges
from relume.math.plane_rounding import ROUNDING, origin_offsets

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_EDGE = 8.0  # roundings of barycentric coordinates, times the size of the triangle
_ROWS_PER_RANGE = 16_384
_TINY = 1e-300


class OriginMesh(NamedTuple):
    """Triangles on which rays start, for kernels.

    Attributes:
        positions: of the vertices, meters. faces: vertex indices of the corners.
        normal: unit normals of the triangles.
        offset: largest `origin_offsets` of each triangle and those that share a vertex with it.
        margin: least barycentric coordinates of origins. A point on the edge of two walls would lie in the plane of the
            other wall and see behind it.
    """

    positions: Shaped[F32, "vertices 3"]
    faces: Shaped[NDArray[np.uint32], "faces 3"]
    normal: Shaped[F32, "faces 3"]
    offset: Shaped[F32, " faces"]
    margin: Shaped[F32, "faces 3"]

    @classmethod
    def build(
        cls,
        positions: Shaped[F32, "vertices 3"],
        faces: Shaped[NDArray[np.uint32], "faces 3"],
        normal: Shaped[F32, "faces 3"],
    ) -> Self:
        """Compute the offsets.

        Args:
            positions: of the vertices, meters. faces: vertex indices. normal: unit normals of the faces.
        """
        faces = np.ascontiguousarray(faces)  # kernels are compiled for one layout
        offset, margin = np.empty(len(faces), np.float32), np.empty((len(faces), 3), np.float32)

        def compute(start: int, stop: int) -> None:
            corners = positions[faces[start:stop]].astype(np.float64)
            offset[start:stop], margin[start:stop] = origin_offsets(corners), _margins(corners)

        for_ranges(compute, len(faces), _ROWS_PER_RANGE)
        _raise_to_neighbors(faces, np.zeros(len(positions), np.float32), offset)
        return cls(positions, faces, normal, offset, margin)


NO_ORIGINS = OriginMesh(
    *(np.empty((0, 3), np.float32), np.empty((0, 3), np.uint32), np.empty((0, 3), np.float32)),
    *(np.empty(0, np.float32), np.empty((0, 3), np.float32)),
)
"""Of no triangles."""


def _margins(corners: Shaped[F64, "n 3 3"]) -> Shaped[F32, "n 3"]:
    """Least barycentric coordinates: rounding of the position in the triangle, at most a tenth of its height."""
    edges = np.linalg.norm(corners[:, [1, 2, 0]] - corners[:, [2, 0, 1]], axis=2)  # opposite to each corner
    twice_area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    distance = _EDGE * ROUNDING * (np.abs(corners).max(axis=(1, 2)) + np.ptp(corners, axis=1).max(axis=1))
    height = twice_area[:, None] / np.maximum(edges, _TINY)
    return np.asarray(np.minimum(distance[:, None] / np.maximum(height, _TINY), 0.1), np.float32)


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _raise_to_neighbors(faces, largest, offset):  # type: ignore[no-untyped-def]
    """Raise each offset to the largest of the triangles that share a vertex: a large one may lie in the same plane.

    Args:
        faces: vertex indices. largest: zeros, one for each vertex. offset: of the faces, overwritten.
    """
    for f in range(faces.shape[0]):
        for k in range(3):
            largest[faces[f, k]] = max(largest[faces[f, k]], offset[f])
    for f in range(faces.shape[0]):
        for k in range(3):
            offset[f] = max(offset[f], largest[faces[f, k]])


@nb.njit(nogil=True, cache=True, inline="always")
def inner_barycentrics(mesh, face, u, v):  # type: ignore[no-untyped-def]
    """Move barycentric coordinates off the edges; return those of all three corners.

    Args:
        mesh: `OriginMesh`. face: the triangle. u, v: of its second and third corner.
    """
    a = max(np.float64(1) - u - v, np.float64(mesh.margin[face, 0]))
    b, c = max(np.float64(u), np.float64(mesh.margin[face, 1])), max(np.float64(v), np.float64(mesh.margin[face, 2]))
    total = a + b + c
    return a / total, b / total, c / total


@nb.njit(nogil=True, cache=True, forceinline=True, **NO_REFCOUNT)
def ray_origin(mesh, face, u, v, side):  # type: ignore[no-untyped-def]
    """Position of a ray's origin on a triangle, three numbers, meters.

    Args:
        mesh: `OriginMesh`. face: the triangle. u, v: barycentric coordinates of its second and third corner.
        side: 1 on the outer side, −1 on the inner.
    """
    a, b, c = inner_barycentrics(mesh, face, u, v)
    i, j, k = mesh.faces[face, 0], mesh.faces[face, 1], mesh.faces[face, 2]
    lift, p = np.float64(side) * mesh.offset[face], mesh.positions
    return (
        np.float32(a * p[i, 0] + b * p[j, 0] + c * p[k, 0] + lift * mesh.normal[face, 0]),
        np.float32(a * p[i, 1] + b * p[j, 1] + c * p[k, 1] + lift * mesh.normal[face, 1]),
        np.float32(a * p[i, 2] + b * p[j, 2] + c * p[k, 2] + lift * mesh.normal[face, 2]),
    )


class RayOrigins(NamedTuple):
    """Origins of n rays on triangles. position: meters. barycentrics: of the triangles' corners, off the edges."""

    position: Shaped[F32, "n 3"]
    barycentrics: Shaped[F32, "n 3"]


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _ray_origins(mesh, face, uv, is_inner, start, stop, out):  # type: ignore[no-untyped-def]
    for k in range(start, stop):
        f, u, v = face[k], uv[k, 0], uv[k, 1]
        side = -1 if is_inner[k] else 1
        out.position[k, 0], out.position[k, 1], out.position[k, 2] = ray_origin(mesh, f, u, v, side)
        out.barycentrics[k, 0], out.barycentrics[k, 1], out.barycentrics[k, 2] = inner_barycentrics(mesh, f, u, v)


def ray_origins(
    mesh: OriginMesh,
    face: Shaped[NDArray[np.integer], " n"],
    uv: Shaped[F32, "n 2"],
    is_inner: Shaped[NDArray[np.bool_], " n"],
) -> RayOrigins:
    """Compute ray origins on triangles.

    Args:
        mesh: the triangles. face: face indices. uv: barycentric coordinates of the second and third corner.
        is_inner: the origins are on the inner sides.
    """
    out = RayOrigins(*np.empty((2, len(face), 3), np.float32))
    args = mesh, np.ascontiguousarray(face), np.ascontiguousarray(uv), np.ascontiguousarray(is_inner)
    for_ranges(lambda start, stop: _ray_origins(*args, start, stop, out), len(face), _ROWS_PER_RANGE)
    return out
