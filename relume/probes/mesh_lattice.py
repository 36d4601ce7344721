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
    bounding_cube,
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
_NUM_TRIALS, _MAX_TRIALS = 6, 40  # after the first trials fewer probes are accepted, and each trial is coarser
_COARSENING = 1.25
_MAX_SPACING = 16.0  # in longest edges: beyond it no more nodes merge
NODES_PER_PROBE = 8  # on average; more in thin faces
_ENDS: tuple[tuple[Literal["left", "right"], int], ...] = (("left", 0), ("right", 1))  # of equal edges in sorted order
_NARROW_ASPECT = 8.0  # length over width
_COUNT_TOLERANCE = 0.05  # of the requested number of probes


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
    longest, count = edges.max(axis=1) / 2.0**finest, is_open.sum(axis=1)
    spacing, node_limit = math.sqrt(total / num_probes), max_grid_nodes(len(geometry.faces), num_probes)

    def rows_at(spacing: float) -> NDArray[np.int64]:
        return _num_rows(longest, spacing, (coarsest - finest).astype(np.int64))

    def exceeds_limit(spacing: float) -> bool:
        return int((num_nodes(rows_at(spacing)) * count).sum()) > node_limit

    while exceeds_limit(spacing) and spacing < longest.max():
        spacing *= _COARSENING
    surfaces = _PlacementInput(geometry, geometry.face_normals, mesh_components(geometry), is_open, density, finest)
    rows, normal_steps = rows_at(spacing), _NORMAL_STEPS
    probe_grid, grid_nodes = _make_grids(surfaces, rows, spacing)
    # exponent of the spacing in the number of probes; the previous trial
    power, previous_count, previous_spacing = -2.0, 0, spacing
    for trial in range(_MAX_TRIALS):
        # if normals alone make too many nodes
        normal_steps = max(_MIN_NORMAL_STEPS, _NORMAL_STEPS - max(0, trial - _NUM_TRIALS))
        num_merged = num_representatives(grid_nodes, normal_steps)
        ratio = num_merged / num_probes
        if abs(ratio - 1) < _COUNT_TOLERANCE or (ratio < 1 and trial >= _NUM_TRIALS):
            break
        if previous_count and num_merged != previous_count and spacing != previous_spacing:
            power = min(max(math.log(num_merged / previous_count) / math.log(spacing / previous_spacing), -2.0), -0.25)
        finer_spacing = spacing * ratio ** (-1 / power) * (1 if trial < _NUM_TRIALS else _COARSENING)
        if (
            ratio < 1
            and exceeds_limit(finer_spacing)
            and exceeds_limit(finer_spacing := math.sqrt(spacing * finer_spacing))
        ):
            break
        previous_count, previous_spacing, spacing = (
            num_merged,
            spacing,
            min(finer_spacing, _MAX_SPACING * float(longest.max())),
        )
        if np.array_equal(rows, new_rows := rows_at(spacing)):  # the mesh is finer than the spacing: only corners
            grid_nodes = grid_nodes._replace(spacing=grid_nodes.spacing * (spacing / previous_spacing))
        else:
            rows, (probe_grid, grid_nodes) = new_rows, _make_grids(surfaces, new_rows, spacing)
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


def _num_rows(longest: F64, spacing: float, power_range: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number of rows of grids; a multiple of the coarsest step."""
    rows = np.clip(np.ceil(longest / spacing), 1, MAX_ROWS).astype(np.int64)
    step = 1 << np.minimum(power_range, np.log2(rows).astype(np.int64))
    return np.asarray(np.minimum(-(-rows // step), MAX_ROWS // step) * step)


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
    power, node_finest = density.at(steps), finest_power[face]
    step = 1 << (power - node_finest).astype(np.int64)
    step = np.minimum(step, steps.rows & -steps.rows)  # the largest power of two that divides the rows
    is_candidate = (steps.i % step == 0) & (steps.j % step == 0)
    node_spacing = spacing * 2.0 ** (node_finest + np.log2(step))
    probe_grid = ProbeGrid(num_rows, first_nodes(num_rows), np.empty(0, np.uint32))
    face_attributes = geometry.face_material[face].astype(np.uint16), side, component[face]
    return probe_grid, NodeTable(
        surface_points, *face_attributes, node_spacing, is_candidate, *bounding_cube(surface_points)
    )


def make_corner_grid(is_open: NDArray[np.bool_]) -> ProbeGrid:
    """Make a grid of corners only. is_open: sides of faces that have nodes. (faces, 2)"""
    rows = is_open.astype(np.uint8)
    return ProbeGrid(rows, first_nodes(rows), np.empty(0, np.uint32))
