"""Local PCA of the texels of each view by itself: a cluster and weights for each texel and view.

For one view direction, a texel is a row of its values for all light directions, a few hundred numbers. Rows are
projected onto the subspace of nearly all of their energy, clustered there, and mapped back. Numbers of clusters and
components for an error bound are chosen on a subset of the views. The reported error includes quantization.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.bit_packing import max_code
from relume.assets.btf.compressed_view import (
    SEED,
    CompressedView,
    Span,
    build_mip_levels,
    residual_by_components,
    round_tables,
)
from relume.math.local_pca import Clusters, cluster, distances, residual_energy

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
U8 = NDArray[np.uint8]

MAX_CLUSTERS, MAX_COMPONENTS = 64, 16
_CLUSTERS = (1, 2, 4, 8, 16, 32, 64)  # candidates
_EXTRA_COMPONENTS = 2  # additional components, in case other views need them
_MIN_RATIO = 2.5  # smallest useful compression
_LAST_COMPONENT_BITS = (3, 4, 5, 6, 8)  # candidates for the bits of the last component's weights
_ALL_BITS = np.arange(3, 9, dtype=np.uint8)


class PcaChoice(NamedTuple):
    """Numbers of clusters and components per view, and bits of each component's weights. bits: (components,) uint8"""

    clusters: int
    components: int
    bits: U8


def choose_pca(spans: list[Span], bound: float) -> PcaChoice:
    """Choose the smallest size within the error bound, else the smallest error; then add some components."""
    best: tuple[tuple[float, ...], PcaChoice] | None = None
    texels, values = len(spans[0].z), spans[0].basis.shape[1]
    energy = max(sum(span.energy for span in spans), 1e-30)
    for num_clusters in _CLUSTERS:
        residual, rounding = np.zeros(MAX_COMPONENTS + 1), np.zeros(MAX_COMPONENTS)
        entropy, cluster_entropy = np.zeros((9, MAX_COMPONENTS)), 0.0
        for span in spans:
            clusters = cluster(span.z, num_clusters, MAX_COMPONENTS, np.random.default_rng(SEED))
            residual += span.residual + residual_energy(span.z, clusters)
            relative_weight, squared_range = _relative_weights(span.z, clusters)
            rounding += squared_range / 12
            entropy[_ALL_BITS] += _weight_entropy(relative_weight) / len(spans)
            cluster_entropy += bits_per_symbol(clusters.cluster_index) / len(spans)
        for num, last in itertools.product(range(MAX_COMPONENTS + 1), _LAST_COMPONENT_BITS):
            bits = _allocate_bits(residual[: num + 1], last)
            error = float(np.sqrt((residual[num] + (rounding[:num] / max_code(bits) ** 2).sum()) / energy))
            more = np.append(bits, np.full(min(_EXTRA_COMPONENTS, MAX_COMPONENTS - num), last, np.uint8))
            size, size_with_more = (
                num_clusters * (1 + len(each)) * values
                + texels * (cluster_entropy + entropy[each, np.arange(len(each))].sum()) / 8
                for each in (bits, more)
            )
            rank = (max(error, bound), size)
            if size_with_more * _MIN_RATIO <= texels * values and (best is None or rank < best[0]):
                best = rank, PcaChoice(num_clusters, len(more), more)
    return PcaChoice(1, 0, np.zeros(0, np.uint8)) if best is None else best[1]


def bits_per_symbol(symbols: NDArray[np.integer]) -> float:
    """Entropy of symbols that are not negative."""
    count = np.bincount(symbols)
    probability = count[count > 0] / len(symbols)
    return float(-(probability * np.log2(probability)).sum())


def _relative_weights(z: F32, clusters: Clusters) -> tuple[F32, F64]:
    """Weights over the largest of their cluster (n, C); sum of the squares of these largest ones over all rows (C,)."""
    num = clusters.components.shape[1]
    relative_weight, squared_range = np.zeros((len(z), num), np.float32), np.zeros(num)
    for k in np.unique(clusters.cluster_index):
        members = clusters.cluster_index == k
        weight = (z[members] - clusters.mean[k]) @ clusters.components[k].T
        max_weight = np.abs(weight).max(axis=0)
        relative_weight[members] = weight / np.maximum(max_weight, 1e-30)
        squared_range += len(weight) * max_weight.astype(np.float64) ** 2
    return relative_weight, squared_range


def _weight_entropy(relative_weight: F32) -> F64:
    """Bits per weight after entropy coding, for each number of bits of the rounded weights. (bits, C)"""
    return np.array(
        [
            [bits_per_symbol(np.rint((column + 1) * steps).astype(np.int64)) for column in relative_weight.T]
            for steps in max_code(_ALL_BITS)
        ]
    )


def _allocate_bits(residual: F64, last: int) -> U8:
    """Bits of weights: `last` for the last component, one more for four times its explained energy. (C,)"""
    explained = np.maximum(-np.diff(residual), 1e-30)
    return np.asarray(np.clip(last + np.rint(0.5 * np.log2(explained / explained[-1:])), last, 8), np.uint8)


def compress_view(rows: F32, span: Span, size: tuple[int, int], choice: PcaChoice, view: int) -> CompressedView:
    """Cluster and quantize the texels of one view.

    Args:
        rows: values of all texels, (texels, lights · 3). span: of these rows. size: height and width.
        choice: numbers of clusters, components and bits. view: index of the view, a seed.
    """
    num, max_steps = choice.components, max_code(choice.bits)
    clusters = cluster(span.z, choice.clusters, num, np.random.default_rng((SEED, view)))
    z = np.concatenate([level.reshape(-1, span.z.shape[1]) for level in build_mip_levels(span.z, size)])
    cluster_index, weight = _assign_clusters(z, clusters)
    max_weight = np.zeros((len(clusters.mean), num), np.float32)
    np.maximum.at(max_weight, cluster_index, np.abs(weight))
    weight = np.rint(weight * (max_steps / np.maximum(max_weight, 1e-30))[cluster_index])
    mean, mean_step, eigen, eigen_step = round_tables(
        clusters.mean @ span.basis + span.center,
        clusters.components @ span.basis,
        span.center,
        np.zeros(len(clusters.mean), np.float32),
        np.zeros(max_weight.shape, np.float32),
    )
    by_light = (rows.shape[1] // 3, 3)
    compressed_view = CompressedView(
        cluster_index.astype(np.uint8), weight.astype(np.int8), mean.reshape(-1, *by_light), mean_step,
        eigen.reshape(*eigen_step.shape, *by_light), (eigen_step * max_weight / max_steps).astype(np.float32),
        span.center.reshape(by_light), np.array(span.energy), np.zeros(0),
    )  # fmt: skip
    return compressed_view._replace(missed=residual_by_components(rows, compressed_view))


def _assign_clusters(z: F32, clusters: Clusters) -> tuple[NDArray[np.intp], F32]:
    """Nearest cluster of each row, and its weights. (n,), (n, C)"""
    cluster_index, weight = (
        np.argmin(distances(z, clusters), axis=1),
        np.empty((len(z), clusters.components.shape[1]), np.float32),
    )
    for k in np.unique(cluster_index):
        weight[cluster_index == k] = (z[cluster_index == k] - clusters.mean[k]) @ clusters.components[k].T
    return cluster_index, weight
