"""Local PCA: texels in clusters, a mean and a few eigen-BRDFs for each (Müller 2003, 2004; Kambhatla 1997).

All texels are first brought to what spans them nearly: X ≈ Z W, with R orthonormal rows W of a randomised projection
(Halko 2011). Clusters, their means and their components are found among the R numbers of each texel, where distances
are those of the BRDFs themselves; what is kept is mapped back by W.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from relume.btf.eigen import EigenBtf
from relume.btf.rings import Rings
from relume.errors import CancelledError, MaterialError

F16 = NDArray[np.float16]
F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MOST_CLUSTERS, MOST_COMPONENTS = 64, 16
MOST_TEXELS = 512 * 512
_CLUSTERS = (1, 2, 4, 8, 16, 32, 64)  # among which the number is chosen
_SPAN = 1024  # R: clusters cannot tell what is outside the span of all
_ROUNDS = 12  # of clustering
_LEAST_IN_CLUSTER = 8  # texels
_LARGEST = 127
_PASSES = 4  # over all values


class Images(Protocol):
    """All values of a BTF, as they are read."""

    rings: Rings
    size: tuple[int, int]

    def seen_from(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32, finite, not negative"""
        ...


class _Span(NamedTuple):
    """X ≈ Z W. z: (texels, R). w: (R, views · lights · 3), orthonormal rows. energy: of X, the sum of squares."""

    z: F32
    w: F32
    energy: float


class _Clusters(NamedTuple):
    """of: each texel. mean: (K, R). components: orthonormal, the strongest first. (K, C, R)"""

    of: NDArray[np.intp]
    mean: F32
    components: F32


class _Values:
    """All values, from one side after another, with the share that is done."""

    def __init__(self, images: Images, progress: Callable[[float], object], cancelled: Callable[[], bool]) -> None:
        self._images, self._progress, self._cancelled = images, progress, cancelled
        self.num_views, self.num_texels = images.rings.num_directions, images.size[0] * images.size[1]
        self.width = self.num_views * 3  # of a texel, from one side

    def of_views(self, number: int) -> Iterator[tuple[int, F32]]:
        """Go over them for the number-th time: each view, and its rows (texels, lights · 3)."""
        for view in range(self.num_views):
            if self._cancelled():
                raise CancelledError("the compression was cancelled")
            self._progress((number * self.num_views + view) / (_PASSES * self.num_views))
            seen = self._images.seen_from(view)
            yield view, np.ascontiguousarray(seen.transpose(1, 0, 2)).reshape(self.num_texels, self.width)


def compress(
    images: Images,
    bound: float,
    progress: Callable[[float], object],
    cancelled: Callable[[], bool],
    seed: int = 0,
) -> EigenBtf:
    """Choose clusters and components so that no more is kept than an error bound needs.

    Args:
        images: the BTF. bound: relative RMS that is allowed.
        progress: called with the share done. cancelled: asked now and then.
        seed: of the projection and the first clusters.
    Raises:
        MaterialError: values are not finite, or negative, or the BTF is black. CancelledError: `cancelled` said so.
    """
    if not 0 < images.size[0] * images.size[1] <= MOST_TEXELS:
        height, width = images.size
        raise MaterialError(f"the BTF has {width}×{height} texels; at most {MOST_TEXELS:,} can be kept")
    rng = np.random.default_rng(seed)
    values = _Values(images, progress, cancelled)
    span = _span(values, rng)
    chosen, num = _choose(span, bound, rng, cancelled)
    kept = _kept(images, span, chosen, num)
    return replace(kept, error=_measured(values, span.energy, kept))


def _span(values: _Values, rng: np.random.Generator) -> _Span:
    """Find what nearly spans all texels, in three passes over the values."""
    views, texels, width = values.num_views, values.num_texels, values.width
    rank = min(_SPAN, texels, views * width)
    sketch, energy = np.zeros((texels, rank), np.float32), 0.0
    for _, rows in values.of_views(0):
        if not np.isfinite(rows).all() or rows.min() < 0:
            raise MaterialError("values of the BTF are negative or no numbers")
        energy += float(np.einsum("nf,nf->", rows, rows, dtype=np.float64))
        sketch += rows @ rng.normal(size=(width, rank)).astype(np.float32)
    if energy <= 0:
        raise MaterialError("the BTF is black")
    basis = np.linalg.qr(sketch.astype(np.float64))[0].astype(np.float32)  # of the texels' side
    w = np.empty((rank, views * width), np.float32)
    for view, rows in values.of_views(1):
        w[:, view * width : (view + 1) * width] = basis.T @ rows
    squares, vectors = np.linalg.eigh(w.astype(np.float64) @ w.T)
    strong = squares > 1e-12 * squares[-1]
    scale = vectors[:, strong] / np.sqrt(squares[strong])
    w = scale.T.astype(np.float32) @ w  # orthonormal rows
    z = np.zeros((texels, len(w)), np.float32)
    for view, rows in values.of_views(2):
        z += rows @ w[:, view * width : (view + 1) * width].T
    return _Span(z, w, energy)


