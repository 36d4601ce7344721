"""Local PCA: rows in clusters, a mean and a few components for each (Kambhatla 1997; Müller 2003)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

_ROUNDS = 6  # by means alone, then with components


class Clusters(NamedTuple):
    """Clusters of rows (n, R).

    Attributes:
        of: which of K each row is in. (n,)
        mean: (K, R) float32. components: orthonormal, the strongest first; nothing where there are no more. (K, C, R)
    """

    of: NDArray[np.intp]
    mean: F32
    components: F32


def cluster(rows: F32, num_clusters: int, num_components: int, rng: np.random.Generator) -> Clusters:
    """Cluster rows by how well each cluster's mean and components tell them; the nearest means are the start.

    Args:
        rows: (n, R) float32. num_clusters: at most. num_components: C of each.
        rng: chooses the first means.
    """
    centres = _spread(rows, num_clusters, rng)
    num = len(centres)
    of = np.argmin(_apart(rows, centres), axis=1)
    if num == 1:
        return _components(rows, of, num, num_components)
    for _ in range(_ROUNDS):
        of = np.argmin(_apart(rows, _means(rows, of, num)), axis=1)
    found = _components(rows, of, num, num_components)
    for _ in range(_ROUNDS):
        nearest = np.argmin(distances(rows, found), axis=1)
        if (nearest == of).all():
            break
        of = nearest
        found = _components(rows, of, num, num_components)
    return found


def _spread(rows: F32, num: int, rng: np.random.Generator) -> F32:
    """Choose rows that are unlike each other (k-means++)."""
    chosen = [int(rng.integers(len(rows)))]
    distance = ((rows - rows[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < num and distance.max() > 0:
        chosen.append(int(rng.choice(len(rows), p=distance / distance.sum(dtype=np.float64))))
        distance = np.minimum(distance, ((rows - rows[chosen[-1]]) ** 2).sum(axis=1))
    return rows[chosen]


def _means(rows: F32, of: NDArray[np.intp], num_clusters: int) -> F32:
    """Mean of each cluster, of all rows where it is empty. (K, R)"""
    every = rows.mean(axis=0)
    return np.stack([rows[of == k].mean(axis=0) if (of == k).any() else every for k in range(num_clusters)])


def _components(rows: F32, of: NDArray[np.intp], num_clusters: int, num: int) -> Clusters:
    """Mean and components of each cluster; one that is empty has those of all rows."""
    mean = _means(rows, of, num_clusters)
    components = np.zeros((num_clusters, num, rows.shape[1]), np.float32)
    for k in range(num_clusters):
        mine = rows[of == k] if (of == k).any() else rows
        found = strongest(mine - mean[k], num)
        components[k, : len(found)] = found
    return Clusters(of, mean, components)


def strongest(rows: F32, num: int) -> F32:
    """Find where rows (n, R) reach farthest, orthonormal. (≤ num, R)"""
    if len(rows) < rows.shape[1]:  # then the vectors of their other side are fewer
        exact = rows.astype(np.float64)  # what is found is divided by its length, which may be little
        found = _largest(exact @ exact.T, num) @ exact
        return np.ascontiguousarray(found / np.linalg.norm(found, axis=1, keepdims=True), np.float32)
    return np.ascontiguousarray(_largest((rows.T @ rows).astype(np.float64), num), np.float32)


def _largest(symmetric: F64, num: int) -> F64:
    """Find the eigenvectors of the largest eigenvalues, those of next to nothing left out. (≤ num, n)"""
    values, vectors = np.linalg.eigh(symmetric)
    is_kept = values[::-1][:num] > 1e-9 * max(float(values.max(initial=0)), 1e-30)
    return np.asarray(vectors[:, ::-1][:, :num].T[is_kept])


def _apart(rows: F32, centres: F32) -> F32:
    """Squares of distances, but for what is the same for all centres. (n, K)"""
    return np.asarray((centres**2).sum(axis=1) - 2 * rows @ centres.T)


def distances(rows: F32, found: Clusters) -> F32:
    """What means and components of each cluster miss of rows, squared. (n, K)"""
    out = (rows**2).sum(axis=1)[:, None] + _apart(rows, found.mean)
    for k, (mean, components) in enumerate(zip(found.mean, found.components, strict=True)):
        out[:, k] -= ((rows @ components.T - components @ mean) ** 2).sum(axis=1)
    return np.asarray(out, np.float32)


def missed(rows: F32, found: Clusters) -> F64:
    """What clusters miss of all rows, squared, by how many components are used, from none on. (C + 1,)"""
    left = np.zeros(1 + found.components.shape[1])
    for k, (mean, components) in enumerate(zip(found.mean, found.components, strict=True)):
        away = rows[found.of == k] - mean
        told = np.square(away @ components.T, dtype=np.float64).sum(axis=0)
        left += np.square(away, dtype=np.float64).sum() - np.concatenate([[0], np.cumsum(told)])
    return np.maximum(left, 0)
