"""Merge the nodes of all grids, choose the probes among them, and interpolate the others from nearby probes.

Corners of a mesh that is finer than the probe spacing keep their own normals
(`relume.probes.interpolation_weights`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.probes.interpolation_weights import (
    MATERIAL_SEPARATION,
    NodeWeights,
    empty_weights,
    weights_from_edge_ends,
    weights_from_nearby_probes,
)
from relume.probes.triangle_grids import ProbeGrid
from relume.raytrace.surface_points import SurfacePoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MERGE_DISTANCE = 0.35  # of the spacing: nodes within it are one probe
_SAME_NODE_DISTANCE = 1e-3  # of the spacing: nodes within it are one lattice node
_SAME_NODE_NORMAL_STEPS = 50  # quantization steps of normal components; equal normals merge
_NORMAL_STEP_EXCESS = 0.237  # steps: else normals at 60° to an axis lie between two steps, and rounding decides
_NORMAL_WEIGHT = 1.5  # distance, in spacings, of normals that differ by a radian
_POSITION_BITS = 20  # per coordinate: positions are quantized to a millionth of the scene
_U64 = np.uint64
_HASH_MULTIPLIERS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F], np.uint64)  # odd
_COMPONENT_SEPARATION = 4.0  # extra distance, in spacings, between unconnected surfaces


class LatticeNodes(NamedTuple):
    """Merged nodes of all grids, where radiance is interpolated.

    Attributes:
        normal: unit, on the visible side. probe: interpolation probes, distinct unless of zero weight.
        weight: weight of each,
            sum 1.
    """

    normal: Shaped[F32, "nodes 3"]
    probe: Shaped[NDArray[np.uint32], "nodes probes_per_node"]
    weight: Shaped[F32, "nodes probes_per_node"]


class NodeTable(NamedTuple):
    """Nodes of all grids, before merging.

    Attributes:
        surface_points: where rays start, and normals.
        position: on the triangles, from the least corner of the bounding box, meters. Ray origins have float32's
            rounding far from the origin and offsets along the normals of single faces.
        material, side, component: material, side and component of each.
        spacing: spacing of the probes around each, meters; ratios are powers of two.
        is_candidate: True if it may be a probe; the others are midpoints of coarser grids.
        extent: longest side of the bounding box, meters.
    """

    surface_points: SurfacePoints
    position: Shaped[F64, "n 3"]
    material: Shaped[NDArray[np.uint16], " n"]
    side: Shaped[NDArray[np.uint8], " n"]
    component: Shaped[NDArray[np.int32], " n"]
    spacing: Shaped[F64, " n"]
    is_candidate: Shaped[NDArray[np.bool_], " n"]
    extent: float

    def rows(self, indices: NDArray[np.intp]) -> NodeTable:
        """Select nodes."""
        return self._replace(
            surface_points=self.surface_points.rows(indices),
            position=self.position[indices],
            material=self.material[indices],
            side=self.side[indices],
            component=self.component[indices],
            spacing=self.spacing[indices],
            is_candidate=self.is_candidate[indices],
        )


def representative_nodes(grid_nodes: NodeTable, normal_steps: int) -> NDArray[np.intp]:
    """Merge candidates within the merge distance; return one of each, by material, then in Morton order.

    Args:
        grid_nodes: grid nodes of all grids. normal_steps: quantization steps of normal components.
    """
    candidates = np.flatnonzero(grid_nodes.is_candidate)
    representatives, _ = _merge_nodes(grid_nodes.rows(candidates), _MERGE_DISTANCE, normal_steps)
    return candidates[representatives]


def num_representatives(grid_nodes: NodeTable, normal_steps: int) -> int:
    """Count `representative_nodes`, for a search over spacings.

    Args:
        grid_nodes: grid nodes of all grids; keys are hashed to one number each, with few collisions.
        normal_steps: as in `representative_nodes`.
    """
    position_key, attribute_key = _keys(
        grid_nodes.rows(np.flatnonzero(grid_nodes.is_candidate)), _MERGE_DISTANCE, normal_steps
    )
    hashes = (position_key ^ position_key >> _U64(31)) * _HASH_MULTIPLIERS[0] ^ (
        attribute_key ^ attribute_key >> _U64(29)
    ) * _HASH_MULTIPLIERS[1]
    hashes.sort()
    return 1 + int(np.count_nonzero(hashes[1:] != hashes[:-1]))


def build_nodes(
    grid_nodes: NodeTable, probe_nodes: NDArray[np.intp], probe_grid: ProbeGrid
) -> tuple[LatticeNodes, NDArray[np.uint32]]:
    """Merge nodes and compute their interpolation weights.

    Args:
        grid_nodes: grid nodes of all grids. probe_nodes: those that are probes. probe_grid: probe grid of the nodes.
    Returns:
        The merged nodes, and the merged index of each grid node.
    """
    first, node_index = _merge_nodes(grid_nodes, _SAME_NODE_DISTANCE, _SAME_NODE_NORMAL_STEPS)
    seed_nodes = np.flatnonzero(grid_nodes.is_candidate[first])
    seed_weights = _seed_weights(grid_nodes, probe_nodes, first[seed_nodes])
    node_weights = (
        seed_weights
        if len(seed_nodes) == len(first)
        else weights_from_edge_ends(seed_weights, seed_nodes, node_index, probe_grid)
    )
    return LatticeNodes(
        np.ascontiguousarray(grid_nodes.surface_points.normal[first]), *node_weights
    ), node_index.astype(np.uint32)


def _seed_weights(grid_nodes: NodeTable, probe_nodes: NDArray[np.intp], seeds: NDArray[np.intp]) -> NodeWeights:
    """Interpolation weights of candidate nodes.

    Each node measures distances in the spacing around itself: in a finer one, probes of a bent or opposite surface
    nearby would be nearer than those of its own.

    Args:
        grid_nodes: grid nodes of all grids. probe_nodes: those that are probes. seeds: the candidates.
    """
    seed_weights = empty_weights(len(seeds))
    for spacing in np.unique(grid_nodes.spacing[seeds]):
        rows = np.flatnonzero(grid_nodes.spacing[seeds] == spacing)
        features, normals = _features(grid_nodes, spacing), grid_nodes.surface_points.normal[seeds[rows]]
        weights = weights_from_nearby_probes(features[probe_nodes], features[seeds[rows]], normals)
        seed_weights.probe[rows], seed_weights.weight[rows] = weights
    return seed_weights


def _features(grid_nodes: NodeTable, spacing: float) -> F64:
    """Coordinates, in spacings, in which nearest probes are searched: position, normal, material, side, component. (n,
    11)
    """
    position = grid_nodes.position / spacing
    separation = MATERIAL_SEPARATION * np.column_stack([grid_nodes.material, grid_nodes.side])
    component_offset = np.random.default_rng(1).normal(size=(int(grid_nodes.component.max()) + 1, 3))
    component_offset *= _COMPONENT_SEPARATION / np.sqrt(2) / np.linalg.norm(component_offset, axis=1, keepdims=True)
    return np.column_stack(
        [
            position,
            _NORMAL_WEIGHT * grid_nodes.surface_points.normal,
            separation,
            component_offset[grid_nodes.component],
        ]
    )


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _key_kernel(  # type: ignore[no-untyped-def]
    positions_normals, material, side, level, size, normal_steps, start, stop, position_key, attribute_key
):
    """Compute the keys of nodes [start, stop). size: size of the boxes within which nodes merge. (n,) float64"""
    position, normal = positions_normals
    base = 2 * normal_steps + 1
    for i in range(start, stop):
        position_code, normal_code = np.uint64(0), np.int64(0)
        for axis in range(3):
            box = np.uint64(math.floor(position[i, axis] / size[i]))
            position_code = (position_code << np.uint64(_POSITION_BITS)) | box
            normal_code = (
                normal_code * base
                + np.int64(np.rint(normal[i, axis] * np.float32(normal_steps + _NORMAL_STEP_EXCESS)))
                + normal_steps
            )
        position_key[i] = position_code
        attribute_key[i] = (
            (np.uint64(2 * normal_code + side[i]) << np.uint64(24))
            | (level[i] << np.uint64(16))
            | np.uint64(material[i])
        )


def _keys(
    grid_nodes: NodeTable, merge_distance: float, normal_steps: int
) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Two numbers that are equal for nodes that merge. (n,) uint64 each"""
    level = np.rint(np.log2(grid_nodes.spacing / grid_nodes.spacing.min())).astype(np.uint64)
    size = np.maximum(merge_distance * grid_nodes.spacing, grid_nodes.extent / ((1 << _POSITION_BITS) - 1))
    position_key, attribute_key = np.empty(len(size), np.uint64), np.empty(len(size), np.uint64)
    args = (
        (grid_nodes.position, grid_nodes.surface_points.normal),
        grid_nodes.material,
        grid_nodes.side,
        level,
        size,
        normal_steps,
    )
    parallel_for_chunks(lambda start, stop: _key_kernel(*args, start, stop, position_key, attribute_key), len(size))
    return position_key, attribute_key


