"""Local PCA: rows in clusters, with a mean and a few components per cluster (Kambhatla 1997; Müller 2003)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ROUNDS = 6  # with means only, then with components


class Clusters(NamedTuple):
    """Clusters of rows (n, R).

    Attributes:
        cluster_index: cluster of each row, below K. mean: mean of each cluster.
        components: orthonormal, the strongest first; zeros if a cluster has fewer.
    """

    cluster_index: Shaped[NDArray[np.intp], " n"]
    mean: Shaped[F32, "K R"]
    components: Shaped[F32, "K C R"]


def cluster(rows: Shaped[F32, "n R"], num_clusters: int, num_components: int, rng: np.random.Generator) -> Clusters:
    """Cluster rows by their reconstruction error, starting from the nearest means.

    Args:
        rows: data. num_clusters: maximum number. num_components: C of each cluster.
        rng: chooses the initial means.
    """
    centers = _choose_distant_rows(rows, num_clusters, rng)
    num = len(centers)
    cluster_index = np.argmin(_relative_squared_distances(rows, centers), axis=1)
    if num == 1:
        return _components(rows, cluster_index, num, num_components)
    for _ in range(_ROUNDS):
        cluster_index = np.argmin(_relative_squared_distances(rows, _means(rows, cluster_index, num)), axis=1)
    clusters = _components(rows, cluster_index, num, num_components)
    for _ in range(_ROUNDS):
        nearest = np.argmin(distances(rows, clusters), axis=1)
        if (nearest == cluster_index).all():
            break
        cluster_index = nearest
        clusters = _components(rows, cluster_index, num, num_components)
    return clusters


def _choose_distant_rows(rows: F32, num: int, rng: np.random.Generator) -> F32:
    """Choose distant rows as initial means (k-means++)."""
    indices = [int(rng.integers(len(rows)))]
    distance = ((rows - rows[indices[0]]) ** 2).sum(axis=1)
    while len(indices) < num and distance.max() > 0:
        indices.append(int(rng.choice(len(rows), p=distance / distance.sum(dtype=np.float64))))
        distance = np.minimum(distance, ((rows - rows[indices[-1]]) ** 2).sum(axis=1))
    return rows[indices]


def _means(rows: F32, cluster_index: NDArray[np.intp], num_clusters: int) -> F32:
    """Mean of each cluster; the mean of all rows for an empty cluster. (K, R)"""
    overall_mean = rows.mean(axis=0)
    return np.stack(
        [
            rows[cluster_index == k].mean(axis=0) if (cluster_index == k).any() else overall_mean
            for k in range(num_clusters)
        ]
    )


def _components(rows: F32, cluster_index: NDArray[np.intp], num_clusters: int, num: int) -> Clusters:
    """Mean and components of each cluster; those of all rows for an empty cluster."""
    mean = _means(rows, cluster_index, num_clusters)
    components = np.zeros((num_clusters, num, rows.shape[1]), np.float32)
    for k in range(num_clusters):
        members = rows[cluster_index == k] if (cluster_index == k).any() else rows
        leading = leading_components(members - mean[k], num)
        components[k, : len(leading)] = leading
    return Clusters(cluster_index, mean, components)


def leading_components(rows: Shaped[F32, "n R"], num: int) -> Shaped[F32, "components R"]:
    """Orthonormal directions of the largest variance of centered rows, at most `num`."""
    if len(rows) < rows.shape[1]:  # then the Gram matrix of rows is smaller
        exact = rows.astype(np.float64)  # the eigenvectors are divided by their lengths, which may be small
        eigenvectors = _leading_eigenvectors(exact @ exact.T, num) @ exact
        return np.ascontiguousarray(eigenvectors / np.linalg.norm(eigenvectors, axis=1, keepdims=True), np.float32)
    return np.ascontiguousarray(_leading_eigenvectors((rows.T @ rows).astype(np.float64), num), np.float32)


def _leading_eigenvectors(symmetric: F64, num: int) -> F64:
    """Eigenvectors of the largest eigenvalues, without those of nearly zero. (≤ num, n)"""
    values, vectors = np.linalg.eigh(symmetric)
    is_significant = values[::-1][:num] > 1e-9 * max(float(values.max(initial=0)), 1e-30)
    return np.asarray(vectors[:, ::-1][:, :num].T[is_significant])


def _relative_squared_distances(rows: F32, centers: F32) -> F32:
    """Squared distances up to a term that is the same for all centers. (n, K)"""
    return np.asarray((centers**2).sum(axis=1) - 2 * rows @ centers.T)


def distances(rows: Shaped[F32, "n R"], clusters: Clusters) -> Shaped[F32, "n K"]:
    """Squared reconstruction error of each row by each cluster's mean and components."""
    out = (rows**2).sum(axis=1)[:, None] + _relative_squared_distances(rows, clusters.mean)
    for k, (mean, components) in enumerate(zip(clusters.mean, clusters.components, strict=True)):
        out[:, k] -= ((rows @ components.T - components @ mean) ** 2).sum(axis=1)
    return np.asarray(out, np.float32)


def residual_energy(rows: Shaped[F32, "n R"], clusters: Clusters) -> Shaped[F64, " errors"]:
    """Squared reconstruction error of all rows with 0, 1, … C components. (C + 1,)"""
    residual = np.zeros(1 + clusters.components.shape[1])
    for k, (mean, components) in enumerate(zip(clusters.mean, clusters.components, strict=True)):
        deviations = rows[clusters.cluster_index == k] - mean
        explained = np.square(deviations @ components.T, dtype=np.float64).sum(axis=0)
        residual += np.square(deviations, dtype=np.float64).sum() - np.concatenate([[0], np.cumsum(explained)])
    return np.maximum(residual, 0)
