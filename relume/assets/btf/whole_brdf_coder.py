"""Local PCA of whole BRDFs: one cluster and one weight vector per texel for all views (Müller 2004, section 3).

    B_x(v, l) ≈ M_k(v, l) + Σ_j α_j(q) E_kj(v, l),   k = k(q),   q = q_v(x)

q_v(x) is the texel of the relief that the ray toward v through x meets, from the height: q is the same point of the
material in all views. Without a height q = x, as in the paper.

1. Rows of whole BRDFs are projected onto the principal components of some of them, in the spans of the views. A texel
   that some views do not show is fitted to those that do.
2. They are clustered by local PCA there, with as many clusters as give the smallest size.
3. Tables are least squares of all values of a view, for the rounded weights.
4. Texels of coarser levels are fitted in each view by itself, since relief hides some of what they average; a cluster
   of their own has what is between the others.

One step δ rounds everything: weights α by δ, entries of E_kj by δ / √(Σ α²), entries of M_k by δ / √n. All numbers
then trade the same error for a bit, and entropy coding makes rare large ones cheap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.sparse import csr_array

from relume.assets.btf.compressed_view import (
    SEED,
    CompressedView,
    Span,
    build_mip_levels,
    residual_by_components,
    round_tables,
    sum_squares,
)
from relume.assets.btf.local_pca_btf import INT8_MAX
from relume.assets.btf.per_view_coder import MAX_CLUSTERS, MAX_COMPONENTS, bits_per_symbol
from relume.math.local_pca import Clusters, cluster, leading_components, residual_energy

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I32 = NDArray[np.int32]

MAX_SHARED_CLUSTERS = 256
"""One of them for the coarser levels."""
_CLUSTERS = (1, 4, 16, 64, 128, MAX_SHARED_CLUSTERS - 1)  # candidates
_MAX_VECTORS = MAX_CLUSTERS * (MAX_COMPONENTS + 1)  # of the tables, as many as those of the largest views
_SPAN = 96  # R: dimension of the subspace of whole BRDFs
_NUM_BASIS_TEXELS = 1536
_MARGIN = 0.97  # of the bound: planned errors are estimates
_HIDDEN_RIDGE = 1e-3  # of the least squares of texels that some views hide, of one view's share
_RIDGE = 1e-5  # of the least squares of tables and of coarse texels, relative to each unknown's energy
_BLOCK = 2048  # texels solved at once
_STEPS = 40  # of the bisection for δ
_BITS_OF_NOISE = 2 * math.pi * math.e  # entropy of a rounded Gaussian: ½ log₂(1 + 2πe σ²)


class WholeBrdfs(NamedTuple):
    """Whole BRDFs of the material's texels, in the subspace, and what bounds their error.

    Attributes:
        z: coordinates. (texels, R)
        residual: energy of all views outside the subspace, and between texels that fall on one texel of the relief.
        energy: energy of all values. values: numbers of a whole BRDF, F.
    """

    z: F32
    residual: float
    energy: float
    values: int


class CodePlan(NamedTuple):
    """Clusters and rounded weights of all texels.

    Attributes:
        cluster: of each texel. weight: of each texel, in units of `weight_step`. (texels, C)
        weight_step: (K, C). eigen_step: of table entries. (K, C). mean_step: of means. (K,)
        size: estimated bytes; infinite if no plan meets the bound.
    """

    cluster: NDArray[np.uint8]
    weight: NDArray[np.int8]
    weight_step: F32
    eigen_step: F32
    mean_step: F32
    size: float


def project_brdfs(load_span: Callable[[int], Span], source: Shaped[I32, "V texels"], num_lights: int) -> WholeBrdfs:
    """Project whole BRDFs onto their principal components.

    Args:
        load_span: the span of a view. source: texel of the relief that each texel of each view shows.
        num_lights: number of light directions.
    """
    (num_views, texels), rng = source.shape, np.random.default_rng(SEED)
    sampled = np.sort(rng.choice(texels, min(texels, _NUM_BASIS_TEXELS), replace=False))
    sampled_rows = [
        (hits @ span.z)[sampled] / np.maximum(count[sampled, None], 1)
        for span, hits, count in _gathered(load_span, source)
    ]
    basis = leading_components(np.concatenate(sampled_rows, axis=1), _SPAN)
    ends = np.cumsum([0, *(rows.shape[1] for rows in sampled_rows)])
    del sampled_rows
    rank = max(1, len(basis))
    basis = basis if len(basis) else np.zeros((1, ends[-1]), np.float32)
    projected, counts = np.zeros((texels, rank), np.float32), np.empty((num_views, texels), np.float32)
    grams, deviation_energy, outside, energy = np.empty((num_views, rank, rank), np.float32), 0.0, 0.0, 0.0
    for view, (span, hits, count) in enumerate(_gathered(load_span, source)):
        view_basis = basis[:, ends[view] : ends[view + 1]]
        projected += (hits @ span.z) @ view_basis.T
        grams[view], counts[view] = view_basis @ view_basis.T, count
        deviation_energy += sum_squares(span.z)
        outside += span.residual
        energy += span.energy
    z, explained = _fit_visible(projected, counts, grams)
    return WholeBrdfs(z, max(outside + deviation_energy - explained, 0.0), energy, num_views * num_lights * 3)


def _gathered(load_span: Callable[[int], Span], source: I32) -> Iterator[tuple[Span, csr_array, F32]]:
    """For each view: its span, the matrix that sums its texels for each texel of the relief, and their number."""
    texels = source.shape[1]
    for view, shown in enumerate(source):
        ones = np.ones(texels, np.float32)
        hits = csr_array((ones, (shown, np.arange(texels))), (texels, texels))
        yield load_span(view), hits, np.bincount(shown, minlength=texels).astype(np.float32)


def _fit_visible(projected: F32, counts: F32, grams: F32) -> tuple[F32, float]:
    """Least squares z of Σ_v n_v |y_v − z P_v|², and the energy that it explains.

    Args:
        projected: Σ_v n_v y_v P_vᵀ. (texels, R). counts: n_v. (V, texels). grams: P_v P_vᵀ. (V, R, R)
    """
    if (counts == 1).all():  # no texel hides another: the projection
        return projected, sum_squares(projected)
    rank = projected.shape[1]
    z, explained = np.empty_like(projected), 0.0
    for start in range(0, len(projected), _BLOCK):
        rows = slice(start, start + _BLOCK)
        matrix = (counts[:, rows].T @ grams.reshape(len(grams), -1)).reshape(-1, rank, rank)
        ridged = matrix + _HIDDEN_RIDGE * np.eye(rank, dtype=np.float32)
        z[rows] = np.linalg.solve(ridged, projected[rows, :, None])[..., 0]
        through = np.einsum("nrs,ns->nr", matrix, z[rows])
        explained += float((z[rows] * (2 * projected[rows] - through)).sum(dtype=np.float64))
    return z, explained


_NONE = np.zeros(0, np.float32)
_UNREACHABLE = CodePlan(np.zeros(0, np.uint8), np.zeros((0, 0), np.int8), _NONE, _NONE, _NONE, float("inf"))


def make_plan(brdfs: WholeBrdfs, bound: float, poll: Callable[[], object]) -> CodePlan:
    """Choose the clusters and the step that meet an error bound with the smallest size.

    Args:
        brdfs: the BRDFs. bound: allowed relative RMS error. poll: called before each candidate; it may raise.
    """
    target, best = (_MARGIN * bound) ** 2 * brdfs.energy, _UNREACHABLE
    if brdfs.residual >= target:
        return best
    for num_clusters in _CLUSTERS:
        poll()
        num = min(MAX_COMPONENTS, _MAX_VECTORS // num_clusters - 1)
        clusters = cluster(brdfs.z, num_clusters, num, np.random.default_rng(SEED))
        plan = _plan_step(brdfs, clusters, target)
        if best is not _UNREACHABLE and plan.size > best.size:
            break
        best = min(best, plan, key=lambda each: each.size)
    return best


class _Weights(NamedTuple):
    """Exact weights, Σ α² of each cluster and component, n |M|² and members n of each cluster."""

    cluster: NDArray[np.intp]
    weight: F32
    energy: F64
    mean_energy: F64
    members: F64


def _plan_step(brdfs: WholeBrdfs, clusters: Clusters, target: float) -> CodePlan:
    """Find the largest δ that leaves at most `target` of squared error."""
    weights = _weights(brdfs.z, clusters)
    floor = brdfs.residual + float(residual_energy(brdfs.z, clusters)[-1])
    low, high = (np.log(factor * np.sqrt(brdfs.energy / brdfs.z.shape[0])) for factor in (1e-8, 10.0))
    if _error(brdfs, weights, floor, float(np.exp(low))) > target:
        return _UNREACHABLE
    for _ in range(_STEPS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _error(brdfs, weights, floor, float(np.exp(middle))) <= target else (low, middle)
    return _plan(brdfs, weights, float(np.exp(low)))


def _weights(z: F32, clusters: Clusters) -> _Weights:
    num_clusters, num = clusters.components.shape[:2]
    weight, energy, count = np.zeros((len(z), num), np.float32), np.zeros((num_clusters, num)), np.zeros(num_clusters)
    for k in np.unique(clusters.cluster_index):
        members = clusters.cluster_index == k
        weight[members] = (z[members] - clusters.mean[k]) @ clusters.components[k].T
        energy[k], count[k] = np.square(weight[members], dtype=np.float64).sum(axis=0), members.sum()
    mean_energy = count * np.square(clusters.mean, dtype=np.float64).sum(axis=1)
    return _Weights(clusters.cluster_index, weight, energy, mean_energy, count)


def _is_used(brdfs: WholeBrdfs, weights: _Weights, step: float) -> NDArray[np.bool_]:
    """Components that explain more than rounding them would add. (K, C)"""
    return np.asarray(weights.energy > (brdfs.values + weights.members[:, None]) * step**2 / 12)


def _error(brdfs: WholeBrdfs, weights: _Weights, floor: float, step: float) -> float:
    """Estimated squared error after rounding by δ."""
    used = _is_used(brdfs, weights, step)
    rounded = brdfs.values * (used.sum() + (weights.members > 0).sum()) + (used * weights.members[:, None]).sum()
    return float(floor + weights.energy[~used].sum() + rounded * step**2 / 12)


def _plan(brdfs: WholeBrdfs, weights: _Weights, step: float) -> CodePlan:
    """Round weights by δ, and estimate the bytes."""
    used = _is_used(brdfs, weights, step)
    largest = np.zeros(weights.energy.shape, np.float32)
    np.maximum.at(largest, weights.cluster, np.abs(weights.weight))
    weight_step = np.maximum(np.float32(step), largest / INT8_MAX)
    codes = np.rint(weights.weight / weight_step[weights.cluster]).astype(np.int8) * used[weights.cluster]
    eigen_step = np.where(used, step / np.sqrt(np.maximum(weights.energy, 1e-30)), 0).astype(np.float32)
    table_energy = np.append(weights.energy[used], weights.mean_energy)
    table_bits = 0.5 * np.log2(1 + _BITS_OF_NOISE * table_energy / (brdfs.values * step**2))
    weight_bits = [bits_per_symbol(column.astype(int) + INT8_MAX) for column in codes.T]
    texel_bits = bits_per_symbol(weights.cluster) + sum(weight_bits)
    size = (brdfs.values * table_bits.sum() + len(codes) * texel_bits) / 8
    num = int(used.any(axis=0).sum())
    return CodePlan(
        weights.cluster.astype(np.uint8),
        np.ascontiguousarray(codes[:, :num]),
        weight_step[:, :num],
        eigen_step[:, :num],
        (step / np.sqrt(np.maximum(weights.members, 1))).astype(np.float32),
        float(size),
    )


def code_view(
    rows: F32, span: Span, size: tuple[int, int], plan: CodePlan, source: Shaped[I32, " texels"]
) -> CompressedView:
    """Fit the tables of one view to its values, and round them.

    Args:
        rows: values of all texels, (texels, lights · 3). span: of these rows. size: height and width.
        plan: clusters and weights. source: texel of the relief that each texel shows.
    """
    num_clusters, num = plan.weight_step.shape
    index, codes = plan.cluster[source], plan.weight[source]
    mean, eigen = np.tile(span.center, (num_clusters, 1)), np.zeros((num_clusters, num, rows.shape[1]), np.float32)
    for k in np.unique(index):
        members = index == k
        factors = np.column_stack([np.ones(members.sum()), codes[members] * plan.weight_step[k]]).astype(np.float64)
        gram = factors.T @ factors
        ridge = _RIDGE * np.diag(np.append(0, np.maximum(np.diag(gram)[1:], 1e-30)))
        fitted = np.linalg.solve(gram + ridge, factors.T @ rows[members])
        mean[k], eigen[k] = fitted[0], fitted[1:]
    levels = [level.reshape(-1, span.z.shape[1]) for level in build_mip_levels(span.z, size)[1:]]
    coarse = np.concatenate([span.z[:0], *levels])
    coarse_mean, coarse_eigen, coarse_weight_step = _coarse_cluster(coarse, num)
    weight_step = np.vstack([plan.weight_step, coarse_weight_step])
    mean_codes, mean_step, eigen_codes, eigen_step = round_tables(
        np.vstack([mean, coarse_mean @ span.basis + span.center]),
        np.concatenate([eigen, (coarse_eigen @ span.basis)[None]]),
        span.center,
        np.append(plan.mean_step, np.float32(0)),
        np.vstack([plan.eigen_step, np.zeros(num, np.float32)]),
    )
    tables = np.concatenate([(mean_codes - span.center)[:, None], eigen_codes * eigen_step[..., None]], axis=1)
    coarse_index, coarse_codes = _fit_texels(coarse, (tables @ span.basis.T).astype(np.float32), weight_step)
    by_light = (rows.shape[1] // 3, 3)
    compressed_view = CompressedView(
        np.concatenate([index, coarse_index]), np.concatenate([codes, coarse_codes]), mean_codes.reshape(-1, *by_light),
        mean_step, eigen_codes.reshape(num_clusters + 1, num, *by_light), eigen_step * weight_step,
        span.center.reshape(by_light), np.array(span.energy), np.zeros(0),
    )  # fmt: skip
    return compressed_view._replace(missed=residual_by_components(rows, compressed_view))


def _coarse_cluster(z: F32, num: int) -> tuple[F32, F32, F32]:
    """Mean, eigenvectors and steps of weights of a cluster for coarse texels, which mix the other clusters."""
    mean, eigen = z.sum(axis=0) / max(len(z), 1), np.zeros((num, z.shape[1]), np.float32)
    if len(z) > 1:
        leading = leading_components(z - mean, num)
        eigen[: len(leading)] = leading
    return mean, eigen, np.abs((z - mean) @ eigen.T).max(axis=0, initial=1e-30) / INT8_MAX


def _fit_texels(z: F32, tables: F32, weight_step: F32) -> tuple[NDArray[np.uint8], NDArray[np.int8]]:
    """Cluster and weights of coarse texels in one view, by least squares: tables of one view are not orthogonal.

    Args:
        z: texels in the view's span. (n, R). tables: means and eigenvectors in the span. (K, 1 + C, R)
        weight_step: (K, C).
    """
    least, index = np.full(len(z), np.inf, np.float32), np.zeros(len(z), np.uint8)
    codes = np.zeros((len(z), weight_step.shape[1]), np.int8)
    for k, (table, step) in enumerate(zip(tables, weight_step, strict=True)):
        scaled, deviation = (table[1:] * step[:, None]).astype(np.float64), z - table[0]
        gram = scaled @ scaled.T
        ridge = _RIDGE * np.diag(np.maximum(np.diag(gram), 1e-30))
        steps = np.rint(deviation @ scaled.T @ np.linalg.inv(gram + ridge)).clip(-INT8_MAX, INT8_MAX)
        error = ((deviation - steps @ scaled) ** 2).sum(axis=1)
        better = error < least
        least[better], index[better], codes[better] = error[better], k, steps[better]
    return index, codes
