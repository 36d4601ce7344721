"""Adaptive spacing of surface probes: finer near cameras, at shadow borders and where surfaces curve.

Radiance between probes is interpolated; the error is proportional to the difference between neighbors over their
spacing s. If g is the gradient, Σ A g² s² over areas A is least for s ∝ 1 / √g. But g is estimated from probes that may
be
farther apart than a shadow border is wide, and is then too small: a slightly larger power gives less error
(docs/free-camera.md#surface-probes).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.color import luminance
from relume.lights.spherical_triangles import TriangleLights
from relume.probes.mesh_lattice import NODES_PER_PROBE, PlacedProbes, positions_in_faces
from relume.probes.triangle_grids import (
    GridSteps,
    ProbeDensity,
    ProbeGrid,
    enumerate_nodes,
    node_index,
    num_nodes,
)
from relume.raytrace.scene_buffers import SceneBuffers
from relume.raytrace.surface_points import SurfacePoints
from relume.raytrace.visibility import trace_visibility

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_MAX_COARSENESS = 4.0  # of the spacing at the RMS distance from the camera, or its inverse
_POWER = 0.6
_FINER, _COARSER = -4, 2  # powers of two, from the gradient
_OWN_WEIGHT = 0.9  # of a node's own gradient; the rest is the mean of its face
_CURVATURE_WEIGHT = 2.0  # weight of curvature relative to shadows
_NUM_UNIFORM_DIRECTIONS = 512  # directions over the sphere, because lights move
_NUM_DIRECTIONS, _NUM_TRIAL_PROBES = 96, 1000  # test directions; probes that choose them
_MIN_VARIANCE = 0.02  # variance of a direction that is visible from all tried probes, or none
_PAIRS_PER_BATCH = 1 << 14  # pairs


def density_from_distance(
    geometry: SceneBuffers, camera_positions: Shaped[F64, "cameras 3"], probe_grid: ProbeGrid
) -> ProbeDensity:
    """Compute the spacing relative to that at the RMS distance from the cameras.

    Args:
        geometry: geometry of the scene.
        camera_positions: initial cameras; twice as far away there are a quarter of the probes.
        probe_grid: at whose nodes it is computed; at the centroid of faces with one row.
    """
    steps = enumerate_nodes(probe_grid.num_rows)
    distance = np.min(
        [
            np.linalg.norm(_node_positions(geometry, steps) - camera_position, axis=1)
            for camera_position in camera_positions
        ],
        axis=0,
    )
    area = _node_areas(geometry, probe_grid, steps)
    rms_distance = np.sqrt(np.average(distance**2, weights=area)) if area.any() else 1.0
    coarseness = np.clip(distance / max(rms_distance, 1e-30), 1 / _MAX_COARSENESS, _MAX_COARSENESS)
    return ProbeDensity(probe_grid, np.rint(np.log2(coarseness)).astype(np.int8))


def density_from_shadows(
    geometry: SceneBuffers,
    placed_probes: PlacedProbes,
    camera_positions: Shaped[F64, "cameras 3"],
    lights: TriangleLights,
) -> ProbeDensity:
    """Compute the spacing, finer where neighboring probes differ in visibility.

    Args:
        geometry, camera_positions: as in `density_from_distance`. placed_probes: placed probes of a first pass.
        lights: lights of the environment, which count as much as uniform light.
    """
    probe_grid, lattice_nodes = placed_probes.probe_grid, placed_probes.lattice_nodes
    steps = enumerate_nodes(probe_grid.num_rows)
    distance_power = density_from_distance(geometry, camera_positions, probe_grid).power
    probe_gradient = _light_gradient(geometry, placed_probes.probes, _neighbor_pairs(placed_probes), lights)
    squared_gradient = probe_gradient[lattice_nodes.probe[probe_grid.node_index, 0]] ** 2
    face_mean = _face_means(squared_gradient, steps, len(probe_grid.num_rows))
    blended_gradient = _OWN_WEIGHT * squared_gradient + (1 - _OWN_WEIGHT) * face_mean[steps.grid // 2]
    weight = _node_areas(geometry, probe_grid, steps) / 4.0**distance_power * (blended_gradient > 0)
    if not weight.any():
        return ProbeDensity(probe_grid, distance_power)
    target_power = -0.5 * _POWER * np.log2(np.maximum(blended_gradient, 1e-30))
    target_power -= np.average(target_power, weights=weight)
    power = distance_power + np.rint(np.clip(target_power, _FINER, _COARSER))
    mean_density = _face_means(4.0**-power, steps, len(probe_grid.num_rows))
    finest = np.ceil(-0.5 * np.log2(NODES_PER_PROBE * np.maximum(mean_density, 1e-30)))
    return ProbeDensity(probe_grid, np.maximum(power, finest[steps.grid // 2]).astype(np.int8))


def _face_means(values: F64, steps: GridSteps, num_faces: int) -> F64:
    """Average node values over each face. (faces,)"""
    face = steps.grid // 2
    return np.bincount(face, values, num_faces) / np.maximum(np.bincount(face, minlength=num_faces), 1)


def _node_areas(geometry: SceneBuffers, probe_grid: ProbeGrid, steps: GridSteps) -> F64:
    """Divide the area of each face among its nodes, square meters. (n,)"""
    return np.asarray(geometry.face_areas[steps.grid // 2] / num_nodes(probe_grid.num_rows).ravel()[steps.grid])


def _node_positions(geometry: SceneBuffers, steps: GridSteps) -> F64:
    """Positions of nodes, meters; the centroid of faces with one row. (n, 3)"""
    is_single_row = steps.rows == 1
    u, v = (np.where(is_single_row, 1 / 3, step / steps.rows) for step in (steps.i, steps.j))
    return positions_in_faces(geometry, steps.grid // 2, u, v)


def _neighbor_pairs(placed_probes: PlacedProbes) -> NDArray[np.int64]:
    """Pairs of probes that are neighbors on a face, each pair once. (pairs, 2)"""
    lattice_node, main_probe = (
        placed_probes.probe_grid.node_index,
        placed_probes.lattice_nodes.probe[:, 0].astype(np.int64),
    )
    num, codes = len(placed_probes.probes.position), []
    for first, edges in _grids_by_size(placed_probes.probe_grid):
        probe_a, probe_b = (main_probe[lattice_node[first[:, None] + edges[:, end]]] for end in (0, 1))
        is_distinct = probe_a != probe_b
        codes.append(
            np.unique(np.minimum(probe_a, probe_b)[is_distinct] * num + np.maximum(probe_a, probe_b)[is_distinct])
        )
    return np.stack(np.divmod(np.unique(np.concatenate(codes)), num), axis=1)


def _grids_by_size(probe_grid: ProbeGrid) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Yield the first nodes of grids of each size, and the edges within such a grid. (grids,), (edges, 2)"""
    num_rows, first = probe_grid.num_rows.ravel(), probe_grid.first.ravel().astype(np.int64)
    for rows in map(int, np.unique(num_rows[num_rows > 0])):
        inner = [(i, j) for i in range(rows) for j in range(rows - i)]
        corners = [[node_index(rows, i, j), node_index(rows, i + 1, j), node_index(rows, i, j + 1)] for i, j in inner]
        edges = np.array(corners)[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2)
        yield first[num_rows == rows], edges


