"""A compressed BTF: from each side, means and eigenvectors of clusters of texels, and each texel's weights.

    B_x(v, l) ≈ M_vk(l) + Σ_j α_vj(x) E_vkj(l),   k = k_v(x)

Müller 2004, section 3: eigenvectors are over the light, for each view direction apart. Relief moves across texels from
one side to the next; clusters of each view follow it. Values are radiance towards v for light of one unit of irradiance
across its direction l: the cosine is in them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from relume.btf.packing import cluster_bits, packed_bytes
from relume.btf.rings import Rings

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]
I8 = NDArray[np.int8]


LARGEST = 127  # of what is kept in a byte
MOST_HEIGHT = 4.0
"""Of a relief, in sides of its texture: a ray would pass many periods of a higher one."""
U8 = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class EigenBtf:
    """What is kept of a BTF of V view and L light directions, in K clusters with C components for each view.

    Attributes:
        rings: of both directions.
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

    rings: Rings
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
        of_texels = packed_bytes(self.size[0] * self.size[1], bits)
        tables = self.mean.nbytes + self.eigen.nbytes + self.step.nbytes
        return self.rings.num_directions * of_texels + tables + self.height.nbytes

    @property
    def measured_bytes(self) -> int:
        """The same uncompressed: a byte for each channel of each image, as measurements are published."""
        directions = self.rings.num_directions
        return self.size[0] * self.size[1] * directions * directions * 3

    def with_components(self, num: int) -> EigenBtf:
        """Use the first of them alone."""
        kept = max(0, min(num, self.num_components))
        return replace(
            self,
            weight=np.ascontiguousarray(self.weight[..., :kept]),
            bits=self.bits[:kept],
            eigen=self.eigen[:, :, :kept],
            step=self.step[..., :kept],
            error=self.error[: kept + 1],
        )

    def tables(self) -> F32:
        """Means and components for sums over light: (V, K, 1 + C, 3, L) float32."""
        components = self.eigen.astype(np.float32) * self.step[..., None, None]
        both = np.concatenate([self.mean[:, :, None].astype(np.float32), components], axis=2)
        return np.ascontiguousarray(both.swapaxes(-1, -2))

    def sum_from(self, view: int, texels: NDArray[np.int64], shares: F64) -> F64:
        """Texels seen from one side, summed: the BRDF times cosine. (L, 3)

        Args:
            view: the side. texels: their numbers. (n,). shares: of each. (n,)
        """
        of, total = self.cluster[view, texels], np.zeros(self.mean.shape[2:])
        for k in np.unique(of):
            some, share = texels[of == k], shares[of == k]
            weight = share @ self.weight[view, some].astype(np.float64) * self.step[view, k]
            total += share.sum() * self.mean[view, k].astype(np.float64)
            total += np.einsum("j,jlc->lc", weight, self.eigen[view, k].astype(np.float64))
        return total

    def texel(self, number: int) -> F64:
        """The BRDF times cosine of a texel. (V, L, 3)"""
        every = np.arange(self.rings.num_directions)
        k = self.cluster[:, number]
        weight = self.weight[:, number].astype(np.float64) * self.step[every, k]
        told = np.einsum("vj,vjlc->vlc", weight, self.eigen[every, k].astype(np.float64))
        return np.asarray(self.mean[every, k].astype(np.float64) + told)
