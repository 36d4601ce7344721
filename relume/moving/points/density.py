"""How densely points lie on each face: more where eyes begin, and where shadows end.

What is between points is interpolated: off by as much as what they see differs over their distance s. With g what
differs for each metre, Σ A g² s² over faces of area A is least where s ∝ 1 / √g. But g is known from points that may be
farther apart than a shadow's edge is wide, and is then too small: s ∝ g^(-3/4) leaves less (docs/adr/0096).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.triangles import TriangleLights
from relume.moving.points.lattice import Lattice, Placed, node_of, num_nodes
from relume.points import Points
from relume.trace.geometry import Geometry
from relume.trace.visibility import trace_visibility

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST_COARSE = 4.0  # or fine, beside a middling distance from the eye
_POWER = 0.75
_FINER, _COARSER = -3, 1  # powers of two, by shadows
_FROM_EVERYWHERE = 32  # directions: lights move
_AT_ONCE = 1 << 14  # pairs


def by_distance(geometry: Geometry, eyes: F64) -> F64:
    """How many times farther apart the points of each face are than those at a middling distance from the eyes.

    Args:
        geometry: the scene's triangles. eyes: places that the scene is seen from at first; what is twice as far from
            them has a quarter of the points. (eyes, 3)
    Returns:
        Powers of two. (faces,)
    """
    area, centre = geometry.face_areas, geometry.positions[geometry.faces].astype(np.float64).mean(axis=1)
    distance = np.min([np.linalg.norm(centre - eye, axis=1) for eye in eyes], axis=0)
    middling = np.sqrt(np.average(distance**2, weights=area)) if area.any() else 1.0
    coarse = np.clip(distance / max(middling, 1e-30), 1 / _MOST_COARSE, _MOST_COARSE)
    return np.asarray(2.0 ** np.rint(np.log2(coarse)))


def by_shadows(geometry: Geometry, placed: Placed, coarse: F64, lights: TriangleLights) -> F64:
    """The same, finer where points that lie next to each other do not see the same.

    Args:
        geometry: the scene's triangles. placed: points on them. coarse: by which they were placed. (faces,)
        lights: a few of the environment, which count as much as light from everywhere.
    Returns:
        Powers of two. (faces,)
    """
    lattice, vertices = placed.lattice, placed.vertices
    face = np.repeat(np.arange(lattice.num_rows.size) // 2, num_nodes(lattice.num_rows.ravel()))
    point = vertices.point[lattice.node, 0]
    differs = _differing(geometry, placed.points, _pairs(placed), lights)
    num_faces = len(geometry.faces)
    of_face = np.bincount(face, differs[point] ** 2, num_faces) / np.maximum(np.bincount(face, minlength=num_faces), 1)
    weight = geometry.face_areas / coarse**2 * (of_face > 0)
    if not weight.any():
        return coarse
    wanted = -0.5 * _POWER * np.log2(np.maximum(of_face, 1e-30))
    wanted -= np.average(wanted, weights=weight)
    return np.asarray(coarse * 2.0 ** np.rint(np.clip(wanted, _FINER, _COARSER)))


def _pairs(placed: Placed) -> NDArray[np.int64]:
    """Points that are next to each other on a face, each pair once. (pairs, 2)"""
    vertex_of, point_of = placed.lattice.node, placed.vertices.point[:, 0].astype(np.int64)
    num, codes = len(placed.points.position), []
    for first, edges in _grids(placed.lattice):
        one, other = (point_of[vertex_of[first[:, None] + edges[:, end]]] for end in (0, 1))
        apart = one != other
        codes.append(np.unique(np.minimum(one, other)[apart] * num + np.maximum(one, other)[apart]))
    return np.stack(np.divmod(np.unique(np.concatenate(codes)), num), axis=1)


def _grids(lattice: Lattice) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Where grids of each size begin, and which of their nodes are next to each other. (grids,), (edges, 2)"""
    rows_of, first = lattice.num_rows.ravel(), lattice.first.ravel().astype(np.int64)
    for rows in map(int, np.unique(rows_of[rows_of > 0])):
        inner = [(i, j) for i in range(rows) for j in range(rows - i)]
        corners = [[node_of(rows, i, j), node_of(rows, i + 1, j), node_of(rows, i, j + 1)] for i, j in inner]
        edges = np.array(corners)[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2)
        yield first[rows_of == rows], edges


def _differing(geometry: Geometry, points: Points, pairs: NDArray[np.int64], lights: TriangleLights) -> F64:
    """Share of light that each point gets otherwise than those next to it do, by the metre; of pairs, each direction
    counts by the smaller cosine. (n,)"""
    directions = np.concatenate([lights.direction, _sphere(_FROM_EVERYWHERE)]).astype(np.float32)
    power = luminance(lights.irradiance.astype(np.float64))
    weight = np.concatenate([power / max(float(power.sum()), 1e-30), np.full(_FROM_EVERYWHERE, 1 / _FROM_EVERYWHERE)])
    traced = trace_visibility(geometry.embree, points.position, points.normal, directions)
    sees = np.unpackbits(traced.visible, axis=1, count=len(directions), bitorder="little").astype(np.bool_)
    differs, length = np.zeros(len(sees)), np.zeros(len(sees))
    for start in range(0, len(pairs), _AT_ONCE):
        one, other = pairs[start : start + _AT_ONCE].T
        cosine = np.minimum(points.normal[one] @ directions.T, points.normal[other] @ directions.T)
        arriving = weight * np.maximum(cosine, 0)
        unlike = (arriving * (sees[one] != sees[other])).sum(axis=1) / np.maximum(arriving.sum(axis=1), 1e-9)
        apart = np.linalg.norm(points.position[one] - points.position[other], axis=1)
        for of in (one, other):
            differs += np.bincount(of, unlike, len(sees))
            length += np.bincount(of, apart, len(sees))
    return np.asarray(differs / np.maximum(length, 1e-30))


def _sphere(count: int) -> F32:
    """Directions evenly over the sphere, by Fibonacci's spiral. (count, 3)"""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1).astype(np.float32)
