"""From all values of a BTF to what is kept: local PCA of the texels, one view direction after another (Müller 2004).

Seen from one side, a texel is a row of its values in light from all sides, a few hundred numbers. Rows are brought to
what spans nearly all of them, clustered there, and mapped back; how far clusters and components have to go for an error
bound is found from some of the views. The error that is told is that of what was kept, as it is rounded.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np
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
# texels times directions: values of one side take 400 MB, and are there up to four times
_MAX_TEXEL_DIRECTIONS = 1 << 25
_CLUSTERS = (1, 2, 4, 8, 16, 32, 64)  # among which the number is chosen
_SEED = 0  # of the first clusters
_SPAN = 64  # R: numbers that a texel's row is brought to
_NUM_CHOICE_VIEWS = 5  # views that numbers are chosen by
_CHOICE_PROGRESS = 0.2  # of the time, about
_EXTRA_COMPONENTS = 2  # components that are found, in case that other views need them
_MIN_RATIO = 2.5  # what is larger is no compression
_LAST_COMPONENT_BITS = (3, 4, 5, 6, 8)  # of the weights of the last component, among which the number is chosen


class ViewArrays(Protocol):
    """All values of a BTF, as they are read."""

    grid: DirectionGrid
    size: tuple[int, int]

    def get_view(self, view: int) -> F32:
        """Every texel's values from one direction. (lights, texels, 3) float32, finite, not negative"""
        ...


class _Span(NamedTuple):
    """rows ≈ centre + z basis, orthonormal. z: (texels, R). basis: (R, F). lost: squares missed. energy: of all."""

    z: F32
    basis: F32
    center: F32
    residual: float
    energy: float


class _PcaChoice(NamedTuple):
    """clusters, components: of each view. bits: of the weights of each component. (components,) uint8"""

    clusters: int
    components: int
    bits: NDArray[np.uint8]


class _CompressedView(NamedTuple):
    """One side's part: a view of `LocalPcaBtf`'s arrays; squares of all, and missed by each number of components."""

    cluster: NDArray[np.uint8]
    weight: NDArray[np.int8]
    mean: NDArray[np.float16]
    eigen: NDArray[np.int8]
    step: F32
    average: F32
    energy: NDArray[np.float64]
    missed: F64


def max_texels(directions: int) -> int:
    """How many can be kept of a BTF of so many directions."""
    return min(MAX_TEXELS, _MAX_TEXEL_DIRECTIONS // directions)


def compress(
    images: ViewArrays,
    bound: float,
    progress: Callable[[float], object],
    is_canceled: Callable[[], bool],
    partial_compression: PartialCompression | None = None,
) -> LocalPcaBtf:
    """Choose clusters and components so that no more is kept than an error bound needs.

    Args:
        images: the BTF. bound: relative RMS that is allowed.
        progress: called with the share done. is_canceled: asked before each view.
        partial_compression: parts that were found before, which are not found again; new ones are put there.
    Raises:
        MaterialError: values are not finite, or negative, or the BTF is black. CancelledError: `is_canceled` said so.
    """
    (height, width), num_views = images.size, images.grid.num_directions
    if not 0 < height * width <= max_texels(num_views):
        raise MaterialError(
            f"the BTF has {width}×{height} texels; in {num_views} directions at most {max_texels(num_views):,} can be "
            f"kept, "
            "scale it down"
        )

    def read_rows(view: int, fraction: float) -> F32:
        if is_canceled():
            raise CancelledError("the compression was cancelled")
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
    """What was found before, else find it now."""
    arrays = None if partial_compression is None else partial_compression.load(name)
    if arrays is None:
        arrays = compute()
        if partial_compression is not None:
            partial_compression.save(name, arrays)
    return arrays


def _choose_from_views(images: ViewArrays, bound: float, read_rows: Callable[[int, float], F32]) -> _PcaChoice:
    """Choose clusters, components and bits by some of the views."""
    num_views = images.grid.num_directions
    sampled_views = np.unique(np.linspace(0, num_views - 1, _NUM_CHOICE_VIEWS).round().astype(int))
    spans = [
        _span(read_rows(view, _CHOICE_PROGRESS * index / len(sampled_views)))
        for index, view in enumerate(sampled_views)
    ]  # fmt: skip
    return _choose_pca(spans, bound)


def _view_rows(images: ViewArrays, view: int) -> F32:
    """Every texel's values from one side. (texels, lights · 3)"""
    values = images.get_view(view)
    if not np.isfinite(values).all() or values.min() < 0:
        raise MaterialError("values of the BTF are negative or no numbers")
    return np.ascontiguousarray(values.transpose(1, 0, 2)).reshape(values.shape[1], -1)


def _span(rows: F32) -> _Span:
    center = rows.mean(axis=0)
    deviations = rows - center
    components = leading_components(deviations, _SPAN)
    basis = components if len(components) else np.zeros((1, rows.shape[1]), np.float32)  # all texels are alike
    z = deviations @ basis.T
    residual = max(_energy(deviations) - _energy(z), 0.0)
    return _Span(z, basis, center, residual, _energy(rows))


def _energy(rows: F32) -> float:
    return float(np.einsum("nr,nr->", rows, rows, dtype=np.float64))


def _choose_pca(spans: list[_Span], bound: float) -> _PcaChoice:
    """Find what keeps some views to a bound in the least space, else what errs least; and some components more."""
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
    """Bytes of a view, nearly."""
    return num_clusters * (2 + len(bits)) * values + texels * (cluster_bits(num_clusters) + float(bits.sum())) / 8


def _rounding_error(z: F32, clusters: Clusters) -> F64:
    """Squares that rounding of weights misses, were the largest of each cluster one step. (C,)"""
    out = np.zeros(clusters.components.shape[1])
    for k in np.unique(clusters.cluster_index):
        weight = (z[clusters.cluster_index == k] - clusters.mean[k]) @ clusters.components[k].T
        out += len(weight) * np.abs(weight).max(axis=0).astype(np.float64) ** 2 / 12
    return out


def _allocate_bits(residual: F64, last: int) -> NDArray[np.uint8]:
    """Bits of weights: `last` for the last component, one more for four times as many squares that one tells. (C,)"""
    explained = np.maximum(-np.diff(residual), 1e-30)
    return np.asarray(np.clip(last + np.rint(0.5 * np.log2(explained / explained[-1:])), last, 8), np.uint8)


def _compress_view(read_rows: Callable[[], F32], size: tuple[int, int], choice: _PcaChoice, view: int) -> Arrays:
    """Cluster the texels of one view, and round what tells them: a `_CompressedView`."""
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
    """Which cluster tells each row best, and by which weights. (n,), (n, C)"""
    cluster_index, weight = (
        np.argmin(distances(z, clusters), axis=1),
        np.empty((len(z), clusters.components.shape[1]), np.float32),
    )
    for k in np.unique(cluster_index):
        weight[cluster_index == k] = (z[cluster_index == k] - clusters.mean[k]) @ clusters.components[k].T
    return cluster_index, weight


def _residual_energy(rows: F32, compressed_view: _CompressedView) -> F64:
    """Squares that what is kept misses of the finest texels, by how many components are used. (C + 1,)"""
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
    """Put the views together. Clusters that a view has fewer of are empty there."""
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


def build_mip_levels(z: F32, size: tuple[int, int]) -> list[F32]:
    """Average texels over 2 × 2, again and again, down to one: what a distant eye sees.

    Args:
        z: of the finest, row after row. (height · width, R). size: height and width.
    Returns:
        (height, width, R) of each level, the finest first.
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
