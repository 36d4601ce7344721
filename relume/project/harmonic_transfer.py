"""What harmonics of light bring to points, their shadows included: precomputed transfer (Müller 2004, section 5).

    T_k,lm(x) = ∫ Y_lm(ωi) V(x, ωi) cos θi h_k(ωi) dωi = Σ_s ΔΩ_s Y_lm(ω_s) V cos θ_s h_k(ω_s)

with s the light triangles whose shadows are known. Smooth light c arrives as T c. Matrices of neighbours are alike, and
kept by local PCA (Sloan 2003; `relume.basis.local_pca`): a cluster for each point, and weights of its components. Of
light that changes only the clusters' few vectors are found anew.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numba as nb
import numpy as np
from numpy.typing import NDArray

from relume.basis.harmonics import NUM_HARMONICS, harmonics
from relume.basis.local_pca import cluster, distances
from relume.basis.zernike import functions_of, in_basis, ladder, num_functions
from relume.parallel import for_ranges, for_shares
from relume.points import Points
from relume.uncounted import UNCOUNTED

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

NUM_CLUSTERS, NUM_COMPONENTS = 32, 9
_POINTS_A_CLUSTER = 64  # at least, in the mean
_MOST_FITTED = 4096  # points that clusters and components are found from
_POINTS_AT_ONCE = 4096
_POINTS_A_RANGE = 256
_AT_ONCE = 128  # lights whose functions are summed together; they stay in the cache
_WIDTH = 32  # numbers that are added at once: as many vectors as hold all harmonics


def transfer_matrices(
    points: Points, visible: NDArray[np.uint8], directions: F32, solid_angles: F64, degree: int
) -> F32:
    """Find T of points.

    Args:
        points: n of them. visible: which of the lights each sees, as in `Receivers`. (n, bytes) uint8
        directions: of the lights. (M, 3) float32. solid_angles: of these. (M,)
        degree: of the in-basis.
    Returns:
        (n, K, NUM_HARMONICS) float32
    """
    values = np.zeros((len(directions), _WIDTH), np.float32)
    values[:, :NUM_HARMONICS] = harmonics(directions.astype(np.float64)) * solid_angles[:, None]
    out = np.empty((points.num_points, num_functions(degree), NUM_HARMONICS), np.float32)
    args = (ladder(degree), points.normal, points.tangent, visible, directions, values)
    for_ranges(lambda start, stop: _transfer(*args, start, stop, out), points.num_points, _POINTS_A_RANGE)
    return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy")
def _transfer(rungs, normal, tangent, visible, direction, values, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the lights that points [start, stop) see. out: (n, K, NUM_HARMONICS)"""
    wi, scratch = np.empty((2, _AT_ONCE), np.float32), np.empty((5, _AT_ONCE), np.float32)
    functions, brought = np.zeros((out.shape[1], _AT_ONCE), np.float32), np.zeros((_AT_ONCE, _WIDTH), np.float32)
    total, part = np.empty((out.shape[1], _WIDTH), np.float32), np.empty((out.shape[1], _WIDTH), np.float32)
    for p in range(start, stop):
        n, t = normal[p], tangent[p]
        bx, by, bz = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
        total[:] = 0
        waiting = 0
        for m in range(len(direction)):
            x, y, z = direction[m, 0], direction[m, 1], direction[m, 2]
            above = n[0] * x + n[1] * y + n[2] * z
            if above > 0 and (visible[p, m >> 3] >> (m & 7)) & 1:
                wi[0, waiting], wi[1, waiting] = t[0] * x + t[1] * y + t[2] * z, bx * x + by * y + bz * z
                for harmonic in range(_WIDTH):
                    brought[waiting, harmonic] = above * values[m, harmonic]
                waiting += 1
            if waiting == _AT_ONCE or m == len(direction) - 1:
                functions_of(rungs, waiting, wi, scratch, functions)
                brought[waiting:] = 0
                np.dot(functions, brought, part)
                total += part
                waiting = 0
        out[p] = total[:, :NUM_HARMONICS]


