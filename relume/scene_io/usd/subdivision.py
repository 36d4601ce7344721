"""Catmull-Clark subdivision with semi-sharp creases, as UsdGeomMesh and OpenSubdiv define it.

With f the mean of a face, S the old position of a vertex of n faces, Q the mean of f around it and R that of the
middles of its edges: faces become f, edges (v0 + v1 + f0 + f1)/4, vertices (Q + 2 R + (n - 3) S)/n. The edges of a
crease become their middles, its vertices (6 S + a + b)/8 of both neighbors along it, and corners stay. DeRose, Kass and
Truong, Subdivision Surfaces in Character Animation, 1998.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.scene_io.usd.polygon_mesh import PolygonMesh, Primvar

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]
MAX_LEVELS = 2
SHARP = 10.0  # sharpness of a crease that stays sharp


@dataclass(frozen=True)
class Creases:
    """Sharpness of edges and vertices; others are smooth.

    Attributes:
        edges: pairs of vertices. edge_sharpness, vertex_sharpness: 0 is smooth, `SHARP` infinitely sharp.
        has_sharp_corners: vertices with one face stay where they are.
    """

    edges: Shaped[I64, "edges 2"]
    edge_sharpness: Shaped[F64, " edges"]
    vertices: Shaped[I64, " vertices"]
    vertex_sharpness: Shaped[F64, " vertices"]
    has_sharp_corners: bool = True


NO_CREASES = Creases(np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0, np.int64), np.zeros(0))


def subdivide(mesh: PolygonMesh, creases: Creases, levels: int) -> PolygonMesh:
    """Refine a mesh, and its primvars as surfaces of their own.

    Args:
        mesh: all vertices of its corners exist. creases: of the mesh; boundaries are creases anyway.
        levels: number of refinements; each makes a quadrilateral of each corner.
    """
    for _ in range(levels):
        points, creases_after = _refine(mesh.points, mesh.vertex, mesh.lengths, creases)
        primvars = {name: _refine_primvar(primvar, mesh) for name, primvar in mesh.primvars.items()}
        lengths = np.full(len(mesh.vertex), 4, np.int64)
        mesh = replace(
            mesh, points=points.values, vertex=points.index, lengths=lengths, face=mesh.face[mesh.owner],
            primvars=primvars,
        )  # fmt: skip
        creases = creases_after
    return mesh


def _refine_primvar(primvar: Primvar, mesh: PolygonMesh) -> Primvar:
    """Refine a primvar: two faces share a value only where they share the vertex, too."""
    values = np.concatenate([primvar.values, np.zeros((1, primvar.values.shape[1]))])  # of index -1
    index = np.where(primvar.index < 0, len(values) - 1, primvar.index)
    pairs, corner = np.unique(mesh.vertex * len(values) + index, return_inverse=True)
    return _refine(values[pairs % len(values)], corner, mesh.lengths, NO_CREASES)[0]


def _refine(values: F64, vertex: I64, lengths: I64, creases: Creases) -> tuple[Primvar, Creases]:
    """One refinement: new values, with the index of each corner of the quadrilaterals; and the creases of the next."""
    num_vertices, num_faces = len(values), len(lengths)
    start = np.cumsum(lengths) - lengths
    owner = np.repeat(np.arange(num_faces), lengths)
    following = np.arange(len(vertex)) + 1
    following[start + lengths - 1] = start
    preceding = np.empty_like(following)
    preceding[following] = np.arange(len(vertex))
    key = np.sort(np.stack([vertex, vertex[following]], axis=1), axis=1) @ np.array([num_vertices, 1])
    edge_keys, edge = np.unique(key, return_inverse=True)
    ends = np.stack([edge_keys // num_vertices, edge_keys % num_vertices], axis=1)
    sharpness = np.where(np.bincount(edge, minlength=len(ends)) == 2, 0.0, SHARP)
    _set_sharpness(sharpness, edge_keys, creases, num_vertices)

    center = _means(values[vertex], owner, num_faces)
    middle = values[ends].mean(axis=1)
    weight = np.minimum(sharpness, 1)[:, None]
    edge_value = weight * middle + (1 - weight) * (middle + _means(center[owner], edge, len(ends))) / 2
    vertex_value = _vertex_values(values, vertex, center[owner], ends, middle, sharpness, creases)

    first_edge = num_vertices
    first_face = first_edge + len(ends)
    quads = np.stack([vertex, first_edge + edge, first_face + owner, first_edge + edge[preceding]], axis=1)
    return (
        Primvar(np.concatenate([vertex_value, edge_value, center]), quads.reshape(-1)),
        _refined_creases(creases, ends, first_edge, sharpness),
    )


def _vertex_values(
    values: F64, vertex: I64, corner_center: F64, ends: I64, middle: F64, sharpness: F64, creases: Creases
) -> F64:
    num_vertices = len(values)
    num_around = np.bincount(vertex, minlength=num_vertices)[:, None]
    end, opposite = ends.reshape(-1), ends[:, ::-1].reshape(-1)
    twice_middle = np.repeat(middle, 2, axis=0)
    smooth = _means(corner_center, vertex, num_vertices) + 2 * _means(twice_middle, end, num_vertices)
    smooth = (smooth + (num_around - 3) * values) / np.maximum(num_around, 1)
    is_sharp = np.repeat(sharpness > 0, 2)
    num_sharp = np.bincount(end[is_sharp], minlength=num_vertices)
    along = _means(values[opposite[is_sharp]], end[is_sharp], num_vertices)
    crease = 0.75 * values + 0.25 * along
    corner_sharpness = np.zeros(num_vertices)
    corner_sharpness[creases.vertices] = creases.vertex_sharpness
    if creases.has_sharp_corners:
        corner_sharpness[num_around[:, 0] == 1] = SHARP
    crease_sharpness = _means(np.repeat(sharpness, 2)[is_sharp, None], end[is_sharp], num_vertices)[:, 0]
    corner_sharpness = np.where(num_sharp > 2, np.maximum(corner_sharpness, crease_sharpness), corner_sharpness)
    at_crease = np.where(num_sharp >= 2, np.minimum(crease_sharpness, 1), 0)[:, None]
    at_corner = np.minimum(corner_sharpness, 1)[:, None]
    result = at_crease * crease + (1 - at_crease) * smooth
    return np.asarray(np.where(num_around > 0, at_corner * values + (1 - at_corner) * result, values))


def _set_sharpness(sharpness: F64, edge_keys: I64, creases: Creases, num_vertices: int) -> None:
    """Write the sharpness of creases into that of all edges."""
    key = np.sort(creases.edges, axis=1) @ np.array([num_vertices, 1])
    position = np.minimum(np.searchsorted(edge_keys, key), len(edge_keys) - 1)
    is_edge = edge_keys[position] == key
    np.maximum.at(sharpness, position[is_edge], creases.edge_sharpness[is_edge])


def _refined_creases(creases: Creases, ends: I64, first_edge: int, sharpness: F64) -> Creases:
    """Both halves of each sharp edge, less sharp by one unless they stay sharp."""
    rows = np.flatnonzero(sharpness > 1)
    halves = np.stack([ends[rows].reshape(-1), np.repeat(first_edge + rows, 2)], axis=1)
    return replace(
        creases,
        edges=halves,
        edge_sharpness=np.repeat(_soften(sharpness[rows]), 2),
        vertex_sharpness=_soften(creases.vertex_sharpness),
    )


def _soften(sharpness: F64) -> F64:
    return np.where(sharpness >= SHARP, SHARP, np.maximum(sharpness - 1, 0))


def _means(values: F64, group: I64, num_groups: int) -> F64:
    """Means of the rows of each group; zero for an empty one."""
    count = np.maximum(np.bincount(group, minlength=num_groups), 1)[:, None]
    sums = [np.bincount(group, values[:, k], num_groups) for k in range(values.shape[1])]
    return np.asarray(np.stack(sums, axis=1) / count)