def _merge_nodes(
    grid_nodes: NodeTable, merge_distance: float, normal_steps: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return one node of each merged group, in Morton order, and the group of each node."""
    position_key, attribute_key = _keys(grid_nodes, merge_distance, normal_steps)
    # stable sort: of equal nodes a candidate comes first, that with the lowest index
    order = np.lexsort((~grid_nodes.is_candidate, attribute_key, position_key))
    is_new = np.concatenate(
        [
            [True],
            (position_key[order[1:]] != position_key[order[:-1]])
            | (attribute_key[order[1:]] != attribute_key[order[:-1]]),
        ]
    )
    first, group = order[is_new], np.cumsum(is_new) - 1
    fine_position = (grid_nodes.position[first] / (grid_nodes.extent / ((1 << _POSITION_BITS) - 1))).astype(np.uint64)
    in_order = np.lexsort((_morton_code(fine_position), grid_nodes.material[first]))
    rank = np.empty(len(first), np.intp)
    rank[in_order] = np.arange(len(first))
    merged_index = np.empty(len(order), np.intp)
    merged_index[order] = rank[group]
    return first[in_order], merged_index


def _morton_code(position: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Morton code of quantized positions. (n,) uint64"""
    code = np.zeros(len(position), np.uint64)
    for bit in range(_POSITION_BITS):
        for axis in range(3):
            code |= (position[:, axis] >> _U64(bit) & _U64(1)) << _U64(3 * bit + axis)
    return code
