"""Incident radiance coefficients at BTF texels: those of probes, rotated into one frame per lattice node, then the
texture's.

A rotation of the tangent frame by δ about the normal changes the coefficients of azimuthal order m to

    t_m^cos ← cos mδ t_m^cos − sin mδ t_m^sin,   t_m^sin ← sin mδ t_m^cos + cos mδ t_m^sin
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import parallel_for_chunks
from relume.live.free_camera.primary_visibility import mark_needed_probes
from relume.live.free_camera.texel_brdf.coefficient_packing import EMPTY_LANE, FUNCTIONS, HALF, HAS_ORDER, PAIRS, WIDTH
from relume.live.free_camera.texel_brdf.texture_coordinates import cross, dot, face_placements, vector_row
from relume.probes.stored_scene import StoredScene

F32 = NDArray[np.float32]
U8 = NDArray[np.uint8]

_EPSILON = np.float32(1e-12)
_NO_VECTORS = np.empty((0, 3), np.float32)


class TexelSource(NamedTuple):
    """Incident radiance of a light source, or of several.

    Attributes:
        vectors: coefficients at probes, never written to. gain: per channel.
        visibility: visible fraction along each ray, for a hard-shadow light; None: in the coefficients.
    """

    vectors: Shaped[F32, "probes 3 functions"]
    gain: tuple[float, ...] = (1.0, 1.0, 1.0)
    visibility: Shaped[F32, " rays"] | None = None

    def has_equal_light(self, other: TexelSource | None) -> bool:
        """Return whether both have the same coefficients, times equal gains."""
        return other is not None and self.vectors is other.vectors and self.gain == other.gain


class NodeLight(NamedTuple):
    """Incident radiance at lattice nodes.

    Attributes:
        tangent: approximately unit; azimuths count from it.
        vectors: coefficients of the first basis functions for each source, in lanes: the cosine parts of the three
            channels, then their sine parts.
    """

    tangent: Shaped[F32, "nodes 3"]
    vectors: Shaped[F32, "sources*nodes lanes"]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def rotation_from_vector(x, y):  # type: ignore[no-untyped-def]
    """Return cos δ and sin δ of the direction of a vector of any length; (0, 0) gives δ = 0."""
    squared_length = x * x + y * y
    if squared_length > _EPSILON:
        scale = np.float32(1) / math.sqrt(squared_length)
        return np.float32(x * scale), np.float32(y * scale)
    return np.float32(1), np.float32(0)


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def _rotation_powers(x, y):  # type: ignore[no-untyped-def]
    """Return cos mδ and sin mδ for m = 1 to 4, δ as in `rotation_from_vector`."""
    c1, s1 = rotation_from_vector(x, y)
    c2, s2 = c1 * c1 - s1 * s1, np.float32(2) * c1 * s1
    return c1, s1, c2, s2, c2 * c1 - s2 * s1, s2 * c1 + c2 * s1, c2 * c2 - s2 * s2, np.float32(2) * c2 * s2


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", forceinline=True, **NO_REFCOUNT)
def add_rotated(lanes, rotation, side, weight, is_added, out):  # type: ignore[no-untyped-def]
    """Add a rotated coefficient vector.

    Args:
        lanes: lanes of the vector. (3 F,) float32. rotation: from `_rotation_powers`.
        side: −1 if azimuths run the other way,
            else 1.
        weight: weight of the vector. is_added: add to `out`, else overwrite it. (3 F,) float32
    """
    c1, s1, c2, s2, c3, s3, c4, s4 = rotation
    for i in range(PAIRS):
        # sums over the orders, one per lane: reading back an array that was just written stalls
        is0, is1, is2, is3, is4 = HAS_ORDER[0, i], HAS_ORDER[1, i], HAS_ORDER[2, i], HAS_ORDER[3, i], HAS_ORDER[4, i]
        cosine = weight * (is0 + c1 * is1 + c2 * is2 + c3 * is3 + c4 * is4)
        sine = weight * (s1 * is1 + s2 * is2 + s3 * is3 + s4 * is4)
        mirror = is0 + side * (np.float32(1) - is0)  # order 0 is not mirrored
        a, b = lanes[i], mirror * lanes[PAIRS + i]
        cosine_sum, sine_sum = (out[i], out[PAIRS + i]) if is_added else (np.float32(0), np.float32(0))
        out[i] = cosine_sum + cosine * a - sine * b
        out[PAIRS + i] = sine_sum + sine * a + cosine * b


@nb.njit(nogil=True, cache=True, **NO_REFCOUNT)
def _fill_lanes(vectors, gain, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Copy the coefficients of probes rows[start:stop] into lanes, times a gain. out: (probes, 3 F)"""
    for p in rows[start:stop]:
        for channel in range(3):
            for i in range(WIDTH):
                if i != EMPTY_LANE:  # that lane stays zero
                    lane = i if i < HALF else PAIRS - HALF + i
                    out[p, channel * HALF + lane] = gain[channel] * vectors[p, channel, FUNCTIONS[i]]


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _sum_at_nodes(lattice_nodes, tangents, lanes, rows, start, stop, tangent, out):  # type: ignore[no-untyped-def]
    """Interpolate the coefficients at lattice nodes rows[start:stop]."""
    normal, probes, weights = lattice_nodes
    lane_buffer, sums = np.empty(3 * WIDTH, np.float32), np.empty(3 * WIDTH, np.float32)
    for v in rows[start:stop]:
        heaviest = 0
        for k in range(1, weights.shape[1]):
            if weights[v, k] > weights[v, heaviest]:
                heaviest = k
        n, t = vector_row(normal, v), vector_row(tangents, probes[v, heaviest])
        b = cross(n, t)
        tangent[v, 0], tangent[v, 1], tangent[v, 2] = t
        for i in range(3 * WIDTH):
            sums[i] = 0
        for k in range(weights.shape[1]):
            weight, probe = weights[v, k], probes[v, k]
            if weight > 0:
                probe_tangent = vector_row(tangents, probe)
                rotation = _rotation_powers(dot(probe_tangent, t), dot(probe_tangent, b))
                for i in range(3 * WIDTH):  # a view of the row would be reference-counted
                    lane_buffer[i] = lanes[probe, i]
                add_rotated(lane_buffer, rotation, np.float32(1), weight, True, sums)
        for i in range(3 * WIDTH):
            out[v, i] = sums[i]


