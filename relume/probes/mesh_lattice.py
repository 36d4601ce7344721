"""Surface probes of a scene: a grid in each face, shared between faces (mesh colors, Yuksel 2010).

A face whose longest edge is R times the finest spacing on it has R rows
(`relume.probes.triangle_grids`); where the spacing is 2^l times larger, every 2^l-th node is a probe.
Nodes of different faces merge if they coincide in position, normal and material, so that light is continuous across
edges, and a mesh finer than the spacing has fewer probes than corners. Nodes that are no probes are interpolated
(`relume.probes.interpolation_weights`). Each visible side of a face has its own nodes
(`relume.probes.visible_sides`).
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from relume.core.errors import PlanError
from relume.probes.lattice_nodes import (
    LatticeNodes,
    NodeTable,
    build_nodes,
    num_representatives,
    representative_nodes,
)
from relume.probes.triangle_grids import (
    ProbeDensity,
    ProbeGrid,
    enumerate_nodes,
    first_nodes,
    num_nodes,
)
from relume.raytrace.camera_rays import Hits
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_interaction import surface_at
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_PROBES = 2_000_000
MAX_ROWS = 255  # of the grid in one face
_NORMAL_STEPS, _MIN_NORMAL_STEPS = 3, 1  # quantization steps of normal components; equal normals merge
_SPACINGS_PER_OCTAVE = 32  # that are tried
_FINEST_SPACING = 0.5  # of that at which each probe has its area
_COARSEST_SPACING = 16.0  # in longest edges: beyond it no more nodes merge
_ROW_TOLERANCE = 1e-3  # rows: else rounding decides where a whole number of spacings fits an edge
NODES_PER_PROBE = 8  # on average; more in thin faces
_ENDS: tuple[tuple[Literal["left", "right"], int], ...] = (("left", 0), ("right", 1))  # of equal edges in sorted order
_NARROW_ASPECT = 8.0  # length over width
_COUNT_TOLERANCE = 0.05  # of the requested number of probes, which may be exceeded by that


@dataclass(frozen=True)
class PlacedProbes:
    """Probes on surfaces, and the lattice that interpolates them.

    Attributes:
        probes: by material, then in Morton order. material: material of each.
        spacing: at the RMS distance from the cameras, meters.
    """

    probe_grid: ProbeGrid
    lattice_nodes: LatticeNodes
    probes: SurfacePoints
    material: Shaped[NDArray[np.uint16], " probes"]
    spacing: float


def place_probes(
    geometry: SceneBuffers, is_open: Shaped[NDArray[np.bool_], "faces 2"], density: ProbeDensity, num_probes: int
) -> PlacedProbes:
    """Place about `num_probes` probes on all visible sides.

    Args:
        geometry: of the scene. is_open: True for visible sides. density: spacing relative to the finest, see
            `relume.probes.density`; uniform at first. num_probes: at most `MAX_PROBES`.
    Raises:
        PlanError: no surface has any area.
    """
    corners = geometry.positions[geometry.faces].astype(np.float64)
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    area = geometry.face_areas
    is_open = is_open & (area > 0)[:, None]
    total = float((is_open * area[:, None]).sum())
    if total <= 0:
        raise PlanError("no surface of the scene has any area; there is nothing to put probes on")
    finest, coarsest = density.face_extremes()
    paired_faces = paired_faces_of(geometry, edges)
    finest, coarsest = np.minimum(finest, finest[paired_faces]), np.maximum(coarsest, coarsest[paired_faces])
    surfaces = _PlacementInput(geometry, geometry.face_normals, mesh_components(geometry), is_open, density, finest)
    grids = _Grids(surfaces, edges.max(axis=1) / 2.0**finest, (coarsest - finest).astype(np.int64))
    spacing, normal_steps = _find_spacing(grids, _FINEST_SPACING * math.sqrt(total / num_probes), num_probes)
    probe_grid, grid_nodes = grids.at(spacing)
    probe_nodes = representative_nodes(grid_nodes, normal_steps)
    lattice_nodes, node_index = build_nodes(grid_nodes, probe_nodes, probe_grid)
    probes = grid_nodes.surface_points.rows(probe_nodes)._replace(seed=np.arange(len(probe_nodes), dtype=np.uint32))
    return PlacedProbes(
        probe_grid._replace(node_index=node_index), lattice_nodes, probes, grid_nodes.material[probe_nodes], spacing
    )


def paired_faces_of(geometry: SceneBuffers, edges: Shaped[F64, "faces 3"]) -> Shaped[NDArray[np.intp], " faces"]:
    """Return the other half of the quad strip of each narrow face; the face itself for all others.

    Both halves of a long narrow strip need equal grids: if only one half had nodes in a shadow, neighboring strips
    would show a net.

    Args:
        edges: lengths, each from a face's corner to the next.
    """
    position_index = geometry.position_index[geometry.faces].astype(np.int64)
    ends = np.sort(np.stack([position_index, np.roll(position_index, -1, axis=1)]), axis=0)
    edge = ends[0] * (int(position_index.max()) + 1) + ends[1]
    longest, all_edges = edges.argmax(axis=1), edge.ravel()
    longest_edge = np.take_along_axis(edge, longest[:, None], axis=1)[:, 0]
    order = np.argsort(all_edges, kind="stable")
    first, last = (order[np.searchsorted(all_edges, longest_edge, side, order) - offset] // 3 for side, offset in _ENDS)
    own_face = np.arange(len(position_index))
    is_narrow = edges.max(axis=1) ** 2 > _NARROW_ASPECT * 2 * geometry.face_areas
    return np.asarray(np.where(is_narrow, np.where(first == own_face, last, first), own_face))


def mesh_components(geometry: SceneBuffers) -> Shaped[NDArray[np.int32], " faces"]:
    """Connected components of faces that share corner positions."""
    position_index = geometry.position_index
    a, b, c = position_index[geometry.faces].T
    pairs = np.concatenate([a, b]), np.concatenate([b, c])
    num = int(position_index.max()) + 1
    _, component = connected_components(
        coo_array((np.ones(len(pairs[0]), np.bool_), pairs), (num, num)), directed=False
    )
    return np.asarray(component[a], np.int32)


def max_grid_nodes(num_faces: int, num_probes: int) -> int:
    """Maximum number of nodes of a scene's lattice: the corners of all sides, and the nodes between."""
    return 6 * num_faces + NODES_PER_PROBE * num_probes


