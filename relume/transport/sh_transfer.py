"""Precomputed transfer of spherical harmonics, shadowed (Müller 2004, section 5).

    T_k,lm(x) = ∫ Y_lm(ωi) V(x, ωi) cos θi h_k(ωi) dωi = Σ_s ΔΩ_s Y_lm(ω_s) V cos θ_s h_k(ω_s)

s are the light triangles with known visibility. Low-frequency light c has the incident coefficients T c. Matrices of
neighboring points are similar and compressed by local PCA (Sloan 2003; `relume.math.local_pca`): a cluster per point,
and weights of its components. When the light changes, only the few vectors of the clusters are computed again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numba as nb
import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.numba_options import NO_REFCOUNT
from relume.core.thread_pools import for_ranges, parallel_for_chunks
from relume.math.local_pca import cluster, distances
from relume.math.spherical_harmonics import NUM_HARMONICS, harmonics
from relume.math.zernike import evaluate_basis, num_functions, recurrence
from relume.raytrace.surface_points import SurfacePoints

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_CLUSTERS, NUM_COMPONENTS = 32, 9
_MIN_POINTS_PER_CLUSTER = 64  # on average
_MAX_FITTED_POINTS = 4096  # points that clusters and components are fitted to
_POINTS_PER_BATCH = 4096
_POINTS_PER_RANGE = 256
_LIGHTS_PER_BATCH = 128  # lights whose functions are summed together; they stay in the cache
_WIDTH = 32  # floats added at once: as many vectors as hold all harmonics


def transfer_matrices(
    points: SurfacePoints,
    visible: Shaped[NDArray[np.uint8], "n bytes"],
    directions: Shaped[F32, "M 3"],
    solid_angles: Shaped[F64, " M"],
    degree: int,
) -> Shaped[F32, "n K harmonics"]:
    """Compute the transfer matrices T of points.

    Args:
        points: n points. visible: visibility bits of the lights, as in `ShadingPoints`.
        directions, solid_angles: directions and solid angles of the lights. degree: degree of the Zernike basis.
    """
    values = np.zeros((len(directions), _WIDTH), np.float32)
    values[:, :NUM_HARMONICS] = harmonics(directions.astype(np.float64)) * solid_angles[:, None]
    out = np.empty((points.num_points, num_functions(degree), NUM_HARMONICS), np.float32)
    args = (recurrence(degree), points.normal, points.tangent, visible, directions, values)
    for_ranges(lambda start, stop: _transfer(*args, start, stop, out), points.num_points, _POINTS_PER_RANGE)
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _transfer(recurrence_table, normal, tangent, visible, direction, values, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the visible lights of points [start, stop). out: (n, K, NUM_HARMONICS)"""
    wi, scratch = np.empty((2, _LIGHTS_PER_BATCH), np.float32), np.empty((5, _LIGHTS_PER_BATCH), np.float32)
    functions, weighted_harmonics = (
        np.zeros((out.shape[1], _LIGHTS_PER_BATCH), np.float32),
        np.zeros((_LIGHTS_PER_BATCH, _WIDTH), np.float32),
    )
    total, product = np.empty((out.shape[1], _WIDTH), np.float32), np.empty((out.shape[1], _WIDTH), np.float32)
    for p in range(start, stop):
        n, t = normal[p], tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        total[:] = 0
        num_pending = 0
        for m in range(len(direction)):
            x, y, z = direction[m, 0], direction[m, 1], direction[m, 2]
            above = n[0] * x + n[1] * y + n[2] * z
            if above > 0 and (visible[p, m >> 3] >> (m & 7)) & 1:
                wi[0, num_pending], wi[1, num_pending] = t[0] * x + t[1] * y + t[2] * z, bx * x + by * y + bz * z
                for harmonic in range(_WIDTH):
                    weighted_harmonics[num_pending, harmonic] = above * values[m, harmonic]
                num_pending += 1
            if num_pending == _LIGHTS_PER_BATCH or m == len(direction) - 1:
                evaluate_basis(recurrence_table, num_pending, wi, scratch, functions)
                weighted_harmonics[num_pending:] = 0
                np.dot(functions, weighted_harmonics, product)
                total += product
                num_pending = 0
        for k in range(total.shape[0]):
            for harmonic in range(NUM_HARMONICS):
                out[p, k, harmonic] = total[k, harmonic]


class ClusteredTransfer(NamedTuple):
    """T of n points, compressed by local PCA.

    Attributes:
        basis: mean, then components of each cluster.
        cluster: cluster index of each point. weight: weights of the components.
    """

    basis: Shaped[F16, "clusters vectors K harmonics"]
    cluster: Shaped[NDArray[np.uint8], " n"]
    weight: Shaped[F16, "n components"]

    @classmethod
    def fit(
        cls, num_points: int, matrices: Callable[[NDArray[np.intp]], F32], rng: np.random.Generator
    ) -> ClusteredTransfer:
        """Fit clusters and components to some points, then compute the weights of all.

        Args:
            num_points: n. matrices: returns T of points by index. (…, K, NUM_HARMONICS) float32
            rng: selects the points, and the first means among them.
        """
        sample = np.sort(rng.permutation(num_points)[:_MAX_FITTED_POINTS])
        fitted = matrices(sample)
        clusters = max(1, min(NUM_CLUSTERS, num_points // _MIN_POINTS_PER_CLUSTER))
        pca = cluster(fitted.reshape(len(fitted), -1), clusters, NUM_COMPONENTS, rng)
        cluster_index, weight = np.empty(num_points, np.uint8), np.empty((num_points, NUM_COMPONENTS), np.float16)
        for start in range(0, num_points, _POINTS_PER_BATCH):
            rows = np.arange(start, min(start + _POINTS_PER_BATCH, num_points))
            batch = matrices(rows).reshape(len(rows), -1)
            cluster_index[rows] = np.argmin(distances(batch, pca), axis=1)
            for k in np.unique(cluster_index[rows]):
                members = rows[cluster_index[rows] == k]
                weight[members] = (batch[members - start] - pca.mean[k]) @ pca.components[k].T
        basis = np.concatenate([pca.mean[:, None], pca.components], axis=1).astype(np.float16)
        return cls(basis.reshape(*basis.shape[:2], *fitted.shape[1:]), cluster_index, weight)

    def incident_coefficients(
        self, smooth: Shaped[F32, "harmonics 3"], rows: Shaped[NDArray[np.intp], " m"]
    ) -> Shaped[F32, "m 3 K"]:
        """Compute the incident radiance coefficients of points `rows` in low-frequency light `smooth`."""
        transferred = np.ascontiguousarray(np.einsum("ajkl,lc->ajck", self.basis.astype(np.float32), smooth))
        out = np.empty((len(rows), *transferred.shape[2:]), np.float32)
        flat, flat_out = transferred.reshape(*transferred.shape[:2], -1), out.reshape(len(rows), -1)
        weight = self.weight.astype(np.float32)
        parallel_for_chunks(
            lambda start, stop: _sum(flat, self.cluster, weight, rows, start, stop, flat_out), len(rows)
        )
        return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **NO_REFCOUNT)
def _sum(transferred, cluster, weight, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the mean and the components of points rows[start:stop]. out: (m, 3 K)"""
    for i in range(start, stop):
        p = rows[i]
        cluster_coefficients = transferred[cluster[p]]
        for k in range(out.shape[1]):
            out[i, k] = cluster_coefficients[0, k]
        for j in range(weight.shape[1]):
            component_weight = weight[p, j]
            for k in range(out.shape[1]):
                out[i, k] += component_weight * cluster_coefficients[j + 1, k]