def transfer_matrices_numpy(points: Points, visible: NDArray[np.uint8], directions: F32, solid_angles: F64) -> F64:
    """Do as `transfer_matrices`, of the whole in-basis, in plain NumPy: its oracle.

    Args:
        points, visible, directions, solid_angles: as there.
    Returns:
        (n, K, NUM_HARMONICS) float64
    """
    n, t = points.normal.astype(np.float64), points.tangent.astype(np.float64)
    wi = np.einsum("nij,mj->nmi", np.stack([t, np.cross(n, t), n], axis=1), directions.astype(np.float64))
    sees = np.unpackbits(visible, axis=1, count=len(directions), bitorder="little")
    weight = sees * np.maximum(wi[..., 2], 0) * solid_angles
    return np.asarray(np.einsum("nm,nmk,mj->nkj", weight, in_basis(wi), harmonics(directions.astype(np.float64))))


class ClusteredTransfer(NamedTuple):
    """T of n points, by local PCA.

    Attributes:
        basis: mean, then components of each cluster. (clusters, 1 + C, K, NUM_HARMONICS) float16
        cluster: of each point. (n,) uint8. weight: of the components. (n, C) float16
    """

    basis: F16
    cluster: NDArray[np.uint8]
    weight: F16

    @classmethod
    def of(
        cls, num_points: int, matrices: Callable[[NDArray[np.intp]], F32], rng: np.random.Generator
    ) -> ClusteredTransfer:
        """Find clusters and components from some points, then the weights of all.

        Args:
            num_points: n. matrices: finds T of points by their numbers. (…, K, NUM_HARMONICS) float32
            rng: chooses the points, and first means among them.
        """
        chosen = np.sort(rng.permutation(num_points)[:_MOST_FITTED])
        fitted = matrices(chosen)
        clusters = max(1, min(NUM_CLUSTERS, num_points // _POINTS_A_CLUSTER))
        found = cluster(fitted.reshape(len(fitted), -1), clusters, NUM_COMPONENTS, rng)
        of, weight = np.empty(num_points, np.uint8), np.empty((num_points, NUM_COMPONENTS), np.float16)
        for start in range(0, num_points, _POINTS_AT_ONCE):
            rows = np.arange(start, min(start + _POINTS_AT_ONCE, num_points))
            some = matrices(rows).reshape(len(rows), -1)
            of[rows] = np.argmin(distances(some, found), axis=1)
            for k in np.unique(of[rows]):
                mine = rows[of[rows] == k]
                weight[mine] = (some[mine - start] - found.mean[k]) @ found.components[k].T
        basis = np.concatenate([found.mean[:, None], found.components], axis=1).astype(np.float16)
        return cls(basis.reshape(*basis.shape[:2], *fitted.shape[1:]), of, weight)

    def vectors(self, smooth: F32, rows: NDArray[np.intp]) -> F32:
        """Find light vectors of some points in smooth light.

        Args:
            smooth: its coefficients. (NUM_HARMONICS, 3) float32. rows: the points. (m,)
        Returns:
            t. (m, 3, K) float32
        """
        transferred = np.ascontiguousarray(np.einsum("ajkl,lc->ajck", self.basis.astype(np.float32), smooth))
        out = np.empty((len(rows), *transferred.shape[2:]), np.float32)
        flat, flat_out = transferred.reshape(*transferred.shape[:2], -1), out.reshape(len(rows), -1)
        weight = self.weight.astype(np.float32)
        for_shares(lambda start, stop: _sum(flat, self.cluster, weight, rows, start, stop, flat_out), len(rows))
        return out


@nb.njit(nogil=True, cache=True, fastmath=True, error_model="numpy", **UNCOUNTED)
def _sum(transferred, cluster, weight, rows, start, stop, out):  # type: ignore[no-untyped-def]
    """Sum the mean and the components of points rows[start:stop]. out: (m, 3 K)"""
    for i in range(start, stop):
        p = rows[i]
        mine = transferred[cluster[p]]
        for k in range(out.shape[1]):
            out[i, k] = mine[0, k]
        for j in range(weight.shape[1]):
            share = weight[p, j]
            for k in range(out.shape[1]):
                out[i, k] += share * mine[j + 1, k]
