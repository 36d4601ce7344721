"""One view of a BTF before and after compression, as both coders represent it."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid
from relume.assets.btf.local_pca_btf import INT8_MAX, LocalPcaBtf, SharedTexels
from relume.core.errors import MaterialError
from relume.math.local_pca import leading_components

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

SPAN = 64
"""R: dimension of the subspace of a view's rows that the coders work in."""
SEED = 0
"""Seed of the initial clusters."""
_TINY = 1e-30


class ViewArrays(Protocol):
    """All values of a BTF."""

    grid: DirectionGrid
    size: tuple[int, int]

    def get_view(self, view: int) -> Shaped[F32, "lights texels 3"]:
        """Values of all texels from one view direction, finite and not negative."""
        ...


class Span(NamedTuple):
    """rows ≈ center + z basis, orthonormal. z: (texels, R). basis: (R, F). residual, energy: sums of squares."""

    z: F32
    basis: F32
    center: F32
    residual: float
    energy: float


class CompressedView(NamedTuple):
    """One view of `LocalPcaBtf`'s arrays; total energy, and residual energy by the number of components."""

    cluster: NDArray[np.uint8]
    weight: NDArray[np.int8]
    mean: NDArray[np.float16]
    mean_step: F32
    eigen: NDArray[np.int8]
    step: F32
    average: F32
    energy: NDArray[np.float64]
    missed: F64


def view_rows(images: ViewArrays, view: int) -> Shaped[F32, "texels lights_channels"]:
    """Values of all texels from one view direction.

    Raises:
        MaterialError: values are not finite, or negative.
    """
    values = images.get_view(view)
    if not np.isfinite(values).all() or values.min() < 0:
        raise MaterialError("the BTF has negative or non-finite values; check its images")
    return np.ascontiguousarray(values.transpose(1, 0, 2)).reshape(values.shape[1], -1)


def compute_span(rows: Shaped[F32, "texels F"]) -> Span:
    """Project rows onto the subspace of nearly all of their energy."""
    center = rows.mean(axis=0)
    deviations = rows - center
    components = leading_components(deviations, SPAN)
    basis = components if len(components) else np.zeros((1, rows.shape[1]), np.float32)  # all texels are equal
    z = deviations @ basis.T
    return Span(z, basis, center, max(sum_squares(deviations) - sum_squares(z), 0.0), sum_squares(rows))


def sum_squares(rows: F32) -> float:
    """Sum of all squares, in double precision."""
    return float(np.einsum("nr,nr->", rows, rows, dtype=np.float64))


def round_tables(
    mean: Shaped[F32, "K F"],
    eigen: Shaped[F32, "K C F"],
    average: Shaped[F32, " F"],
    mean_step: Shaped[F32, " K"],
    eigen_step: Shaped[F32, "K C"],
) -> tuple[NDArray[np.float16], F32, NDArray[np.int8], F32]:
    """Round cluster means, as differences from the average, and eigenvectors to bytes.

    Args:
        mean, eigen: tables of a view. average: mean of all texels.
        mean_step, eigen_step: steps; larger ones are used where a byte would overflow.
    Returns:
        Means, their steps, eigenvectors in steps, their steps.
    """
    deviation = mean - average
    mean_step = np.maximum(np.maximum(mean_step, np.abs(deviation).max(axis=1) / INT8_MAX), _TINY).astype(np.float32)
    eigen_step = np.maximum(np.maximum(eigen_step, np.abs(eigen).max(axis=2, initial=0) / INT8_MAX), _TINY)
    rounded = np.rint(deviation / mean_step[:, None]) * mean_step[:, None]
    codes = np.rint(eigen / eigen_step[:, :, None]).astype(np.int8)
    return (average + rounded).astype(np.float16), mean_step, codes, eigen_step.astype(np.float32)


def residual_by_components(rows: Shaped[F32, "texels F"], compressed_view: CompressedView) -> Shaped[F64, " errors"]:
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
        residual_energy[0] += sum_squares(residuals)
        for j in range(num):
            residuals -= compressed_view.weight[members, j, None].astype(np.float32) * tables[k, j]
            residual_energy[1 + j] += sum_squares(residuals)
    return residual_energy


def stack_views(
    images: ViewArrays,
    compressed_views: list[CompressedView],
    height: Shaped[F32, "height width"],
    shared: SharedTexels | None = None,
) -> LocalPcaBtf:
    """Stack the views; those with fewer clusters are padded.

    Args:
        images: the BTF. compressed_views: all views. height: of the relief, in side lengths of the texture.
        shared: what all views share, if they do.
    Raises:
        MaterialError: the BTF is black.
    """
    nothing = np.zeros((images.size[0] * images.size[1], 1), np.float32)
    shapes = [level.shape[:2] for level in build_mip_levels(nothing, images.size)]
    ends = np.cumsum([0, *(rows * columns for rows, columns in shapes)])
    max_clusters = max(len(compressed_view.mean) for compressed_view in compressed_views)
    energy = float(sum(compressed_view.energy for compressed_view in compressed_views))
    if energy <= 0:
        raise MaterialError("the BTF is black; check its images")

    def stacked(name: str) -> NDArray[Any]:
        arrays = [getattr(compressed_view, name) for compressed_view in compressed_views]
        return np.stack(
            [np.pad(array, [(0, max_clusters - len(array)), *[(0, 0)] * (array.ndim - 1)]) for array in arrays]
        )

    missed = np.sum([compressed_view.missed for compressed_view in compressed_views], axis=0)
    return LocalPcaBtf(
        grid=images.grid,
        levels=np.array([(first, *shape) for first, shape in zip(ends[:-1], shapes, strict=True)], np.int32),
        cluster=np.stack([compressed_view.cluster for compressed_view in compressed_views]),
        weight=np.stack([compressed_view.weight for compressed_view in compressed_views]),
        mean=stacked("mean"),
        mean_step=stacked("mean_step"),
        eigen=stacked("eigen"),
        step=stacked("step"),
        average=np.stack([compressed_view.average for compressed_view in compressed_views]),
        height=height,
        error=tuple(float(rms) for rms in np.sqrt(missed / energy)),
        shared=shared,
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
