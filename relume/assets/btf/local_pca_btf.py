"""A compressed BTF: from each side, means and eigenvectors of clusters of texels, and each texel's weights.

    B_x(v, l) ≈ M_vk(l) + Σ_j α_vj(x) E_vkj(l),   k = k_v(x)

Local PCA for each view direction, with eigenvectors over the light. Müller 2004, section 3, clusters whole BRDFs
instead: one cluster and one weight vector per texel for all views. Relief moves across texels from one view to the
next, and clusters per view follow it (docs/btf.md#equations). Values are radiance toward v for light of unit irradiance
across its direction l, with the cosine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.assets.btf.bit_packing import cluster_bits, packed_bytes
from relume.assets.btf.direction_rings import DirectionGrid

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I8 = NDArray[np.int8]


INT8_MAX = 127  # of what is kept in a byte
MAX_HEIGHT = 4.0
"""Of a relief, in sides of its texture: a ray would pass many periods of a higher one."""
U8 = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class LocalPcaBtf:
    """What is kept of a BTF of V view and L light directions, in K clusters with C components for each view.

    Attributes:
        grid: of both directions.
        levels: first texel, height, width of the texels and of their means over 2 × 2, over 4 × 4, and so on.
            (levels, 3) int32
        cluster: of each texel of each level. (V, texels) uint8
        weight: α, in steps that are in those of `step`. (V, texels, C) int8
        bits: that weights of each component need, sign included. (C,) uint8
        mean: M. (V, K, L, 3) float16
        eigen: E, in steps of `step`. (V, K, C, L, 3) int8
        step: (V, K, C) float32
        average: of all texels. (V, L, 3) float32
        height: of the relief over the plane, in sides of the texture; one zero where it is not known.
            (height, width) float32
        error: of the texels, relative RMS, by how many components are used, from none on. (C + 1,)
    """

    grid: DirectionGrid
    levels: NDArray[np.int32]
    cluster: NDArray[np.uint8]
    weight: I8
    bits: U8
    mean: NDArray[np.float16]
    eigen: I8
    step: F32
    average: F32
    height: F32
    error: tuple[float, ...]

    @property
    def size(self) -> tuple[int, int]:
        """Height and width in texels."""
        return int(self.levels[0, 1]), int(self.levels[0, 2])

    @property
    def num_components(self) -> int:
        """C."""
        return int(self.weight.shape[2])

    @property
    def num_bytes(self) -> int:
        """What is kept, the coarser levels left out, which files of measurements do not have either."""
        bits = np.append(self.bits, np.uint8(cluster_bits(self.mean.shape[1])))
        texel_bytes = packed_bytes(self.size[0] * self.size[1], bits)
        tables = self.mean.nbytes + self.eigen.nbytes + self.step.nbytes
        return self.grid.num_directions * texel_bytes + tables + self.height.nbytes

    @property
    def measured_bytes(self) -> int:
        """The same uncompressed: a byte for each channel of each image, as measurements are published."""
        directions = self.grid.num_directions
        return self.size[0] * self.size[1] * directions * directions * 3

    def with_components(self, num: int) -> LocalPcaBtf:
        """Use the first of them alone."""
        num_components = max(0, min(num, self.num_components))
        return replace(
            self,
            weight=np.ascontiguousarray(self.weight[..., :num_components]),
            bits=self.bits[:num_components],
            eigen=self.eigen[:, :, :num_components],
            step=self.step[..., :num_components],
            error=self.error[: num_components + 1],
        )

    def tables(self) -> F32:
        """Means and components for sums over light: (V, K, 1 + C, 3, L) float32."""
        components = self.eigen.astype(np.float32) * self.step[..., None, None]
        mean_and_components = np.concatenate([self.mean[:, :, None].astype(np.float32), components], axis=2)
        return np.ascontiguousarray(mean_and_components.swapaxes(-1, -2))

    def evaluate(self, view: int, texels: NDArray[np.int64], texel_weights: F64) -> F64:
        """Texels seen from one side, summed: the BRDF times cosine. (L, 3)

        Args:
            view: the side. texels: their numbers. (n,). texel_weights: of each. (n,)
        """
        cluster_index, total = self.cluster[view, texels], np.zeros(self.mean.shape[2:])
        for k in np.unique(cluster_index):
            cluster_texels, cluster_weights = texels[cluster_index == k], texel_weights[cluster_index == k]
            weight = cluster_weights @ self.weight[view, cluster_texels].astype(np.float64) * self.step[view, k]
            total += cluster_weights.sum() * self.mean[view, k].astype(np.float64)
            total += np.einsum("j,jlc->lc", weight, self.eigen[view, k].astype(np.float64))
        return total

    def texel_brdf(self, texel_index: int) -> F64:
        """The BRDF times cosine of a texel. (V, L, 3)"""
        all_views = np.arange(self.grid.num_directions)
        k = self.cluster[:, texel_index]
        weight = self.weight[:, texel_index].astype(np.float64) * self.step[all_views, k]
        deviation = np.einsum("vj,vjlc->vlc", weight, self.eigen[all_views, k].astype(np.float64))
        return np.asarray(self.mean[all_views, k].astype(np.float64) + deviation)
