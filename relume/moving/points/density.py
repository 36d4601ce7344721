"""How densely points lie: more where eyes begin, where shadows end, and where surfaces turn.

What is between points is interpolated: off by as much as what they get differs over their distance s. With g what
differs for each metre, Σ A g² s² over areas A is least where s ∝ 1 / √g. But g is known from points that may be farther
apart than a shadow's edge is wide, and is then too small: a somewhat greater power leaves less (docs/adr/0106).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.color import luminance
from relume.light.triangles import TriangleLights
from relume.moving.points.grids import Density, Lattice, Steps, node_of, num_nodes, steps_of
from relume.moving.points.lattice import NODES_A_POINT, Placed
from relume.points import Points
from relume.trace.geometry import Geometry
from relume.trace.visibility import trace_visibility

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MOST_COARSE = 4.0  # or fine, beside a middling distance from the eye
_POWER = 0.6
_FINER, _COARSER = -4, 2  # powers of two, by what differs
_HERE = 0.9  # of a point's own; the rest is the mean of its face, whose shadows may lie between points
_TURNING = 2.0  # that surfaces which turn count beside shadows
_FROM_EVERYWHERE = 512  # directions: lights move
_DIRECTIONS, _TRIED = 96, 1000  # that tell; points that choose them
_ALL_ALIKE = 0.02  # variance that counts where all tried points see a direction, or none
_AT_ONCE = 1 << 14  # pairs


def by_distance(geometry: Geometry, eyes: F64, grids: Lattice) -> Density:
    """Find how many times farther apart points are than those at a middling distance from the eyes.

    Args:
        geometry: the scene's triangles. eyes: places that the scene is seen from at first; what is twice as far from
            them has a quarter of the points. (eyes, 3)
        grids: at whose nodes it is found; at the middle of faces with one row.
    """
    steps = steps_of(grids.num_rows)
    distance = np.min([np.linalg.norm(_places(geometry, steps) - eye, axis=1) for eye in eyes], axis=0)
    area = _areas(geometry, grids, steps)
    middling = np.sqrt(np.average(distance**2, weights=area)) if area.any() else 1.0
    coarse = np.clip(distance / max(middling, 1e-30), 1 / _MOST_COARSE, _MOST_COARSE)
    return Density(grids, np.rint(np.log2(coarse)).astype(np.int8))


def by_shadows(geometry: Geometry, placed: Placed, eyes: F64, lights: TriangleLights) -> Density:
    """The same, finer where points that lie next to each other do not see the same.

    Args:
        geometry, eyes: as of `by_distance`. placed: points on the triangles.
        lights: of the environment, which count as much as light from everywhere.
    """
    lattice, vertices = placed.lattice, placed.vertices
    steps = steps_of(lattice.num_rows)
    apart = by_distance(geometry, eyes, lattice).power
    differs = _differing(geometry, placed.points, _pairs(placed), lights)
    here = differs[vertices.point[lattice.node, 0]] ** 2
    of_face = _mean_of_faces(here, steps, len(lattice.num_rows))
    differing = _HERE * here + (1 - _HERE) * of_face[steps.grid // 2]
    weight = _areas(geometry, lattice, steps) / 4.0**apart * (differing > 0)
    if not weight.any():
        return Density(lattice, apart)
    wanted = -0.5 * _POWER * np.log2(np.maximum(differing, 1e-30))
    wanted -= np.average(wanted, weights=weight)
    power = apart + np.rint(np.clip(wanted, _FINER, _COARSER))
    share = _mean_of_faces(4.0**-power, steps, len(lattice.num_rows))
    finest = np.ceil(-0.5 * np.log2(NODES_A_POINT * np.maximum(share, 1e-30)))
    return Density(lattice, np.maximum(power, finest[steps.grid // 2]).astype(np.int8))


def _mean_of_faces(values: F64, steps: Steps, num_faces: int) -> F64:
    """Average what nodes have over those of each face. (faces,)"""
    face = steps.grid // 2
    return np.bincount(face, values, num_faces) / np.maximum(np.bincount(face, minlength=num_faces), 1)


def _areas(geometry: Geometry, grids: Lattice, steps: Steps) -> F64:
    """Share the areas of faces among their nodes, square metres. (n,)"""
    return np.asarray(geometry.face_areas[steps.grid // 2] / num_nodes(grids.num_rows).ravel()[steps.grid])


def _places(geometry: Geometry, steps: Steps) -> F64:
    """Find where nodes are, metres; of faces with one row, their middle. (n, 3)"""
    a, b, c = geometry.positions[geometry.faces[steps.grid // 2]].astype(np.float64).transpose(1, 0, 2)
    is_one = steps.rows == 1
    u, v = (np.where(is_one, 1 / 3, step / steps.rows)[:, None] for step in (steps.i, steps.j))
    return np.asarray((1 - u - v) * a + u * b + v * c)


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


class _Telling(NamedTuple):
    """Directions whose shadows tell where light changes. direction: (d, 3). weight: of what each stands for. (d,)"""

    direction: F32
    weight: F64


def _telling(geometry: Geometry, points: Points, lights: TriangleLights) -> _Telling:
    """Choose directions, of lights and from everywhere, as often as some points see them and others do not."""
    power = luminance(lights.irradiance.astype(np.float64))
    everywhere = _sphere(_FROM_EVERYWHERE)
    direction = np.concatenate([lights.direction, everywhere]).astype(np.float32)
    share = np.concatenate([power / max(float(power.sum()), 1e-30), np.full(len(everywhere), 1 / len(everywhere))])
    few = points.rows(slice(None, None, max(1, len(points.position) // _TRIED)))
    sees = _seen(geometry, few, direction)
    faces = few.normal @ direction.T > 0
    seen = (sees & faces).sum(axis=0) / np.maximum(faces.sum(axis=0), 1)
    telling = share * (seen * (1 - seen) + _ALL_ALIKE)
    ends = np.cumsum(telling) / telling.sum()
    chosen = np.searchsorted(ends, (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS)
    return _Telling(direction[chosen], share[chosen] / telling[chosen] * telling.sum() / _DIRECTIONS)


def _seen(geometry: Geometry, points: Points, directions: F32) -> NDArray[np.bool_]:
    """Find which directions points see. (n, d)"""
    traced = trace_visibility(geometry.embree, points.position, points.normal, directions)
    return np.unpackbits(traced.visible, axis=1, count=len(directions), bitorder="little").astype(np.bool_)


def _differing(geometry: Geometry, points: Points, pairs: NDArray[np.int64], lights: TriangleLights) -> F64:
    """How much each point gets otherwise than those next to it do, of all light, by the metre. (n,)

    Of what one of a pair does not see, the smaller cosine counts; of what both see, the square of how its cosine
    changes, since most of that is met by what is linear between points.
    """
    directions, weight = _telling(geometry, points, lights)
    sees = _seen(geometry, points, directions)
    differs, length = np.zeros(len(sees)), np.zeros(len(sees))
    for start in range(0, len(pairs), _AT_ONCE):
        one, other = pairs[start : start + _AT_ONCE].T
        cosines = np.maximum([points.normal[of] @ directions.T for of in (one, other)], 0)
        arriving = weight * cosines.min(axis=0)
        unlike = (arriving * (sees[one] != sees[other])).sum(axis=1)
        unlike += _TURNING * (weight * np.square(cosines[0] - cosines[1]) * (sees[one] & sees[other])).sum(axis=1)
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
