"""A compressed BTF: for each view direction, cluster means and eigenvectors, and a cluster and weights per texel.

    B_x(v, l) ≈ M_vk(l) + Σ_j α_vj(x) E_vkj(l),   k = k_v(x)

Two coders make it (`relume.assets.btf.compress`). One clusters each view by itself. The other clusters whole BRDFs as
Müller 2004, section 3: all views share the cluster and the weights of a texel of the relief, and each view has them
where it shows that texel. Values are radiance toward v per unit irradiance perpendicular to l; the cosine is included.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.direction_rings import DirectionGrid

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I8 = NDArray[np.int8]
U8 = NDArray[np.uint8]


INT8_MAX = 127
MAX_HEIGHT = 4.0
"""Largest height of a relief, in side lengths of its texture: a ray would cross many periods of a higher one."""


class SharedTexels(NamedTuple):
    """Clusters and weights of the finest level that all views share, by texel of the relief; see `LocalPcaBtf`."""

    cluster: Shaped[U8, " texels"]
    weight: Shaped[I8, "texels C"]


@dataclass(frozen=True, eq=False)
class LocalPcaBtf:
    """A compressed BTF with V view and L light directions, in K clusters with C components for each view.

    Attributes:
        grid: grid of the view and the light directions.
        levels: first texel, height and width of each mip level.
        cluster: cluster index of each texel of each level.
        weight: weights α, in units of `step`.
        mean: cluster means M.
        mean_step: quantization step of the difference between a mean and the average.
        eigen: eigenvectors E, in units of `step`.
        step: quantization step of the product of weight and eigenvector.
        average: mean of all texels.
        height: height of the relief above the plane, in side lengths of the texture; one zero if unknown.
        error: relative RMS error of the texels by the number of components, from zero to C.
        shared: what all views share, from which `cluster` and `weight` of the finest level follow; None if each view
            has its own.
    """

    grid: DirectionGrid
    levels: Shaped[NDArray[np.int32], "levels 3"]
    cluster: Shaped[U8, "V texels"]
    weight: Shaped[I8, "V texels C"]
    mean: Shaped[NDArray[np.float16], "V K L 3"]
    mean_step: Shaped[F32, "V K"]
    eigen: Shaped[I8, "V K C L 3"]
    step: Shaped[F32, "V K C"]
    average: Shaped[F32, "V L 3"]
    height: Shaped[F32, "height width"]
    error: tuple[float, ...]
    shared: SharedTexels | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in texels."""
        return int(self.levels[0, 1]), int(self.levels[0, 2])

    @property
    def num_components(self) -> int:
        """Number of components, C."""
        return int(self.weight.shape[2])

    @property
    def measured_bytes(self) -> int:
        """Uncompressed size: one byte for each channel of each image, as measurements are published."""
        directions = self.grid.num_directions
        return self.size[0] * self.size[1] * directions * directions * 3

    def with_components(self, num: int) -> LocalPcaBtf:
        """Keep only the first components."""
        num_components = max(0, min(num, self.num_components))
        return replace(
            self,
            weight=np.ascontiguousarray(self.weight[..., :num_components]),
            eigen=self.eigen[:, :, :num_components],
            step=self.step[..., :num_components],
            error=self.error[: num_components + 1],
            shared=self.shared and SharedTexels(self.shared.cluster, self.shared.weight[:, :num_components]),
        )

    def tables(self) -> Shaped[F32, "V K mean_and_components 3 L"]:
        """Means and components for sums over light directions."""
        components = self.eigen.astype(np.float32) * self.step[..., None, None]
        mean_and_components = np.concatenate([self.mean[:, :, None].astype(np.float32), components], axis=2)
        return np.ascontiguousarray(mean_and_components.swapaxes(-1, -2))

    def evaluate(
        self, view: int, texels: Shaped[NDArray[np.int64], " n"], texel_weights: Shaped[F64, " n"]
    ) -> Shaped[F64, "L 3"]:
        """Weighted sum of texels for one view direction: BRDF · cosine for each light direction.

        Args:
            view: index of the view direction. texels: indices of the texels. texel_weights: weight of each texel.
        """
        cluster_index, total = self.cluster[view, texels], np.zeros(self.mean.shape[2:])
        for k in np.unique(cluster_index):
            cluster_texels, cluster_weights = texels[cluster_index == k], texel_weights[cluster_index == k]
            weight = cluster_weights @ self.weight[view, cluster_texels].astype(np.float64) * self.step[view, k]
            total += cluster_weights.sum() * self.mean[view, k].astype(np.float64)
            total += np.einsum("j,jlc->lc", weight, self.eigen[view, k].astype(np.float64))
        return total

    def texel_brdf(self, texel_index: int) -> Shaped[F64, "V L 3"]:
        """BRDF · cosine of a texel for all pairs of directions."""
        all_views = np.arange(self.grid.num_directions)
        k = self.cluster[:, texel_index]
        weight = self.weight[:, texel_index].astype(np.float64) * self.step[all_views, k]
        deviation = np.einsum("vj,vjlc->vlc", weight, self.eigen[all_views, k].astype(np.float64))
        return np.asarray(self.mean[all_views, k].astype(np.float64) + deviation)
