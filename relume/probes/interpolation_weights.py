"""Interpolation weights of lattice nodes.

A mesh may be much finer than the probe spacing. Its corners interpolate a few nearby probes with Shepard's weights
((R − d) / (R d))², where R is the distance to the nearest excluded probe. The weights are then corrected as little as
possible to reproduce light that varies linearly in the tangent plane. A corner that is a probe takes its own value.
Nodes inside a face whose probes are farther apart than its nodes are interpolated along edges.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from relume.probes.triangle_grids import ProbeGrid, enumerate_nodes, find_edge_midpoints

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

PROBES_PER_NODE = 4
MATERIAL_SEPARATION = 1e3  # distance, in spacings, between materials, and between sides
_REGULARIZATION = 0.05  # of the linear constraint, against the change of weights
_MIN_WEIGHT = 2e-3
_NODES_PER_BATCH = 1 << 16  # nodes


class NodeWeights(NamedTuple):
    """Interpolation probes and weights of nodes.

    Attributes:
        probe: distinct unless of zero weight. weight: sum 1.
    """

    probe: Shaped[NDArray[np.uint32], "nodes probes_per_node"]
    weight: Shaped[F32, "nodes probes_per_node"]


def weights_from_nearby_probes(
    probe_features: Shaped[F64, "probes features"],
    node_features: Shaped[F64, "nodes features"],
    normals: Shaped[F32, "nodes 3"],
) -> NodeWeights:
    """Interpolation weights of the nearest probes.

    Args:
        probe_features, node_features: in spacings; position, then the features that separate surfaces.
        normals: normals of the nodes, unit.
    """
    tree = cKDTree(probe_features)
    num_neighbors = min(len(probe_features), PROBES_PER_NODE + 1)
    distance, neighbors = tree.query(node_features, num_neighbors, workers=-1)
    distance, neighbors = (
        distance.reshape(len(node_features), num_neighbors),
        neighbors.reshape(len(node_features), num_neighbors),
    )
    reach = np.maximum(distance[:, -1:], 1e-12)
    inside = np.clip(distance[:, :-1], 1e-6 * reach, None) if num_neighbors > 1 else np.ones((len(node_features), 1))
    raw = np.square((reach - inside) / (reach * inside)) if num_neighbors > 1 else inside
    raw[distance[:, : raw.shape[1]] > MATERIAL_SEPARATION / 2] = 0  # of another material, if its own has too few probes
    raw[:, 0] = np.maximum(raw[:, 0], 1e-12)
    node_weights = empty_weights(len(node_features))
    node_weights.weight[:, : raw.shape[1]] = raw / raw.sum(axis=1, keepdims=True)
    node_weights.probe[:, : raw.shape[1]] = neighbors[:, : raw.shape[1]]
    for start in range(0, len(node_features), _NODES_PER_BATCH):
        rows = slice(start, start + _NODES_PER_BATCH)
        towards = (probe_features[node_weights.probe[rows], :3] - node_features[rows, None, :3]).transpose(0, 2, 1)
        node_weights.weight[rows] = make_weights_linear(
            node_weights.weight[rows].astype(np.float64), towards, normals[rows].astype(np.float64)
        )
    return node_weights


def make_weights_linear(
    weight: Shaped[F64, "nodes p"], towards: Shaped[F64, "nodes 3 p"], normal: Shaped[F64, "nodes 3"]
) -> Shaped[F64, "nodes p"]:
    """Correct weights minimally so that the weighted mean of the probes is at their node, Σ w x ≈ 0.

    With W = diag(w), F the scaled x above a row of ones, and b = (0, 0, 0, 1): w − W Fᵀ (F W Fᵀ + λ)⁻¹ (F w − b).

    Args:
        weight: sum 1. towards: positions of the probes relative to the node. normal: unit.
    Returns:
        Non-negative weights: if all probes lie on one side, linear light is reproduced less well.
    """
    x = towards - normal[:, :, None] * np.einsum("vc,vcp->vp", normal, towards)[:, None]
    x *= weight[:, None] > 0
    x /= np.maximum(np.sqrt(np.einsum("vcp,vp->v", x**2, weight)), 1e-9)[:, None, None]
    ends = np.concatenate([x, np.ones_like(x[:, :1])], axis=1)
    weighted_ends = ends * weight[:, None]
    gram = np.einsum("vcp,vdp->vcd", weighted_ends, ends) + np.diag([_REGULARIZATION] * 3 + [1e-9])
    residual = np.einsum("vcp,vp->vc", ends, weight) - [0, 0, 0, 1]
    corrected_weight = weight - np.einsum(
        "vcp,vc->vp", weighted_ends, np.linalg.solve(gram, residual[..., None])[..., 0]
    )
    return _normalize(corrected_weight)


def weights_from_edge_ends(
    seed_weights: NodeWeights,
    seed_nodes: NDArray[np.intp],
    node_index: Shaped[NDArray[np.intp], " grid_nodes"],
    probe_grid: ProbeGrid,
) -> NodeWeights:
    """Interpolate the remaining nodes as midpoints of edges, coarse edges first.

    Args:
        seed_weights: seed weights of the nodes `seed_nodes`. node_index: lattice node of each grid node.
        probe_grid: probe grid of the nodes.
    """
    num_lattice_nodes, num_probes = int(node_index.max()) + 1, int(seed_weights.probe.max()) + 1
    coordinates = np.repeat(seed_nodes, PROBES_PER_NODE), seed_weights.probe.ravel().astype(np.intp)
    weights = csr_array((seed_weights.weight.ravel(), coordinates), shape=(num_lattice_nodes, num_probes))
    weights.eliminate_zeros()
    is_solved = np.zeros(num_lattice_nodes, np.bool_)
    is_solved[seed_nodes] = True
    steps, step = enumerate_nodes(probe_grid.num_rows), 1 << int(np.log2(probe_grid.num_rows.max()))
    while step >= 1:
        node, *ends = find_edge_midpoints(steps, probe_grid.first, np.flatnonzero(~is_solved[node_index]), step)
        midpoints, first_index = np.unique(node_index[node], return_index=True)
        edge_ends = np.concatenate([node_index[end[first_index]] for end in ends])
        means = csr_array(
            (np.full(len(edge_ends), np.float32(0.5)), (np.tile(midpoints, 2), edge_ends)),
            shape=(num_lattice_nodes, num_lattice_nodes),
        )
        weights = weights + means @ weights
        is_solved[midpoints] = True
        step //= 2
    return _select_heaviest(weights)


def _select_heaviest(weights: csr_array) -> NodeWeights:
    """Keep the largest weights of each row, at most `PROBES_PER_NODE`."""
    count = np.diff(weights.indptr)
    row = np.repeat(np.arange(len(count)), count)
    order = np.lexsort((-weights.data, row))
    rank = np.arange(len(order)) - np.repeat(weights.indptr[:-1], count)
    is_heaviest = rank < PROBES_PER_NODE
    node_weights = empty_weights(len(count))
    node_weights.probe[row[is_heaviest], rank[is_heaviest]] = weights.indices[order[is_heaviest]]
    node_weights.weight[row[is_heaviest], rank[is_heaviest]] = weights.data[order[is_heaviest]]
    return NodeWeights(node_weights.probe, _normalize(node_weights.weight))


def _normalize(weight: NDArray[Any]) -> NDArray[Any]:
    """Drop negative and negligible weights and normalize: each probe in use sums all its lights."""
    thresholded = np.where(weight < _MIN_WEIGHT, 0, weight)
    return np.asarray(thresholded / thresholded.sum(axis=1, keepdims=True), weight.dtype)


def empty_weights(num: int) -> NodeWeights:
    """Return zero weights. num: number of nodes"""
    shape = num, PROBES_PER_NODE
    return NodeWeights(np.zeros(shape, np.uint32), np.zeros(shape, np.float32))