class _TestDirections(NamedTuple):
    """Directions in which visibility is compared. direction: (d, 3). weight: weight of the light each represents.
    (d,)
    """

    direction: F32
    weight: F64


def _choose_directions(geometry: SceneBuffers, probes: SurfacePoints, lights: TriangleLights) -> _TestDirections:
    """Sample light and uniform directions by the variance of their visibility over some probes."""
    power = luminance(lights.irradiance.astype(np.float64))
    uniform_directions = _sphere(_NUM_UNIFORM_DIRECTIONS)
    direction = np.concatenate([lights.direction, uniform_directions]).astype(np.float32)
    light_weight = np.concatenate(
        [power / max(float(power.sum()), 1e-30), np.full(len(uniform_directions), 1 / len(uniform_directions))]
    )
    trial_probes = probes.rows(slice(None, None, max(1, len(probes.position) // _NUM_TRIAL_PROBES)))
    is_visible = _visibility(geometry, trial_probes, direction)
    is_facing = trial_probes.normal @ direction.T > 0
    visible_fraction = (is_visible & is_facing).sum(axis=0) / np.maximum(is_facing.sum(axis=0), 1)
    importance = light_weight * (visible_fraction * (1 - visible_fraction) + _MIN_VARIANCE)
    cumulative = np.cumsum(importance) / importance.sum()
    indices = np.searchsorted(cumulative, (np.arange(_NUM_DIRECTIONS) + 0.5) / _NUM_DIRECTIONS)
    return _TestDirections(
        direction[indices], light_weight[indices] / importance[indices] * importance.sum() / _NUM_DIRECTIONS
    )


def _visibility(geometry: SceneBuffers, probes: SurfacePoints, directions: F32) -> NDArray[np.bool_]:
    """Trace the visibility of directions from probes. (n, d)"""
    traced = trace_visibility(geometry.embree, probes.position, probes.normal, directions)
    return np.unpackbits(traced.visible, axis=1, count=len(directions), bitorder="little").astype(np.bool_)


def _light_gradient(
    geometry: SceneBuffers, probes: SurfacePoints, pairs: NDArray[np.int64], lights: TriangleLights
) -> F64:
    """Mean difference of incident light between each probe and its neighbors, per meter. (n,)

    A direction that one of a pair does not see counts with the smaller cosine. One that both see counts with the
    squared difference of the cosines, since linear interpolation covers most of that.
    """
    directions, weight = _choose_directions(geometry, probes, lights)
    is_visible = _visibility(geometry, probes, directions)
    total_difference, length = np.zeros(len(is_visible)), np.zeros(len(is_visible))
    for start in range(0, len(pairs), _PAIRS_PER_BATCH):
        probe_a, probe_b = pairs[start : start + _PAIRS_PER_BATCH].T
        cosines = np.maximum([probes.normal[probe] @ directions.T for probe in (probe_a, probe_b)], 0)
        incident = weight * cosines.min(axis=0)
        difference = (incident * (is_visible[probe_a] != is_visible[probe_b])).sum(axis=1)
        difference += _CURVATURE_WEIGHT * (
            weight * np.square(cosines[0] - cosines[1]) * (is_visible[probe_a] & is_visible[probe_b])
        ).sum(axis=1)
        distance = np.linalg.norm(probes.position[probe_a] - probes.position[probe_b], axis=1)
        for probe in (probe_a, probe_b):
            total_difference += np.bincount(probe, difference, len(is_visible))
            length += np.bincount(probe, distance, len(is_visible))
    return np.asarray(total_difference / np.maximum(length, 1e-30))


def _sphere(count: int) -> F32:
    """Uniform directions over the sphere by a Fibonacci spiral. (count, 3)"""
    z = 1 - (2 * np.arange(count) + 1) / count
    azimuth = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    flat = np.sqrt(1 - z**2)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), z], axis=1).astype(np.float32)