class TexelLight:
    """Cached incident radiance at lattice nodes, and texture placements; used from one thread at a time."""

    def __init__(self) -> None:
        self._texture_placements: F32 | None = None
        self._sources: list[TexelSource | None] = []
        self._lanes, self._tangent, self._vectors = _NO_VECTORS, _NO_VECTORS, np.empty((0, 0, 3), np.float32)
        self._is_current = np.empty((0, 0), np.uint8)

    def texture_placements(self, stored_scene: StoredScene, positions: F32) -> F32:
        """Return the placements of the triangles' textures, computed once.

        Args:
            stored_scene, positions: as in `face_placements`.
        """
        if self._texture_placements is None:
            self._texture_placements = face_placements(positions, stored_scene)
        return self._texture_placements

    def around_nodes(
        self, stored_scene: StoredScene, sources: Sequence[TexelSource], is_requested: Shaped[U8, " nodes"]
    ) -> NodeLight:
        """Return the incident radiance at lattice nodes; computed nodes stay cached while a source stays the same.

        Args:
            stored_scene: has the nodes and probes. sources: the light; their visibility does not count.
            is_requested: nodes to compute; the rows of others are arbitrary.
        """
        shape = len(sources), len(is_requested)
        if self._is_current.shape != shape:
            self._lanes = np.zeros((stored_scene.probes.num_points, 3 * WIDTH), np.float32)
            self._tangent, self._vectors = (
                np.zeros((shape[1], 3), np.float32),
                np.zeros((*shape, 3 * WIDTH), np.float32),
            )
            self._is_current, self._sources = np.zeros(shape, np.uint8), [None] * shape[0]
        for k, source in enumerate(sources):
            if not source.has_equal_light(self._sources[k]):
                self._sources[k], self._is_current[k] = source._replace(visibility=None), 0
            rows = np.flatnonzero(is_requested & ~self._is_current[k])
            if len(rows):
                self._interpolate(stored_scene, source, rows, self._vectors[k])
                self._is_current[k, rows] = 1
        return NodeLight(self._tangent, self._vectors.reshape(-1, 3 * WIDTH))

    def _interpolate(
        self, stored_scene: StoredScene, source: TexelSource, rows: NDArray[np.intp], out: Shaped[F32, "nodes lanes"]
    ) -> None:
        """Interpolate the coefficients of a source at some nodes, and write their tangents."""
        is_row, is_needed = np.zeros(len(out), np.uint8), np.zeros(len(source.vectors), np.uint8)
        is_row[rows] = 1
        mark_needed_probes(stored_scene.lattice_nodes, is_row, is_needed)
        probes, gain = np.flatnonzero(is_needed), np.array(source.gain, np.float32)
        parallel_for_chunks(
            lambda start, stop: _fill_lanes(source.vectors, gain, probes, start, stop, self._lanes), len(probes)
        )
        args = stored_scene.lattice_nodes, stored_scene.probes.tangent, self._lanes, rows
        parallel_for_chunks(lambda start, stop: _sum_at_nodes(*args, start, stop, self._tangent, out), len(rows))
