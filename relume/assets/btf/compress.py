"""Compression of a BTF by local PCA of the texels, one view direction after another (Müller 2004).

For one view direction, a texel is a row of its values for all light directions, a few hundred numbers. Rows are
projected onto the subspace of nearly all of their energy, clustered there, and mapped back. Numbers of clusters and
components for an error bound are chosen on a subset of the views. The reported error includes quantization.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.bit_packing import cluster_bits, max_code
from relume.assets.btf.direction_rings import DirectionGrid
from relume.assets.btf.local_pca_btf import INT8_MAX, LocalPcaBtf
from relume.assets.btf.partial_results import Arrays, PartialCompression
from relume.core.errors import CancelledError, MaterialError
from relume.math.local_pca import Clusters, cluster, distances, leading_components, residual_energy

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

MAX_CLUSTERS, MAX_COMPONENTS = 64, 16
MAX_TEXELS = 512 * 512
# texels times directions: values of one view take 400 MB, and up to four copies exist
_MAX_TEXEL_DIRECTIONS = 1 << 25
_CLUSTERS = (1, 2, 4, 8, 16, 32, 64)  # candidates
_SEED = 0  # of the initial clusters
_SPAN = 64  # R: dimension of the subspace
_NUM_CHOICE_VIEWS = 5  # views for choosing the parameters
_CHOICE_PROGRESS = 0.2  # approximate fraction of the time
_EXTRA_COMPONENTS = 2  # additional components, in case other views need them
_MIN_RATIO = 2.5  # smallest useful compression
_LAST_COMPONENT_BITS = (3, 4, 5, 6, 8)  # candidates for the bits of the last component's weights


class ViewArrays(Protocol):
    """All values of a BTF."""

    grid: DirectionGrid
    size: tuple[int, int]

    def get_view(self, view: int) -> Shaped[F32, "lights texels 3"]:
        """Values of all texels from one view direction, finite and not negative."""
        ...


class _Span(NamedTuple):
    """rows ≈ center + z basis, orthonormal. z: (texels, R). basis: (R, F). residual, energy: sums of squares."""

    z: F32
    basis: F32
    center: F32
    residual: float
    energy: float


class _PcaChoice(NamedTuple):
    """Numbers of clusters and components per view, and bits of each component's weights. bits: (components,) uint8"""

    clusters: int
    components: int
    bits: NDArray[np.uint8]


class _CompressedView(NamedTuple):
    """One view of `LocalPcaBtf`'s arrays; total energy, and residual energy by the number of components."""

    cluster: NDArray[np.uint8]
    weight: NDArray[np.int8]
    mean: NDArray[np.float16]
    eigen: NDArray[np.int8]
    step: F32
    average: F32
    energy: NDArray[np.float64]
    missed: F64