class _PlacementInput(NamedTuple):
    """Scene that probes are placed on. normals, component, finest_power: normals, component and finest power of faces,
    see `ProbeDensity.face_extremes`.
    """

    geometry: SceneBuffers
    normals: F32
    component: NDArray[np.int32]
    is_open: NDArray[np.bool_]
    density: ProbeDensity
    finest_power: NDArray[np.int8]


class _Grids:
    """The grids of a scene at any spacing.

    Args:
        placement_input: the scene. longest: longest edges of the faces in units of the finest relative spacing on
            each, meters. power_range: of the relative spacings on each face, powers of two.
    """

    def __init__(self, placement_input: _PlacementInput, longest: F64, power_range: NDArray[np.int64]) -> None:
        self._input, self._longest, self._power_range = placement_input, longest, power_range
        self._made: tuple[NDArray[np.int64], float, ProbeGrid, NodeTable] | None = None

    @property
    def num_faces(self) -> int:
        """Number of faces of the scene."""
        return len(self._longest)

    @property
    def coarsest_spacing(self) -> float:
        """Spacing beyond which no more nodes merge, meters."""
        return _COARSEST_SPACING * float(self._longest.max())

    def num_rows(self, spacing: float) -> NDArray[np.int64]:
        """Return the number of rows on each face, a multiple of the coarsest step. spacing: meters"""
        rows = np.clip(np.ceil(self._longest / spacing - _ROW_TOLERANCE), 1, MAX_ROWS).astype(np.int64)
        step = 1 << np.minimum(self._power_range, np.log2(rows).astype(np.int64))
        return np.asarray(np.minimum(-(-rows // step), MAX_ROWS // step) * step)

    def num_nodes(self, spacing: float) -> int:
        """Count the nodes of all grids, before merging. spacing: meters"""
        return int((num_nodes(self.num_rows(spacing)) * self._input.is_open.sum(axis=1)).sum())

    def at(self, spacing: float) -> tuple[ProbeGrid, NodeTable]:
        """Place the nodes; lattice nodes are not assigned yet. spacing: meters"""
        rows = self.num_rows(spacing)
        if self._made is not None and np.array_equal(self._made[0], rows):  # often only corners
            _, made_spacing, probe_grid, grid_nodes = self._made
            return probe_grid, grid_nodes._replace(spacing=grid_nodes.spacing * (spacing / made_spacing))
        probe_grid, grid_nodes = _make_grids(self._input, rows, spacing)
        self._made = rows, spacing, probe_grid, grid_nodes
        return probe_grid, grid_nodes


def _find_spacing(grids: _Grids, finest: float, num_probes: int) -> tuple[float, int]:
    """Find the finest spacing with about `num_probes` probes, and the quantization steps of normals.

    Bisection compares counts only, so that one node more or less seldom changes the spacing.

    Args:
        grids: at any spacing. finest: least spacing, meters. num_probes: exceeded by at most `_COUNT_TOLERANCE`, unless
            the scene has more surfaces that share no probes.
    """
    node_limit = max_grid_nodes(grids.num_faces, num_probes)
    num_spacings = math.ceil(_SPACINGS_PER_OCTAVE * max(math.log2(grids.coarsest_spacing / finest), 0))

    def spacing_of(index: int) -> float:
        return finest * math.exp2(index / _SPACINGS_PER_OCTAVE)

    def fits(index: int, normal_steps: int) -> bool:
        if grids.num_nodes(spacing_of(index)) > node_limit:
            return False
        _, grid_nodes = grids.at(spacing_of(index))
        return num_representatives(grid_nodes, normal_steps) <= (1 + _COUNT_TOLERANCE) * num_probes

    normal_steps = _NORMAL_STEPS
    while normal_steps > _MIN_NORMAL_STEPS and not fits(num_spacings, normal_steps):
        normal_steps -= 1
    index = bisect_left(range(num_spacings), True, key=lambda index: fits(index, normal_steps))
    return spacing_of(index), normal_steps


def _make_grids(
    placement_input: _PlacementInput, rows: NDArray[np.int64], spacing: float
) -> tuple[ProbeGrid, NodeTable]:
    """Place the nodes of all grids; lattice nodes are not assigned yet."""
    geometry, normals, component, is_open, density, finest_power = placement_input
    num_rows = np.where(is_open, rows[:, None], 0).astype(np.uint8)
    steps = enumerate_nodes(num_rows)
    face, side = (steps.grid // 2).astype(np.int32), (steps.grid % 2).astype(np.uint8)
    uv = np.column_stack([steps.i / steps.rows, steps.j / steps.rows]).astype(np.float32)
    normal = normals[face] * np.where(side == 0, 1, -1)[:, None].astype(np.float32)
    surface_points = surface_at(geometry, Hits(face, uv, np.ones(len(face), np.float32)), -normal).points
    position = positions_in_faces(geometry, face, steps.i / steps.rows, steps.j / steps.rows)
    position -= position.min(axis=0)
    power, node_finest = density.at(steps), finest_power[face]
    step = 1 << (power - node_finest).astype(np.int64)
    step = np.minimum(step, steps.rows & -steps.rows)  # the largest power of two that divides the rows
    is_candidate = (steps.i % step == 0) & (steps.j % step == 0)
    node_spacing = spacing * 2.0 ** (node_finest + np.log2(step))
    probe_grid = ProbeGrid(num_rows, first_nodes(num_rows), np.empty(0, np.uint32))
    face_attributes = geometry.face_material[face].astype(np.uint16), side, component[face]
    return probe_grid, NodeTable(
        surface_points, position, *face_attributes, node_spacing, is_candidate, max(float(position.max()), 1e-30)
    )


def positions_in_faces(
    geometry: SceneBuffers, face: Shaped[NDArray[np.integer], " n"], u: Shaped[F64, " n"], v: Shaped[F64, " n"]
) -> Shaped[F64, "n 3"]:
    """Points on faces, meters.

    Args:
        geometry: the triangles. face: of each point. u, v: barycentric, of the second and third corner.
    """
    a, b, c = geometry.positions[geometry.faces[face]].astype(np.float64).transpose(1, 0, 2)
    return np.asarray((1 - u - v)[:, None] * a + u[:, None] * b + v[:, None] * c)


def make_corner_grid(is_open: NDArray[np.bool_]) -> ProbeGrid:
    """Make a grid of corners only. is_open: sides of faces that have nodes. (faces, 2)"""
    rows = is_open.astype(np.uint8)
    return ProbeGrid(rows, first_nodes(rows), np.empty(0, np.uint32))