def _choose(
    span: _Span, bound: float, rng: np.random.Generator, cancelled: Callable[[], bool]
) -> tuple[_Clusters, int]:
    """Find the least that keeps to a bound, else what errs least; with how many components."""
    best: tuple[float, float, _Clusters, int] | None = None
    texels = len(span.z)
    for num_clusters in _CLUSTERS:
        if num_clusters > 1 and num_clusters * _LEAST_IN_CLUSTER > texels:
            break
        if cancelled():
            raise CancelledError("the compression was cancelled")
        found = _cluster(span.z, num_clusters, rng)
        for num, error in enumerate(_errors(span, found)):
            size = len(found.mean) * (2 + num) * span.w.shape[1] + texels * (1 + 2 * num)
            rank = (max(error, bound), size, found, num)
            if best is None or rank[:2] < best[:2]:
                best = rank
    assert best is not None
    return best[2], best[3]


def _cluster(z: F32, num_clusters: int, rng: np.random.Generator) -> _Clusters:
    """Cluster texels by how well each cluster's mean and components tell them; the nearest means are the start."""
    centres = _spread(z, num_clusters, rng)
    of = np.argmin(_apart(z, centres), axis=1)
    for trial in range(_ROUNDS):
        found = _components(z, of, len(centres))
        nearest = np.argmin(_apart(z, found.mean) if trial < _ROUNDS // 2 else _distances(z, found), axis=1)
        if (nearest == of).all() and (trial >= _ROUNDS // 2 or len(centres) == 1):
            break
        of = nearest
    return _components(z, of, len(centres))


def _spread(z: F32, num: int, rng: np.random.Generator) -> F32:
    """Choose texels that are unlike each other (k-means++)."""
    chosen = [int(rng.integers(len(z)))]
    distance = ((z - z[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < num and distance.max() > 0:
        chosen.append(int(rng.choice(len(z), p=distance / distance.sum(dtype=np.float64))))
        distance = np.minimum(distance, ((z - z[chosen[-1]]) ** 2).sum(axis=1))
    return z[chosen]


def _components(z: F32, of: NDArray[np.intp], num_clusters: int) -> _Clusters:
    """Mean and components of each cluster; one that is empty has those of all texels."""
    num = min(MOST_COMPONENTS, z.shape[1])
    mean = np.empty((num_clusters, z.shape[1]), np.float32)
    components = np.zeros((num_clusters, num, z.shape[1]), np.float32)
    for k in range(num_clusters):
        rows = z[of == k] if (of == k).any() else z
        mean[k] = rows.mean(axis=0)
        found = _strongest(rows - mean[k], num)
        components[k, : len(found)] = found
    return _Clusters(of, mean, components)


def _strongest(rows: F32, num: int) -> F32:
    """Find where rows (n, R) reach farthest, orthonormal, by the smaller of their two squares. (≤ num, R)"""
    is_wide = len(rows) < rows.shape[1]
    square = (rows @ rows.T if is_wide else rows.T @ rows).astype(np.float64)
    last = len(square) - 1
    values, vectors = eigh(square, subset_by_index=(max(0, last + 1 - num), last))
    found = vectors[:, ::-1].T[values[::-1] > 1e-9 * max(float(values[-1]), 1e-30)].astype(np.float32)
    if is_wide:
        found = found @ rows
        found /= np.linalg.norm(found, axis=1, keepdims=True)
    return np.asarray(found)


def _apart(z: F32, centres: F32) -> F32:
    """Squares of distances, but for what is the same for all centres. (texels, K)"""
    return np.asarray((centres**2).sum(axis=1) - 2 * z @ centres.T)


def _distances(z: F32, found: _Clusters) -> F32:
    """What means and components of each cluster miss of texels, squared. (texels, K)"""
    out = np.empty((len(z), len(found.mean)), np.float32)
    for k, (mean, components) in enumerate(zip(found.mean, found.components, strict=True)):
        away = z - mean
        out[:, k] = (away**2).sum(axis=1) - ((away @ components.T) ** 2).sum(axis=1)
    return out


def _energy(rows: F32) -> float:
    return float(np.einsum("nr,nr->", rows, rows, dtype=np.float64))


def _errors(span: _Span, found: _Clusters) -> list[float]:
    """Relative RMS error by how many components are used, what the span misses included."""
    left = np.full(1 + found.components.shape[1], max(span.energy - _energy(span.z), 0.0))
    for k, (mean, components) in enumerate(zip(found.mean, found.components, strict=True)):
        away = span.z[found.of == k] - mean
        told = np.square(away @ components.T, dtype=np.float64).sum(axis=0)
        left += _energy(away) - np.concatenate([[0], np.cumsum(told)])
    return [float(np.sqrt(max(one, 0.0) / span.energy)) for one in left]


def _kept(images: Images, span: _Span, found: _Clusters, num: int) -> EigenBtf:
    """Map what was chosen back, and find the weights of all levels."""
    directions, shape = images.rings.num_directions, (images.rings.num_directions,) * 2 + (3,)
    components = found.components[:, :num]
    eigen = (components.reshape(-1, components.shape[2]) @ span.w).reshape(len(found.mean), num, *shape)
    step = np.maximum(np.abs(eigen).max(axis=(2, 3, 4), initial=0), 1e-30) / _LARGEST
    levels, z = _levels(span.z, images.size)
    of, weight = np.empty(len(z), np.uint8), np.empty((len(z), num))
    for start in range(0, len(z), 4096):
        rows = z[start : start + 4096]
        of[start : start + 4096] = np.argmin(_distances(rows, found._replace(components=components)), axis=1)
        cluster = of[start : start + 4096]
        for k in np.unique(cluster):
            mine = start + np.flatnonzero(cluster == k)
            weight[mine] = (z[mine] - found.mean[k]) @ components[k].T
    average = np.maximum(span.z.mean(axis=0) @ span.w, 0).reshape(directions, directions, 3)
    return EigenBtf(
        rings=images.rings,
        levels=levels,
        cluster=of,
        weight=weight.astype(np.float16),
        mean=(found.mean @ span.w).reshape(-1, *shape).astype(np.float16),
        eigen=np.rint(eigen / step[:, :, None, None, None]).astype(np.int8),
        step=step.astype(np.float32),
        average=average.astype(np.float32),
        error=(),
    )


def _measured(values: _Values, energy: float, kept: EigenBtf) -> tuple[float, ...]:
    """Relative RMS error of what is kept, as it is rounded, by how many components are used."""
    count, of = values.num_texels, kept.cluster[: values.num_texels]
    left = np.zeros(kept.num_components + 1)
    tables = kept.tables()  # (K, V, 1 + C, 3, L)
    for view, rows in values.of_views(3):
        light_first = tables[:, view].transpose(0, 1, 3, 2).reshape(len(tables), tables.shape[2], -1)
        for k in np.unique(of):
            mine = np.flatnonzero(of == k)
            away = rows[mine] - light_first[k, 0]
            left[0] += float(np.einsum("nf,nf->", away, away, dtype=np.float64))
            for j in range(kept.num_components):
                away -= kept.weight[:count][mine, j, None].astype(np.float32) * light_first[k, 1 + j]
                left[1 + j] += float(np.einsum("nf,nf->", away, away, dtype=np.float64))
    return tuple(float(np.sqrt(one / energy)) for one in left)


def _levels(z: F32, size: tuple[int, int]) -> tuple[NDArray[np.int32], F32]:
    """Average texels over 2 × 2, again and again, down to one: what a distant eye sees."""
    (height, width), rank = size, z.shape[1]
    image, levels, parts, first = z.reshape(height, width, rank), [], [], 0
    while True:
        height, width = image.shape[:2]
        levels.append((first, height, width))
        parts.append(image.reshape(-1, rank))
        first += height * width
        if height == width == 1:
            return np.array(levels, np.int32), np.concatenate(parts)
        image = image[: max(1, height // 2 * 2), : max(1, width // 2 * 2)]
        if height > 1:
            image = 0.5 * (image[0::2] + image[1::2])
        if width > 1:
            image = 0.5 * (image[:, 0::2] + image[:, 1::2])