def max_texels(directions: int) -> int:
    """Largest allowed number of texels for a number of directions."""
    return min(MAX_TEXELS, _MAX_TEXEL_DIRECTIONS // directions)


def compress(
    images: ViewArrays,
    bound: float,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    partial_compression: PartialCompression | None = None,
) -> LocalPcaBtf:
    """Compress a BTF with as few clusters, components and bits as an error bound allows.

    Args:
        images: the BTF. bound: allowed relative RMS error.
        progress: called with the completed fraction. is_canceled: checked before each view.
        partial_compression: stores partial results, and provides earlier ones.
    Raises:
        MaterialError: values are not finite, or negative, or the BTF is black. CancelledError: `is_canceled` is true.
    """
    (height, width), num_views = images.size, images.grid.num_directions
    if not 0 < height * width <= max_texels(num_views):
        raise MaterialError(
            f"the BTF has {width}×{height} texels, the limit for {num_views} directions is {max_texels(num_views):,}; "
            "scale it down"
        )

    def read_rows(view: int, fraction: float) -> F32:
        if is_canceled():
            raise CancelledError("the compression was canceled")
        progress(fraction)
        return _view_rows(images, view)

    arrays = _load_or_compute(
        partial_compression, "choice", lambda: _choose_from_views(images, bound, read_rows)._asdict()
    )
    choice = _PcaChoice(int(arrays["clusters"]), int(arrays["components"]), arrays["bits"])
    compressed_views = []
    for view in range(num_views):
        rows = partial(read_rows, view, _CHOICE_PROGRESS + (1 - _CHOICE_PROGRESS) * view / num_views)
        compressed_views.append(
            _CompressedView(
                **_load_or_compute(
                    partial_compression, f"view-{view}", partial(_compress_view, rows, images.size, choice, view)
                )
            )
        )
    energy = float(sum(compressed_view.energy for compressed_view in compressed_views))
    if energy <= 0:
        raise MaterialError("the BTF is black; check its images")
    btf = _stack_views(images, compressed_views, choice.bits, energy)
    return btf.with_components(next((j for j, rms in enumerate(btf.error) if rms <= bound), choice.components))


def _load_or_compute(
    partial_compression: PartialCompression | None, name: str, compute: Callable[[], Arrays]
) -> Arrays:
    """Load a partial result, or compute and save it."""
    arrays = None if partial_compression is None else partial_compression.load(name)
    if arrays is None:
        arrays = compute()
        if partial_compression is not None:
            partial_compression.save(name, arrays)
    return arrays


def _choose_from_views(images: ViewArrays, bound: float, read_rows: Callable[[int, float], F32]) -> _PcaChoice:
    """Choose clusters, components and bits on a subset of the views."""
    num_views = images.grid.num_directions
    sampled_views = np.unique(np.linspace(0, num_views - 1, _NUM_CHOICE_VIEWS).round().astype(int))
    spans = [
        _span(read_rows(view, _CHOICE_PROGRESS * index / len(sampled_views)))
        for index, view in enumerate(sampled_views)
    ]  # fmt: skip
    return _choose_pca(spans, bound)


def _view_rows(images: ViewArrays, view: int) -> F32:
    """Values of all texels from one view direction. (texels, lights · 3)"""
    values = images.get_view(view)
    if not np.isfinite(values).all() or values.min() < 0:
        raise MaterialError("the BTF has negative or non-finite values; check its images")
    return np.ascontiguousarray(values.transpose(1, 0, 2)).reshape(values.shape[1], -1)


def _span(rows: F32) -> _Span:
    center = rows.mean(axis=0)
    deviations = rows - center
    components = leading_components(deviations, _SPAN)
    basis = components if len(components) else np.zeros((1, rows.shape[1]), np.float32)  # all texels are equal
    z = deviations @ basis.T
    residual = max(_energy(deviations) - _energy(z), 0.0)
    return _Span(z, basis, center, residual, _energy(rows))


def _energy(rows: F32) -> float:
    return float(np.einsum("nr,nr->", rows, rows, dtype=np.float64))


def _choose_pca(spans: list[_Span], bound: float) -> _PcaChoice:
    """Choose the smallest size within the error bound, else the smallest error; then add some components."""
    best: tuple[tuple[float, ...], _PcaChoice] | None = None
    texels, values = len(spans[0].z), spans[0].basis.shape[1]
    energy = max(sum(span.energy for span in spans), 1e-30)
    for num_clusters in _CLUSTERS:
        residual, rounding = np.zeros(MAX_COMPONENTS + 1), np.zeros(MAX_COMPONENTS)
        for span in spans:
            clusters = cluster(span.z, num_clusters, MAX_COMPONENTS, np.random.default_rng(_SEED))
            residual += span.residual + residual_energy(span.z, clusters)
            rounding += _rounding_error(span.z, clusters)
        for num, last in itertools.product(range(MAX_COMPONENTS + 1), _LAST_COMPONENT_BITS):
            bits = _allocate_bits(residual[: num + 1], last)
            error = float(np.sqrt((residual[num] + (rounding[:num] / max_code(bits) ** 2).sum()) / energy))
            rank = (max(error, bound), _size(num_clusters, bits, texels, values))
            more = np.append(bits, np.full(min(_EXTRA_COMPONENTS, MAX_COMPONENTS - num), last, np.uint8))
            is_small = _size(num_clusters, more, texels, values) * _MIN_RATIO <= texels * values
            if is_small and (best is None or rank < best[0]):
                best = rank, _PcaChoice(num_clusters, len(more), more)
    return _PcaChoice(1, 0, np.zeros(0, np.uint8)) if best is None else best[1]


def _size(num_clusters: int, bits: NDArray[np.uint8], texels: int, values: int) -> float:
    """Approximate bytes of a view."""
    return num_clusters * (2 + len(bits)) * values + texels * (cluster_bits(num_clusters) + float(bits.sum())) / 8


def _rounding_error(z: F32, clusters: Clusters) -> F64:
    """Squared error of rounding weights, if the largest of each cluster were one step. (C,)"""
    out = np.zeros(clusters.components.shape[1])
    for k in np.unique(clusters.cluster_index):
        weight = (z[clusters.cluster_index == k] - clusters.mean[k]) @ clusters.components[k].T
        out += len(weight) * np.abs(weight).max(axis=0).astype(np.float64) ** 2 / 12
    return out


def _allocate_bits(residual: F64, last: int) -> NDArray[np.uint8]:
    """Bits of weights: `last` for the last component, one more for four times its explained energy. (C,)"""
    explained = np.maximum(-np.diff(residual), 1e-30)
    return np.asarray(np.clip(last + np.rint(0.5 * np.log2(explained / explained[-1:])), last, 8), np.uint8)


def _compress_view(read_rows: Callable[[], F32], size: tuple[int, int], choice: _PcaChoice, view: int) -> Arrays:
    """Cluster and quantize the texels of one view."""
    rows, rng = read_rows(), np.random.default_rng((_SEED, view))
    span = _span(rows)
    num, max_steps = choice.components, max_code(choice.bits)
    clusters = cluster(span.z, choice.clusters, num, rng)
    z = np.concatenate([level.reshape(-1, span.z.shape[1]) for level in build_mip_levels(span.z, size)])
    cluster_index, weight = _assign_clusters(z, clusters)
    max_weight = np.zeros((len(clusters.mean), num), np.float32)
    np.maximum.at(max_weight, cluster_index, np.abs(weight))
    weight = np.rint(weight * (max_steps / np.maximum(max_weight, 1e-30))[cluster_index])
    mean = (clusters.mean @ span.basis + span.center).astype(np.float16)
    eigen = clusters.components @ span.basis
    max_abs = np.maximum(np.abs(eigen).max(axis=2, initial=0), 1e-30)
    eigen, step = (
        np.rint(eigen * (INT8_MAX / max_abs)[:, :, None]),
        (max_abs * max_weight / (INT8_MAX * max_steps)).astype(np.float32),
    )
    by_light = (rows.shape[1] // 3, 3)
    compressed_view = _CompressedView(
        cluster_index.astype(np.uint8), weight.astype(np.int8), mean.reshape(-1, *by_light),
        eigen.astype(np.int8).reshape(*step.shape, *by_light), step, span.center.reshape(by_light),
        np.array(span.energy), np.zeros(0),
    )  # fmt: skip
    return compressed_view._replace(missed=_residual_energy(rows, compressed_view))._asdict()


def _assign_clusters(z: F32, clusters: Clusters) -> tuple[NDArray[np.intp], F32]:
    """Nearest cluster of each row, and its weights. (n,), (n, C)"""
    cluster_index, weight = (
        np.argmin(distances(z, clusters), axis=1),
        np.empty((len(z), clusters.components.shape[1]), np.float32),
    )
    for k in np.unique(cluster_index):
        weight[cluster_index == k] = (z[cluster_index == k] - clusters.mean[k]) @ clusters.components[k].T
    return cluster_index, weight


def _residual_energy(rows: F32, compressed_view: _CompressedView) -> F64:
    """Residual energy of the finest texels by the number of components. (C + 1,)"""
    num = compressed_view.step.shape[1]
    residual_energy, cluster_index = np.zeros(num + 1), compressed_view.cluster[: len(rows)]
    tables = (
        (compressed_view.eigen * compressed_view.step[:, :, None, None])
        .astype(np.float32)
        .reshape(*compressed_view.step.shape, rows.shape[1])
    )
    for k in np.unique(cluster_index):
        members = np.flatnonzero(cluster_index == k)
        residuals = rows[members] - compressed_view.mean[k].astype(np.float32).ravel()
        residual_energy[0] += _energy(residuals)
        for j in range(num):
            residuals -= compressed_view.weight[members, j, None].astype(np.float32) * tables[k, j]
            residual_energy[1 + j] += _energy(residuals)
    return residual_energy


def _stack_views(
    images: ViewArrays, compressed_views: list[_CompressedView], bits: NDArray[np.uint8], energy: float
) -> LocalPcaBtf:
    """Stack the views; those with fewer clusters are padded."""
    nothing = np.zeros((images.size[0] * images.size[1], 1), np.float32)
    shapes = [level.shape[:2] for level in build_mip_levels(nothing, images.size)]
    ends = np.cumsum([0, *(height * width for height, width in shapes)])
    max_clusters = max(len(compressed_view.mean) for compressed_view in compressed_views)

    def stacked(name: str) -> NDArray[Any]:
        arrays = [getattr(compressed_view, name) for compressed_view in compressed_views]
        return np.stack(
            [np.pad(array, [(0, max_clusters - len(array)), *[(0, 0)] * (array.ndim - 1)]) for array in arrays]
        )

    return LocalPcaBtf(
        grid=images.grid,
        levels=np.array([(first, *shape) for first, shape in zip(ends[:-1], shapes, strict=True)], np.int32),
        cluster=np.stack([compressed_view.cluster for compressed_view in compressed_views]),
        weight=np.stack([compressed_view.weight for compressed_view in compressed_views]),
        bits=bits,
        mean=stacked("mean"),
        eigen=stacked("eigen"),
        step=stacked("step"),
        average=np.stack([compressed_view.average for compressed_view in compressed_views]),
        height=np.zeros((1, 1), np.float32),
        error=tuple(
            float(rms)
            for rms in np.sqrt(
                np.sum([compressed_view.missed for compressed_view in compressed_views], axis=0) / energy
            )
        ),
    )


def build_mip_levels(
    z: Shaped[F32, "texels channels"], size: tuple[int, int]
) -> list[Shaped[F32, "height width channels"]]:
    """Average blocks of 2 × 2 texels repeatedly, down to one texel.

    Args:
        z: coordinates of the finest level's texels in the span, row by row. size: height and width.
    Returns:
        All levels, the finest first.
    """
    levels = [z.reshape(*size, z.shape[1])]
    while levels[-1].shape[:2] != (1, 1):
        image = levels[-1]
        height, width = image.shape[:2]
        image = image[: max(1, height // 2 * 2), : max(1, width // 2 * 2)]
        if height > 1:
            image = 0.5 * (image[0::2] + image[1::2])
        if width > 1:
            image = 0.5 * (image[:, 0::2] + image[:, 1::2])
        levels.append(image)
    return levels
